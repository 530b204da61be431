//! Waiting by looking every millisecond, where no call of the system waits for serial ports and
//! connections alike.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use softplug_abi::Micros;

use super::{Interest, Ready};
use crate::clock::Clock;
use crate::error::PortError;

/// A character at 9,600 baud; at higher rates several come together.
const LOOK_EVERY: Micros = Micros::from_millis(1);

/// What can be waited for: whatever tells whether it has something to read.
pub trait Source {
    /// Whether there is something to read, the other side's end included.
    fn is_readable(&self) -> bool;
}

/// Waits for a port, a deadline and a wake-up.
#[derive(Debug)]
pub struct Poller {
    clock: Clock,
    waker: Waker,
}

impl Poller {
    /// A poller for deadlines on `clock`.
    pub fn new(clock: Clock) -> Result<Self, PortError> {
        Ok(Self { clock, waker: Waker::default() })
    }

    /// The clock that deadlines are told on.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Ends a wait from another thread.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// Waits until the port can be read, may take bytes again, the deadline has passed or
    /// somebody wakes us. Whether a port takes bytes is found out by whoever writes: it is told
    /// to be writable each millisecond.
    pub fn wait(
        &mut self,
        port: Option<&dyn Source>,
        interest: Interest,
        deadline: Option<Micros>,
    ) -> Result<Ready, PortError> {
        let mut has_waited = false;
        loop {
            let now = self.clock.now();
            let ready = Ready {
                readable: interest.read && port.is_some_and(Source::is_readable),
                writable: interest.write && has_waited,
                hangup: false,
                timer: deadline.is_some_and(|at| at <= now),
                woken: self.waker.take(),
            };
            if ready != Ready::default() {
                return Ok(ready);
            }
            let rest = deadline.map_or(LOOK_EVERY, |at| (at - now).min(LOOK_EVERY));
            thread::sleep(Duration::from_micros(rest.0.unsigned_abs()));
            has_waited = true;
        }
    }

    /// Waits for two ports, of which each may be left out. Which of them
    /// ended the wait, whoever reads and writes finds out.
    pub fn wait_both(
        &mut self,
        ports: [Option<(&dyn Source, Interest)>; 2],
        deadline: Option<Micros>,
    ) -> Result<(), PortError> {
        let interest = Interest {
            read: ports.iter().flatten().any(|(_, interest)| interest.read),
            write: ports.iter().flatten().any(|(_, interest)| interest.write),
        };
        self.wait(Some(&Either(ports)), interest, deadline)?;
        Ok(())
    }
}

/// Two ports as one.
struct Either<'a>([Option<(&'a dyn Source, Interest)>; 2]);

impl Source for Either<'_> {
    fn is_readable(&self) -> bool {
        self.0.iter().flatten().any(|(port, interest)| interest.read && port.is_readable())
    }
}

/// Ends a [`Poller::wait`] from another thread. Wakes before the wait count.
#[derive(Clone, Debug, Default)]
pub struct Waker {
    is_awake: Arc<AtomicBool>,
}

impl Waker {
    /// Wakes the poller.
    pub fn wake(&self) {
        self.is_awake.store(true, Ordering::Release);
    }

    fn take(&self) -> bool {
        self.is_awake.swap(false, Ordering::Acquire)
    }
}
