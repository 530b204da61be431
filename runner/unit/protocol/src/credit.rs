//! A job's data by credit: the unit says up to where it has room, the server sends no further.
//!
//! Both ends count positions of the job, from 0, and both outlive a session: in the next one the
//! unit says what it has received, and the server goes on from there.

use thiserror::Error;

/// A unit gives credit anew whenever this part of its buffer is free: in between, the server does
/// not know how much of it has left.
pub const CREDIT_PARTS: u64 = 16;

/// Positions that do not fit together: somebody is at fault, and the job cannot go on.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum CreditError {
    /// Data does not go on where the last ended.
    #[error("data at byte {at} of a job of which {received} bytes have come")]
    Gap {
        /// Where it stands.
        at: u64,
        /// What has come.
        received: u64,
    },
    /// More data than there is room for.
    #[error("data up to byte {to} of a job; {until} is the end of the credit")]
    BeyondCredit {
        /// Where it ends.
        to: u64,
        /// The credit.
        until: u64,
    },
    /// Data behind the end, or an end that is not where the data ends.
    #[error("a job of {size} bytes of which {received} have come")]
    End {
        /// What was said to be its size.
        size: u64,
        /// What has come.
        received: u64,
    },
    /// The unit says that it has what was never sent.
    #[error("the unit says that {received} bytes have come; {sent} were sent")]
    NeverSent {
        /// What has come, as the unit says.
        received: u64,
        /// What was sent.
        sent: u64,
    },
}

/// The server's end: which bytes may be sent, and which can be forgotten.
///
/// ```
/// use softplug_unit_protocol::Feeding;
///
/// let mut feeding = Feeding::default();
/// feeding.credit(0, 1_000)?;
/// assert_eq!(feeding.sendable(), 1_000);
/// feeding.sent(600);
/// assert_eq!((feeding.next(), feeding.sendable()), (600, 400));
///
/// // A new session: of what was sent, 250 bytes came. The rest is sent again.
/// feeding.resume(250)?;
/// assert_eq!((feeding.next(), feeding.confirmed()), (250, 250));
/// # Ok::<(), softplug_unit_protocol::CreditError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Feeding {
    confirmed: u64,
    next: u64,
    /// Up to where anything was ever sent.
    furthest: u64,
    until: u64,
}

impl Feeding {
    /// All before this position has come to the unit.
    pub fn confirmed(&self) -> u64 {
        self.confirmed
    }

    /// The position of the next byte to send.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// How many bytes may be sent.
    pub fn sendable(&self) -> u64 {
        self.until.saturating_sub(self.next)
    }

    /// Up to which position data was sent to the unit, whether or not it came.
    pub fn furthest(&self) -> u64 {
        self.furthest
    }

    /// So many bytes were sent.
    pub fn sent(&mut self, count: u64) {
        self.next += count;
        self.furthest = self.furthest.max(self.next);
    }

    /// The unit says what has come, and up to where there is room. Less room than before changes
    /// nothing.
    ///
    /// # Errors
    /// It says that what was never sent has come, or has forgotten what it confirmed.
    pub fn credit(&mut self, received: u64, until: u64) -> Result<(), CreditError> {
        self.must_not_forget(received)?;
        self.take(received)?;
        self.until = self.until.max(until);
        Ok(())
    }

    /// A new session: the unit says what has come. Credit is given anew.
    ///
    /// # Errors
    /// It says that what was never sent has come, or has forgotten what it confirmed.
    pub fn resume(&mut self, received: u64) -> Result<(), CreditError> {
        self.must_not_forget(received)?;
        self.take(received)?;
        self.next = received;
        self.until = received;
        Ok(())
    }

    fn must_not_forget(&self, received: u64) -> Result<(), CreditError> {
        let at = self.confirmed;
        if received < at { Err(CreditError::Gap { at, received }) } else { Ok(()) }
    }

    fn take(&mut self, received: u64) -> Result<(), CreditError> {
        if received > self.furthest {
            return Err(CreditError::NeverSent { received, sent: self.furthest });
        }
        self.confirmed = self.confirmed.max(received);
        self.next = self.next.max(self.confirmed);
        Ok(())
    }
}

/// The unit's end: what may come, and what has.
///
/// ```
/// use softplug_unit_protocol::{CreditError, Fed};
///
/// let mut fed = Fed::default();
/// fed.give(4);
/// assert_eq!(fed.data(0, 4), Ok(()));
/// assert_eq!(fed.data(4, 1), Err(CreditError::BeyondCredit { to: 5, until: 4 }));
/// assert_eq!(fed.data(9, 1), Err(CreditError::Gap { at: 9, received: 4 }));
/// assert_eq!(fed.end(4), Ok(()));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Fed {
    received: u64,
    until: u64,
    size: Option<u64>,
}

impl Fed {
    /// All before this position has come.
    pub fn received(&self) -> u64 {
        self.received
    }

    /// Up to here data may come.
    pub fn until(&self) -> u64 {
        self.until
    }

    /// Whether all of it has come, and its end.
    pub fn is_whole(&self) -> bool {
        self.size.is_some()
    }

    /// There is room for so many bytes in all behind what has come. Returns whether more may come
    /// than before; credit is never taken back.
    pub fn give(&mut self, room: u64) -> bool {
        let until = self.received.saturating_add(room);
        let is_more = until > self.until;
        self.until = self.until.max(until);
        is_more
    }

    /// Data comes.
    ///
    /// # Errors
    /// Not where the last ended, more than there is room for, or behind the end: none of it is to be
    /// used.
    pub fn data(&mut self, at: u64, count: u64) -> Result<(), CreditError> {
        let Self { received, until, .. } = *self;
        if let Some(size) = self.size {
            return Err(CreditError::End { size, received });
        }
        if at != received {
            return Err(CreditError::Gap { at, received });
        }
        let to = at.saturating_add(count);
        if to > until {
            return Err(CreditError::BeyondCredit { to, until });
        }
        self.received = to;
        Ok(())
    }

    /// That was all of it.
    ///
    /// # Errors
    /// It is not.
    pub fn end(&mut self, size: u64) -> Result<(), CreditError> {
        let is_said_again = self.size == Some(size);
        if size != self.received || (self.size.is_some() && !is_said_again) {
            return Err(CreditError::End { size, received: self.received });
        }
        self.size = Some(size);
        Ok(())
    }
}
