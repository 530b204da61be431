//! A timer with deadlines in microseconds, as a descriptor to wait for.
//!
//! Time-outs of poll and epoll are often rounded to milliseconds: as long as a
//! character at 9,600 baud, and nearly a hundred at 921,600.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::io::{Errno, read};
use rustix::time::{
    Itimerspec, TimerfdClockId, TimerfdFlags, TimerfdTimerFlags, Timespec, timerfd_create,
    timerfd_settime,
};
use softplug_abi::Micros;

use crate::clock::Clock;
use crate::error::PortError;

/// A timerfd on a link's clock; one deadline at a time.
#[derive(Debug)]
pub struct Timer {
    fd: OwnedFd,
    clock: Clock,
    deadline: Option<Micros>,
}

impl Timer {
    /// A timer without deadline.
    pub fn new(clock: Clock) -> Result<Self, PortError> {
        let flags = TimerfdFlags::NONBLOCK | TimerfdFlags::CLOEXEC;
        let fd = timerfd_create(TimerfdClockId::Monotonic, flags)
            .map_err(|error| PortError::io("make a timer", error))?;
        Ok(Self { fd, clock, deadline: None })
    }

    /// The clock that deadlines are told on.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The deadline that is set.
    pub fn deadline(&self) -> Option<Micros> {
        self.deadline
    }

    /// Sets the deadline, absolute; one in the past makes the timer readable
    /// at once. No system call if nothing changes.
    pub fn set(&mut self, deadline: Option<Micros>) -> Result<(), PortError> {
        let deadline = deadline.filter(|at| *at != Micros::MAX);
        if deadline == self.deadline {
            return Ok(());
        }
        let zero = Timespec { tv_sec: 0, tv_nsec: 0 };
        let it_value = deadline.map_or(zero, |at| self.clock.timespec(at));
        let value = Itimerspec { it_interval: zero, it_value };
        timerfd_settime(&self.fd, TimerfdTimerFlags::ABSTIME, &value)
            .map_err(|error| PortError::io("set a timer", error))?;
        self.deadline = deadline;
        Ok(())
    }

    /// Whoever waits for edges knows that the deadline has passed; none is set now.
    pub(crate) fn has_expired(&mut self) {
        self.deadline = None;
    }

    /// Takes the news that the deadline has passed; then none is set.
    pub fn expired(&mut self) -> Result<bool, PortError> {
        match read(&self.fd, &mut [0; 8]) {
            Ok(_) => {
                self.deadline = None;
                Ok(true)
            }
            Err(Errno::AGAIN | Errno::INTR) => Ok(false),
            Err(error) => Err(PortError::io("read a timer", error)),
        }
    }
}

impl AsFd for Timer {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}
