//! Ptys of Linux.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open};
use rustix::io::{Errno, FdFlags, fcntl_setfd, read, retry_on_intr, write};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use softplug_abi::{LineParameters, LinkDownReason};

use super::FRESH_BAUD;
use crate::error::PortError;
use crate::port::input_sink::{Backlog, InputSink};
use crate::port::marks::Input;
use crate::port::read_outcome::ReadOutcome;
use crate::port::scratch::with_scratch;

/// A pty: we have the master, somebody opens the slave.
///
/// The slave is raw. One descriptor of it stays open here, so that the master
/// reads nothing instead of an error while nobody has the slave, and what was
/// written waits for whoever opens it next.
#[derive(Debug)]
pub struct PtyPair {
    master: OwnedFd,
    slave_path: PathBuf,
    slave: Option<OwnedFd>,
}

impl PtyPair {
    /// Makes a pty. Its master does not block.
    pub fn open() -> Result<Self, PortError> {
        Self::make().map_err(|error| PortError::io("make a pty", error))
    }

    /// Lets go of the slave: from now on the master reads
    /// [`ReadOutcome::Gone`] whenever nobody has the slave open.
    pub fn release_slave(&mut self) {
        self.slave = None;
    }

    /// The path of the slave, for whoever is on the other side.
    pub fn slave_path(&self) -> &Path {
        &self.slave_path
    }

    /// The master, to wait for or to take over.
    pub fn master(&self) -> &OwnedFd {
        &self.master
    }

    /// Reads what is there into `buffer`.
    pub fn read(&self, buffer: &mut [u8]) -> Result<ReadOutcome, PortError> {
        match retry_on_intr(|| read(&self.master, &mut *buffer)) {
            Ok(0) | Err(Errno::IO) => Ok(ReadOutcome::Gone(LinkDownReason::Disconnected)),
            Ok(count) => Ok(ReadOutcome::Read(count)),
            Err(Errno::AGAIN) => Ok(ReadOutcome::Empty),
            Err(error) => Err(PortError::io("read from the pty", error)),
        }
    }

    /// Writes what the pty takes; 0 if it is full.
    pub fn write(&self, bytes: &[u8]) -> Result<usize, PortError> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match retry_on_intr(|| write(&self.master, bytes)) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN) => Ok(0),
            Err(Errno::IO) => Err(PortError::Gone(LinkDownReason::Disconnected)),
            Err(error) => Err(PortError::io("write to the pty", error)),
        }
    }

    /// Drops what was written and not yet read by the other side.
    pub fn discard_output(&self) -> Result<(), PortError> {
        // What was written is on its way to the slave, or in its input queue.
        let failed = |error| PortError::io("discard the pty's output", error);
        tcflush(&self.master, QueueSelector::OFlush).map_err(failed)?;
        match &self.slave {
            Some(slave) => tcflush(slave, QueueSelector::IFlush).map_err(failed),
            None => Ok(()),
        }
    }

    fn make() -> rustix::io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let slave_path = PathBuf::from(name.to_string_lossy().into_owned());
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let slave = open(&slave_path, flags, Mode::empty())?;
        // Before anybody writes: a cooked slave would echo to the master.
        let mut settings = tcgetattr(&slave)?;
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings)?;
        fcntl_setfd(&master, FdFlags::CLOEXEC)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        Ok(Self { master, slave_path, slave: Some(slave) })
    }
}

impl AsFd for PtyPair {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.master.as_fd()
    }
}

/// The master of a pty as a port. The other side may come and go.
#[derive(Debug)]
pub struct PtyPort {
    pair: PtyPair,
    line: LineParameters,
}

impl PtyPort {
    /// The master of a new pty as a port.
    pub(crate) fn open(line: LineParameters) -> Result<Self, PortError> {
        Ok(Self::new(PtyPair::open()?, line))
    }

    /// A port over the master; `line` is what the far end is to believe in.
    pub fn new(pair: PtyPair, line: LineParameters) -> Self {
        Self { pair, line }
    }

    /// The descriptor to wait for.
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.pair.as_fd()
    }

    /// The path that the other side opens.
    pub fn slave_path(&self) -> &Path {
        self.pair.slave_path()
    }

    /// The characters on the line, as they were asked for.
    pub fn line(&self) -> LineParameters {
        self.line
    }

    pub(crate) fn read_to(
        &mut self,
        most: usize,
        sink: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        with_scratch(|buffer| {
            let most = most.min(buffer.len());
            let outcome = self.pair.read(&mut buffer[..most])?;
            if let ReadOutcome::Read(count) = outcome {
                sink.came(Backlog::default);
                sink.heard(Input::Bytes(&buffer[..count]));
            }
            Ok(outcome)
        })
    }

    /// The rate that the far end has set on it, if it has: of the master one reads the
    /// slave's settings.
    pub fn told_baud(&self) -> Option<u32> {
        let termios = tcgetattr(&self.pair.master).ok()?;
        Some(termios.output_speed()).filter(|baud| *baud != FRESH_BAUD)
    }

    /// Writes what the pty takes; 0 if it is full.
    pub fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        self.pair.write(bytes)
    }

    /// Drops what was written and not yet read by the other side.
    pub fn discard_output(&mut self) -> Result<(), PortError> {
        self.pair.discard_output()
    }
}
