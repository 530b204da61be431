//! Waiting by poll(2), with a timerfd and an eventfd.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;

use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd, poll};
use rustix::io::{Errno, read, write};
use softplug_abi::Micros;

use super::{Interest, Ready};
use crate::clock::Clock;
use crate::error::PortError;
use crate::timer::Timer;

/// What can be waited for: whatever has a descriptor.
pub trait Source: AsFd {}

impl<T: AsFd + ?Sized> Source for T {}

/// A timer and a waker to wait for beside a port.
#[derive(Debug)]
pub struct Poller {
    timer: Timer,
    waker: Waker,
}

impl Poller {
    /// A poller for deadlines on `clock`.
    pub fn new(clock: Clock) -> Result<Self, PortError> {
        Ok(Self { timer: Timer::new(clock)?, waker: Waker::new()? })
    }

    /// The clock that deadlines are told on.
    pub fn clock(&self) -> Clock {
        self.timer.clock()
    }

    /// Ends a wait from another thread.
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// Waits until the port is ready, the deadline has passed, somebody wakes
    /// us or a signal comes. Without a port, for the other two.
    pub fn wait(
        &mut self,
        port: Option<&dyn Source>,
        interest: Interest,
        deadline: Option<Micros>,
    ) -> Result<Ready, PortError> {
        self.timer.set(deadline)?;
        let mut wanted = PollFlags::empty();
        wanted.set(PollFlags::IN, interest.read);
        wanted.set(PollFlags::OUT, interest.write);
        let timer = PollFd::new(&self.timer, PollFlags::IN);
        let waker = PollFd::new(&self.waker, PollFlags::IN);
        let (timer_events, waker_events, port_events) = if let Some(port) = port {
            let mut fds = [timer, waker, PollFd::from_borrowed_fd(port.as_fd(), wanted)];
            wait_for(&mut fds)?;
            (fds[0].revents(), fds[1].revents(), fds[2].revents())
        } else {
            let mut fds = [timer, waker];
            wait_for(&mut fds)?;
            (fds[0].revents(), fds[1].revents(), PollFlags::empty())
        };
        let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
        Ok(Ready {
            readable: port_events.contains(PollFlags::IN),
            writable: port_events.contains(PollFlags::OUT),
            hangup: port_events.intersects(gone),
            timer: timer_events.contains(PollFlags::IN) && self.timer.expired()?,
            woken: waker_events.contains(PollFlags::IN) && self.waker.take()?,
        })
    }

    /// Waits for two ports, of which each may be left out. Which of them
    /// ended the wait, whoever reads and writes finds out.
    pub fn wait_both(
        &mut self,
        ports: [Option<(&dyn Source, Interest)>; 2],
        deadline: Option<Micros>,
    ) -> Result<(), PortError> {
        self.timer.set(deadline)?;
        let mut fds =
            vec![PollFd::new(&self.timer, PollFlags::IN), PollFd::new(&self.waker, PollFlags::IN)];
        for (port, interest) in ports.into_iter().flatten() {
            let mut wanted = PollFlags::empty();
            wanted.set(PollFlags::IN, interest.read);
            wanted.set(PollFlags::OUT, interest.write);
            fds.push(PollFd::from_borrowed_fd(port.as_fd(), wanted));
        }
        wait_for(&mut fds)?;
        let is_in = |fd: &PollFd<'_>| fd.revents().contains(PollFlags::IN);
        let (has_expired, was_woken) = (is_in(&fds[0]), is_in(&fds[1]));
        if has_expired {
            self.timer.expired()?;
        }
        if was_woken {
            self.waker.take()?;
        }
        Ok(())
    }
}

/// Ends a [`Poller::wait`] from another thread. Wakes before the wait count.
#[derive(Clone, Debug)]
pub struct Waker {
    fd: Arc<OwnedFd>,
}

impl Waker {
    fn new() -> Result<Self, PortError> {
        let fd = eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)
            .map_err(|error| PortError::io("make a wake-up", error))?;
        Ok(Self { fd: Arc::new(fd) })
    }

    /// Wakes the poller.
    pub fn wake(&self) {
        // It fails only if as many wakes wait as a counter can hold.
        let _ = write(&*self.fd, &1_u64.to_ne_bytes());
    }

    fn take(&self) -> Result<bool, PortError> {
        match read(&*self.fd, &mut [0; 8]) {
            Ok(_) => Ok(true),
            Err(Errno::AGAIN | Errno::INTR) => Ok(false),
            Err(error) => Err(PortError::io("read a wake-up", error)),
        }
    }
}

impl AsFd for Waker {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

fn wait_for(fds: &mut [PollFd<'_>]) -> Result<(), PortError> {
    match poll(fds, None) {
        Ok(_) => Ok(()),
        Err(Errno::INTR) => {
            // A signal: the caller looks at what it means.
            fds.iter_mut().for_each(PollFd::clear_revents);
            Ok(())
        }
        Err(error) => Err(PortError::io("wait for the port", error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wake_ends_one_wait() {
        let clock = Clock::start();
        let mut poller = Poller::new(clock).unwrap();
        let waker = poller.waker();
        waker.wake();
        waker.wake();
        let ready = poller.wait(None, Interest::READ, None).unwrap();
        assert_eq!(ready, Ready { woken: true, ..Ready::default() });
        // Both wakes were one; now only the deadline ends the wait.
        let soon = clock.now() + Micros(1_000);
        let ready = poller.wait(None, Interest::READ, Some(soon)).unwrap();
        assert_eq!(ready, Ready { timer: true, ..Ready::default() });
        let thread = std::thread::spawn(move || waker.wake());
        assert!(poller.wait(None, Interest::READ, None).unwrap().woken);
        thread.join().unwrap();
    }

    #[test]
    fn a_deadline_never_fires_early_and_the_past_fires_at_once() {
        let clock = Clock::start();
        let mut poller = Poller::new(clock).unwrap();
        let deadline = clock.now() + Micros(2_500);
        assert!(poller.wait(None, Interest::READ, Some(deadline)).unwrap().timer);
        assert!(clock.now() >= deadline);
        assert!(poller.wait(None, Interest::READ, Some(Micros(-5_000_000_000))).unwrap().timer);
        assert!(poller.wait(None, Interest::READ, Some(Micros(1))).unwrap().timer);
    }
}
