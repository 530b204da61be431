//! What a station is set to, and what cannot be.

use softplug_abi::{LineParameters, Micros};

use super::faults::Faults;

/// Settings of a [`Station`](super::Station).
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::r3964::{Options, OptionsError};
///
/// assert_eq!(Options::without_check().qvz, Micros::from_millis(550));
/// assert_eq!(Options::simplified().block_size, 128);
/// let impatient = Options { zvz: Micros::ZERO, ..Options::default() };
/// assert_eq!(impatient.check(), Err(OptionsError::NoTime));
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// The line's parameters; a rate of 0 means that characters leave at once.
    pub line: LineParameters,
    /// A block ends with a block check character: 3964R. Without it: 3964.
    pub bcc: bool,
    /// STX waits for DLE before the block. Off: STX, data and end go in one, and
    /// a received STX is not answered.
    pub handshake: bool,
    /// A DLE in the data goes twice. Off: data with DLE ETX in it cannot be sent.
    pub doubling: bool,
    /// Who gives way when both sides begin.
    pub priority: Priority,
    /// QVZ, the acknowledgement delay: from STX, or from the end of a block, to
    /// the other side's DLE.
    pub qvz: Micros,
    /// ZVZ, the character delay: the longest gap within a block.
    pub zvz: Micros,
    /// BWZ, the block wait: from the NAK for a block to its repetition. Zero: a
    /// bad block ends the reception.
    pub bwz: Micros,
    /// How long an STX waits when there is no buffer, until NAK.
    pub buffer_wait: Micros,
    /// How often STX is sent for a block, the first time included.
    pub setup_attempts: u32,
    /// How often a whole block is sent, or taken, the first time included.
    pub transmission_attempts: u32,
    /// Bytes of data in the largest block, both ways.
    pub block_size: usize,
    /// One NAK at the very start.
    pub nak_at_start: bool,
    /// Stray characters while idle are answered by NAK, after ZVZ of silence.
    pub nak_on_garbage: bool,
    /// From an arrival to the answer's start bit.
    pub reaction: Micros,
    /// What it does wrong.
    pub faults: Faults,
}

/// Who gives way when both sides send STX at once.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::r3964::{Options, Priority, Station};
///
/// let (line, priority) = (LineParameters::new(0), Priority::Low);
/// let mut station =
///     Station::new(Options { line, priority, nak_at_start: false, ..Options::default() })?;
/// station.send(Micros::ZERO, b"123".to_vec());
/// assert_eq!(station.poll_transmit(Micros::ZERO), Some(0x02));
/// // Both have sent STX: this side answers with DLE and takes the other's block first.
/// station.receive(Micros(5), 0x02);
/// assert_eq!(station.poll_transmit(Micros(5)), Some(0x10));
/// # Ok::<(), softplug_machines::r3964::OptionsError>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Priority {
    /// This station does.
    Low,
    /// The other side does.
    High,
    /// No rule: an STX while waiting for DLE is a wrong character.
    None,
}

impl Default for Options {
    /// 3964R with Siemens' values on 9,600 8E1, high priority, no faults.
    fn default() -> Self {
        let line =
            LineParameters { parity: softplug_abi::Parity::Even, ..LineParameters::new(9_600) };
        Self {
            line,
            bcc: true,
            handshake: true,
            doubling: true,
            priority: Priority::High,
            qvz: Micros::from_millis(2_000),
            zvz: Micros::from_millis(220),
            bwz: Micros::from_millis(4_000),
            buffer_wait: Micros::from_millis(400),
            setup_attempts: 6,
            transmission_attempts: 6,
            block_size: 1_024,
            nak_at_start: true,
            nak_on_garbage: true,
            reaction: Micros::ZERO,
            faults: Faults::default(),
        }
    }
}

impl Options {
    /// 3964: no block check character, QVZ 550 ms.
    pub fn without_check() -> Self {
        Self { bcc: false, qvz: Micros::from_millis(550), ..Self::default() }
    }

    /// Simplified 3964R: 3 tries of STX, 1 of the block, no rule for conflicts,
    /// blocks of at most 128 bytes, nothing repeated and nothing waited for.
    pub fn simplified() -> Self {
        Self {
            priority: Priority::None,
            bwz: Micros::ZERO,
            buffer_wait: Micros::ZERO,
            setup_attempts: 3,
            transmission_attempts: 1,
            block_size: 128,
            nak_at_start: false,
            nak_on_garbage: false,
            ..Self::default()
        }
    }

    /// Refuses a station that could not work.
    ///
    /// # Errors
    /// The first contradiction among the settings.
    pub fn check(&self) -> Result<(), OptionsError> {
        use OptionsError as E;

        if self.setup_attempts == 0 || self.transmission_attempts == 0 {
            return Err(E::NoAttempts);
        }
        if self.block_size == 0 {
            return Err(E::NoBlock);
        }
        if self.qvz <= Micros::ZERO || self.zvz <= Micros::ZERO {
            return Err(E::NoTime);
        }
        let spans = [self.bwz, self.buffer_wait, self.reaction];
        if spans.into_iter().any(|span| span < Micros::ZERO) {
            return Err(E::Negative);
        }
        Ok(())
    }
}

/// A station's settings contradict each other.
///
/// ```
/// use softplug_machines::r3964::Options;
///
/// let error = Options { setup_attempts: 0, ..Options::default() }.check().unwrap_err();
/// assert_eq!(error.to_string(), "0 attempts send nothing: the least is 1, the first one");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum OptionsError {
    /// The first try counts.
    #[error("0 attempts send nothing: the least is 1, the first one")]
    NoAttempts,
    /// Nothing could be received.
    #[error("a block size of 0 takes no data: give at least 1 byte")]
    NoBlock,
    /// Every answer would be too late.
    #[error("QVZ and ZVZ must be more than 0")]
    NoTime,
    /// Nobody reacts before the cause.
    #[error("BWZ, the wait for a buffer and the reaction cannot be negative")]
    Negative,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contradictions_are_refused() {
        use OptionsError as E;

        for good in [Options::default(), Options::without_check(), Options::simplified()] {
            assert_eq!(good.check(), Ok(()));
        }
        let bad = |change: fn(&mut Options)| {
            let mut options = Options::default();
            change(&mut options);
            options.check().unwrap_err()
        };
        assert_eq!(bad(|o| o.setup_attempts = 0), E::NoAttempts);
        assert_eq!(bad(|o| o.transmission_attempts = 0), E::NoAttempts);
        assert_eq!(bad(|o| o.block_size = 0), E::NoBlock);
        assert_eq!(bad(|o| o.qvz = Micros::ZERO), E::NoTime);
        assert_eq!(bad(|o| o.zvz = Micros::ZERO), E::NoTime);
        assert_eq!(bad(|o| o.bwz = Micros(-1)), E::Negative);
        assert_eq!(bad(|o| o.reaction = Micros(-1)), E::Negative);
    }
}
