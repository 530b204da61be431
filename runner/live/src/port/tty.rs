//! A terminal device as a port: a UART, an adapter, or the slave of a pty.

use std::fs;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::{Errno, read, retry_on_intr, write};
use rustix::termios::{
    InputModes, OptionalActions, QueueSelector, Termios, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush,
    tcgetattr, tcsetattr,
};
use softplug_abi::{LineParameters, LinkDownReason, ModemLines};

use super::held;
use super::holders::{group, holders, holders_but, is_pty};
use super::input_sink::{Backlog, InputOnly, InputSink};
use super::ioctl::{self, is_gone};
use super::marks::{Input, LineCounters, MarkDecoder};
use super::read_outcome::ReadOutcome;
use super::scratch::{READ_BYTES, with_scratch};
use super::settings::{apply, line_of};
use super::spec::{Flow, PortOptions};
use crate::difference::{SettingDifference, noted, refused};
use crate::error::{BadSpec, PortError};

/// More than a pty holds.
const EARLY_BYTES: usize = 65_536;

/// A terminal device, raw, non-blocking and locked.
///
/// Dropping it discards what the port has not sent, because a UART that was
/// stopped by XOFF would else hold close() for half a minute; whoever wants the
/// last bytes out waits for [`unsent`](Self::unsent) first. The settings that
/// the port had before come back, unless it was [handed over](Self::hand_over).
#[derive(Debug)]
pub struct TtyPort {
    fd: Arc<OwnedFd>,
    path: PathBuf,
    before: Termios,
    line: LineParameters,
    differences: Vec<SettingDifference>,
    decoder: MarkDecoder,
    has_counters: bool,
    pty: bool,
    /// Characters that the UART takes from the kernel at once; `None` if it is
    /// none of this computer's.
    uart: Option<u32>,
    flow: Flow,
    exclusive: bool,
    /// Whether to take back the request for low latency.
    low_latency: bool,
    gone: bool,
    /// Somebody else keeps it open, as it is.
    handed_over: bool,
    /// Bytes that had come before the port was set, not marked.
    early: Vec<u8>,
}

impl TtyPort {
    /// Opens, locks and sets the device. One that has something else in the end is
    /// left as it was found, which is [`PortError::NotTaken`]; a pty, which has
    /// neither rate nor parity, is not. What remains is found in
    /// [`differences`](Self::differences).
    pub fn open(path: &Path, options: &PortOptions) -> Result<Self, PortError> {
        if options.line.baud == 0 {
            return Err(BadSpec::BaudMissing(path.to_owned()).into());
        }
        let fd = open_device(path)?;
        let no_hardware = || PortError::NoHardware { path: path.to_owned() };
        let before = tcgetattr(&fd).map_err(|error| match error {
            error if is_gone(error) => no_hardware(),
            _ => PortError::NotATerminal { path: path.to_owned() },
        })?;
        // A name without a UART can be opened and set; only this tells.
        if ioctl::modem_lines(&fd).is_err_and(is_gone) {
            return Err(no_hardware());
        }
        let device = fs::metadata(path).ok();
        let pty = device.as_ref().is_some_and(is_pty);
        if options.exclusive {
            lock(&fd, path, pty)?;
        }
        let early = if pty { read_early(&fd, &before) } else { Vec::new() };
        let (has, differences) = apply(&fd, &before, options).map_err(|error| {
            let _ = ioctl_tiocnxcl(&fd);
            match error {
                PortError::Gone(_) => no_hardware(),
                error => error,
            }
        })?;
        let differences = if pty { noted(differences) } else { differences };
        if let Err(error) = check(path, &differences) {
            let _ = tcsetattr(&fd, OptionalActions::Now, &before);
            let _ = ioctl_tiocnxcl(&fd);
            return Err(error);
        }
        // What came before was read with other settings, unless they are the same: then somebody
        // has kept the port open for us.
        let is_as_it_was =
            before.input_modes.contains(InputModes::PARMRK) && line_of(&before) == has;
        if !pty && !is_as_it_was {
            let _ = tcflush(&fd, QueueSelector::IFlush);
        }
        let low_latency = !pty && ioctl::set_low_latency(&fd, true).is_ok_and(|before| !before);
        let counters = ioctl::counters(&fd).ok();
        let uart = device.as_ref().and_then(|device| uart_fifo(&fd, device));
        let fd = Arc::new(fd);
        // Closing a pty never waits, and what it has taken is for a reader that is only slow.
        if !pty {
            held::note(&fd);
        }
        // A pty makes no characters: the line is the far end's, as asked for.
        let line = if pty { options.line } else { has };
        Ok(Self {
            path: path.to_owned(),
            before,
            line,
            differences,
            decoder: MarkDecoder::new(has.parity, counters),
            has_counters: counters.is_some(),
            pty,
            uart,
            flow: options.flow,
            exclusive: options.exclusive,
            low_latency,
            gone: false,
            handed_over: false,
            early,
            fd,
        })
    }

    /// The device that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The descriptor to wait for.
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }

    /// Whether it is the slave of a pty: no rate, no parity, no modem lines.
    pub fn is_pty(&self) -> bool {
        self.pty
    }

    /// The characters on the line, as the port reports them; on a pty as they
    /// were asked for.
    pub fn line(&self) -> LineParameters {
        self.line
    }

    /// What was asked for and the port did not take, as far as it can be used so.
    pub fn differences(&self) -> &[SettingDifference] {
        &self.differences
    }

    /// The settings that the port had before it was opened.
    pub fn line_before(&self) -> LineParameters {
        line_of(&self.before)
    }

    /// Sets the port anew without closing it, which would drop DTR. What has
    /// come and was not read is dropped: it was heard with other settings. After
    /// [`PortError::NotTaken`] the port is set, to what it made of them.
    pub fn set_line(&mut self, options: &PortOptions) -> Result<(), PortError> {
        if options.line.baud == 0 {
            return Err(BadSpec::BaudMissing(self.path.clone()).into());
        }
        let (has, differences) = apply(&self.fd, &self.before, options)?;
        if !self.pty {
            let _ = tcflush(&self.fd, QueueSelector::IFlush);
        }
        let counters = self.counters();
        self.has_counters = counters.is_some();
        self.decoder = MarkDecoder::new(has.parity, counters);
        self.line = if self.pty { options.line } else { has };
        self.differences = if self.pty { noted(differences) } else { differences };
        self.flow = options.flow;
        check(&self.path, &self.differences)
    }

    /// Counters of the driver, if it has any.
    pub fn counters(&self) -> Option<LineCounters> {
        ioctl::counters(&self.fd).ok()
    }

    /// Reads once, at most `most` bytes, and gives what came to `sink`.
    pub fn read(
        &mut self,
        most: usize,
        sink: &mut impl FnMut(Input<'_>),
    ) -> Result<ReadOutcome, PortError> {
        self.read_to(most, &mut InputOnly(sink))
    }

    pub(super) fn read_to(
        &mut self,
        most: usize,
        sink: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        let most = most.min(READ_BYTES);
        if !self.early.is_empty() {
            let rest = self.early.split_off(most.min(self.early.len()));
            let early = std::mem::replace(&mut self.early, rest);
            sink.came(|| self.backlog());
            sink.heard(Input::Bytes(&early));
            return Ok(ReadOutcome::Read(early.len()));
        }
        with_scratch(|buffer| match retry_on_intr(|| read(&self.fd, &mut buffer[..most])) {
            // VMIN is 1: a read of nothing is a hang-up.
            Ok(0) => Ok(self.lost()),
            Ok(count) => {
                // After the read: a mark is never older than its count.
                let counters = if self.has_counters { self.counters() } else { None };
                sink.came(|| self.backlog());
                let mut give = |input: Input<'_>| sink.heard(input);
                self.decoder.decode(&buffer[..count], counters, &mut give);
                Ok(ReadOutcome::Read(count))
            }
            Err(Errno::AGAIN) => Ok(ReadOutcome::Empty),
            Err(error) if is_gone(error) => Ok(self.lost()),
            Err(error) => Err(PortError::io("read from the port", error)),
        })
    }

    /// Writes what the port takes at once; 0 if it is full.
    pub fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match retry_on_intr(|| write(&self.fd, bytes)) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN) => Ok(0),
            Err(error) if is_gone(error) => {
                self.gone = true;
                Err(PortError::Gone(LinkDownReason::Unplugged))
            }
            Err(error) => Err(PortError::io("write to the port", error)),
        }
    }

    /// Bytes in the kernel that the UART or adapter does not have yet; 0 on a
    /// pty, which does not tell.
    pub fn unsent(&self) -> usize {
        if self.pty {
            return 0;
        }
        ioctl::output_queue(&self.fd).unwrap_or(0)
    }

    /// What the kernel holds, and whether the UART below it is empty as well.
    pub fn backlog(&self) -> Backlog {
        let bytes = self.unsent();
        // The kernel's queue first: nothing but a write of ours fills it, so
        // that a UART that is empty after it has nothing to come.
        let is_empty = bytes == 0 && self.uart.is_some() && self.transmitter_empty() == Some(true);
        Backlog { bytes, is_empty }
    }

    /// Whether the partner can stop the port.
    pub(super) fn is_stoppable(&self) -> bool {
        self.flow.is_stoppable()
    }

    /// Characters that leave although the partner has stopped the port, if it
    /// is the kernel that obeys: those that the UART had taken, and the one on
    /// the line.
    pub fn leaves_when_stopped(&self) -> Option<u32> {
        self.uart.filter(|_| self.flow.is_stoppable()).map(|fifo| fifo + 1)
    }

    /// Whether the last bit of everything has left; `None` where the driver
    /// cannot tell.
    pub fn transmitter_empty(&self) -> Option<bool> {
        ioctl::transmitter_empty(&self.fd).ok()
    }

    /// Drops what the port has taken and not sent.
    pub fn discard_output(&mut self) -> Result<(), PortError> {
        tcflush(&self.fd, QueueSelector::OFlush)
            .map_err(|error| PortError::io("discard the port's output", error))
    }

    /// The lines that the port has, and those that are on.
    pub fn modem_lines(&self) -> Option<(ModemLines, ModemLines)> {
        let known = ModemLines(0x0F).union(ModemLines::OUTPUTS);
        ioctl::modem_lines(&self.fd).ok().map(|on| (known, on))
    }

    /// Sets the lines of `mask`.
    pub fn set_modem_lines(&mut self, mask: ModemLines, on: ModemLines) -> Result<(), PortError> {
        ioctl::set_modem_lines(&self.fd, mask, on)
            .map_err(|error| request_error(error, "set modem lines"))
    }

    /// Holds the line low, or no longer.
    pub fn set_break(&mut self, on: bool) -> Result<(), PortError> {
        // A pty takes the request and does nothing.
        if self.pty {
            return Err(PortError::Unsupported { what: "send a break" });
        }
        ioctl::set_break(&self.fd, on).map_err(|error| request_error(error, "send a break"))
    }

    /// Another descriptor of the open port. While it is held, dropping this port leaves everything
    /// as it is: settings, modem lines, and what comes, which waits for the next one to open it.
    pub fn hand_over(&mut self) -> io::Result<OwnedFd> {
        let kept = self.fd.try_clone()?;
        self.handed_over = true;
        // The lock would go with the last descriptor only.
        let _ = flock(&self.fd, FlockOperation::Unlock);
        if self.exclusive {
            let _ = ioctl_tiocnxcl(&self.fd);
        }
        Ok(kept)
    }

    fn lost(&mut self) -> ReadOutcome {
        self.gone = true;
        ReadOutcome::Gone(LinkDownReason::Unplugged)
    }
}

impl Drop for TtyPort {
    fn drop(&mut self) {
        if self.gone || self.handed_over {
            return;
        }
        // Closing a pty never waits, and its flush would take bytes from a
        // reader that is only slow.
        if !self.pty {
            let _ = tcflush(&self.fd, QueueSelector::OFlush);
        }
        if let Err(error) = tcsetattr(&self.fd, OptionalActions::Now, &self.before) {
            tracing::debug!(port = %self.path.display(), %error, "settings not restored");
        }
        if self.low_latency {
            let _ = ioctl::set_low_latency(&self.fd, false);
        }
        if self.exclusive {
            let _ = ioctl_tiocnxcl(&self.fd);
        }
    }
}

fn open_device(path: &Path) -> Result<OwnedFd, PortError> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let owned = || path.to_owned();
    retry_on_intr(|| open(path, flags, Mode::empty())).map_err(|error| match error {
        Errno::NOENT | Errno::NOTDIR => PortError::NotFound { path: owned() },
        Errno::ACCESS | Errno::PERM | Errno::ROFS => {
            let group = fs::metadata(path).ok().and_then(|device| group(&device));
            PortError::Permission { path: owned(), group }
        }
        Errno::BUSY => PortError::InUse { path: owned(), holders: holders(path) },
        Errno::NXIO | Errno::NODEV | Errno::IO => PortError::NoHardware { path: owned() },
        Errno::ISDIR => PortError::NotATerminal { path: owned() },
        error => PortError::io("open the port", error),
    })
}

/// Keeps others out: TIOCEXCL does not stop root, a lock stops only who looks.
fn lock(fd: &OwnedFd, path: &Path, pty: bool) -> Result<(), PortError> {
    let others = || holders_but(path, Some(fd.as_raw_fd()));
    let in_use = |holders| Err(PortError::InUse { path: path.to_owned(), holders });
    match flock(fd, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => {}
        Err(Errno::WOULDBLOCK) => return in_use(others()),
        Err(error) => tracing::debug!(port = %path.display(), %error, "port not locked"),
    }
    // A pty's slave is often held open by whoever simulates on its master, and
    // would stay exclusive if we were killed.
    if pty {
        return Ok(());
    }
    // A program that locks nothing takes bytes away all the same.
    let holders = others();
    if !holders.is_empty() {
        return in_use(holders);
    }
    if let Err(error) = ioctl_tiocexcl(fd) {
        tracing::debug!(port = %path.display(), %error, "port not exclusive");
    }
    Ok(())
}

/// Whether the port can be used in spite of what it did not take.
fn check(path: &Path, differences: &[SettingDifference]) -> Result<(), PortError> {
    let port = || path.display().to_string();
    refused(differences).map_or(Ok(()), |found| Err(PortError::NotTaken { port: port(), found }))
}

/// What a pty's far end sent before PARMRK was set: its FFs are not doubled.
fn read_early(fd: &OwnedFd, before: &Termios) -> Vec<u8> {
    let mut early = Vec::new();
    if before.input_modes.contains(InputModes::PARMRK) {
        return early;
    }
    let mut buffer = [0; READ_BYTES];
    while early.len() < EARLY_BYTES {
        match retry_on_intr(|| read(fd, &mut buffer)) {
            Ok(count) if count > 0 => early.extend_from_slice(&buffer[..count]),
            // Nothing more; a hang-up will show again at the first read.
            _ => break,
        }
    }
    early
}

/// The size of a UART's memory for what it sends; `None` of an adapter, whose
/// driver does not show it and which answers no question at once.
fn uart_fifo(fd: &OwnedFd, device: &fs::Metadata) -> Option<u32> {
    let (major, minor) = (rustix::fs::major(device.rdev()), rustix::fs::minor(device.rdev()));
    // Only the kernel's drivers of UARTs have this file, which not everybody may read.
    let attribute = format!("/sys/dev/char/{major}:{minor}/xmit_fifo_size");
    if Path::new(&attribute).exists() { ioctl::uart_fifo(fd).ok() } else { None }
}

fn request_error(error: Errno, what: &'static str) -> PortError {
    match error {
        Errno::NOTTY | Errno::INVAL | Errno::OPNOTSUPP => PortError::Unsupported { what },
        error if is_gone(error) => PortError::Gone(LinkDownReason::Unplugged),
        error => PortError::io(what, error),
    }
}
