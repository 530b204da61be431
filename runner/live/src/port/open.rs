//! One type for every kind of port.

use std::path::{Path, PathBuf};

use softplug_abi::{LineParameters, Micros, ModemLines, Parity};

use super::input_sink::{Backlog, InputOnly, InputSink};
use super::marks::Input;
use super::pty::{FRESH_BAUD, PtyPort};
use super::read_outcome::ReadOutcome;
use super::rfc2217::Rfc2217Port;
use super::spec::{PortOptions, PortSpec};
use super::tcp::TcpPort;
use super::tty::TtyPort;
use crate::difference::SettingDifference;
use crate::error::PortError;

/// An open port. Nothing here blocks.
#[derive(Debug)]
pub enum Port {
    /// A terminal device, or the slave of somebody's pty.
    Tty(TtyPort),
    /// A connection to a device server.
    Tcp(TcpPort),
    /// A device server that sets its port as asked.
    Rfc2217(Box<Rfc2217Port>),
    /// The master of a pty made here.
    Pty(PtyPort),
}

/// What a read says of the rest that gave less than it was asked for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum ShortRead {
    /// Nothing more is there until the poll tells of it.
    Empty,
    /// It took all there was; the poll need not tell of what comes behind it.
    Taken,
    /// The port may keep back what it has read and not yet given.
    KeptBack,
}

/// When a port drops what it holds of a job that has failed.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum CallsBack {
    /// Once it no longer leaves by itself.
    Stuck,
    /// At once: how much it holds is not known.
    AtOnce,
    /// It leaves, or nothing is held.
    Never,
}

impl Port {
    /// Opens a port. One that has other settings in the end than were asked for is
    /// [`PortError::NotTaken`]. Of a device server, looking up, connecting and setting its
    /// port blocks, at most for the time-out once the name is known.
    pub fn open(spec: &PortSpec, options: &PortOptions) -> Result<Self, PortError> {
        options.flow.check(spec)?;
        Ok(match spec {
            PortSpec::Device(path) => Self::Tty(TtyPort::open(path, options)?),
            PortSpec::Tcp { host, port } => Self::Tcp(TcpPort::connect(host, *port, options)?),
            PortSpec::Rfc2217 { host, port } => {
                Self::Rfc2217(Box::new(Rfc2217Port::connect(host, *port, options)?))
            }
            PortSpec::Pty => Self::Pty(PtyPort::open(options.line)?),
        })
    }

    /// The path that the other side opens, of a pty made here.
    pub fn slave_path(&self) -> Option<&Path> {
        match self {
            Self::Pty(port) => Some(port.slave_path()),
            Self::Tty(_) | Self::Tcp(_) | Self::Rfc2217(_) => None,
        }
    }

    /// The device, where there is one.
    pub fn path(&self) -> Option<PathBuf> {
        match self {
            Self::Tty(port) => Some(port.path().to_owned()),
            Self::Pty(port) => Some(port.slave_path().to_owned()),
            Self::Tcp(_) | Self::Rfc2217(_) => None,
        }
    }

    /// Reads once, at most `most` bytes, and gives what came to `sink`, in the
    /// line's order. What is not read stays with the kernel.
    pub fn read(
        &mut self,
        most: usize,
        sink: &mut impl FnMut(Input<'_>),
    ) -> Result<ReadOutcome, PortError> {
        self.read_to(most, &mut InputOnly(sink))
    }

    /// Reads once for a sink that may ask what the port held by then.
    pub(crate) fn read_to(
        &mut self,
        most: usize,
        sink: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        match self {
            Self::Tty(port) => port.read_to(most, sink),
            Self::Tcp(port) => port.read_to(most, sink),
            Self::Rfc2217(port) => port.read_to(most, sink),
            Self::Pty(port) => port.read_to(most, sink),
        }
    }

    /// Writes what the port takes at once and gives how much; 0 if it is full.
    /// [`PortError::Gone`] if the port is gone.
    pub fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        match self {
            Self::Tty(port) => port.write(bytes),
            Self::Tcp(port) => port.write(bytes),
            Self::Rfc2217(port) => port.write(bytes),
            Self::Pty(port) => port.write(bytes),
        }
    }

    /// Bytes taken that have not left the kernel, as far as it tells: not
    /// those in a UART or an adapter; 0 on a pty.
    pub fn unsent(&self) -> usize {
        match self {
            Self::Tty(port) => port.unsent(),
            Self::Tcp(port) => port.unsent(),
            Self::Rfc2217(port) => port.unsent(),
            Self::Pty(_) => 0,
        }
    }

    /// Whether the port tells what it still [holds](Self::backlog).
    pub fn tells_backlog(&self) -> bool {
        match self {
            Self::Tty(port) => !port.is_pty(),
            Self::Tcp(_) | Self::Rfc2217(_) => true,
            Self::Pty(_) => false,
        }
    }

    /// What the port tells of the bytes that it was given.
    pub fn backlog(&self) -> Backlog {
        match self {
            Self::Tty(port) => port.backlog(),
            Self::Tcp(_) | Self::Rfc2217(_) => Backlog { bytes: self.unsent(), is_empty: false },
            Self::Pty(_) => Backlog::default(),
        }
    }

    /// Whether the partner can stop the port below us, because the port obeys it
    /// (`flow = "device"`).
    pub fn is_stoppable(&self) -> bool {
        match self {
            Self::Tty(port) => port.is_stoppable(),
            Self::Rfc2217(port) => port.is_stoppable(),
            Self::Tcp(_) => true,
            Self::Pty(_) => false,
        }
    }

    /// Characters that leave although the port was stopped by the partner, if
    /// the kernel stops it: those that a UART had taken by then. `None`: nobody
    /// stops it, or where is not known.
    pub fn leaves_when_stopped(&self) -> Option<u32> {
        match self {
            Self::Tty(port) => port.leaves_when_stopped(),
            Self::Tcp(_) | Self::Rfc2217(_) | Self::Pty(_) => None,
        }
    }

    /// Whether the last bit of everything has left; `None` where nobody can
    /// tell.
    pub fn transmitter_empty(&self) -> Option<bool> {
        match self {
            Self::Tty(port) => port.transmitter_empty(),
            Self::Tcp(_) | Self::Rfc2217(_) | Self::Pty(_) => None,
        }
    }

    /// Drops what the port has taken and not sent, as far as it can be called
    /// back; nothing of a raw TCP connection can.
    pub fn discard_output(&mut self) -> Result<(), PortError> {
        match self {
            Self::Tty(port) => port.discard_output(),
            Self::Rfc2217(port) => port.discard_output(),
            Self::Pty(port) => port.discard_output(),
            Self::Tcp(_) => Ok(()),
        }
    }

    /// The modem lines that the port has, and those that are on; `None` if it
    /// has none.
    pub fn modem_lines(&self) -> Option<(ModemLines, ModemLines)> {
        match self {
            Self::Tty(port) => port.modem_lines(),
            Self::Rfc2217(port) => Some(port.modem_lines()),
            Self::Tcp(_) | Self::Pty(_) => None,
        }
    }

    /// Sets the lines of `mask`: on as in `on`, the others off.
    pub fn set_modem_lines(&mut self, mask: ModemLines, on: ModemLines) -> Result<(), PortError> {
        match self {
            Self::Tty(port) => port.set_modem_lines(mask, on),
            Self::Rfc2217(port) => port.set_modem_lines(mask, on),
            Self::Tcp(_) | Self::Pty(_) => Err(PortError::Unsupported { what: "set modem lines" }),
        }
    }

    /// Holds the line low until [`stop_break`](Self::stop_break).
    pub fn start_break(&mut self) -> Result<(), PortError> {
        self.set_break(true)
    }

    /// Ends a break.
    pub fn stop_break(&mut self) -> Result<(), PortError> {
        self.set_break(false)
    }

    /// Whether it is a pty, from either side: no rate, no parity, no modem lines.
    pub fn is_pty(&self) -> bool {
        match self {
            Self::Tty(port) => port.is_pty(),
            Self::Pty(_) => true,
            Self::Tcp(_) | Self::Rfc2217(_) => false,
        }
    }

    /// The rate that somebody has set on a pty, which keeps none itself: the program on
    /// the far side of one made here, or whoever set the device before it was opened. `None` where
    /// nobody has, and of all other ports.
    pub fn told_baud(&self) -> Option<u32> {
        match self {
            Self::Tty(port) if port.is_pty() => {
                Some(port.line_before().baud).filter(|baud| *baud != FRESH_BAUD)
            }
            Self::Pty(port) => port.told_baud(),
            Self::Tty(_) | Self::Tcp(_) | Self::Rfc2217(_) => None,
        }
    }

    /// Whether the port itself keeps the line's rate. Elsewhere bytes are
    /// only as far apart as they are written.
    pub fn rate_known(&self) -> bool {
        match self {
            Self::Tty(port) => !port.is_pty(),
            Self::Tcp(_) | Self::Rfc2217(_) | Self::Pty(_) => false,
        }
    }

    pub(crate) fn short_read(&self) -> ShortRead {
        match self {
            Self::Tty(_) | Self::Pty(_) => ShortRead::Empty,
            Self::Tcp(_) => ShortRead::Taken,
            Self::Rfc2217(_) => ShortRead::KeptBack,
        }
    }

    pub(crate) fn calls_back(&self) -> CallsBack {
        match self {
            Self::Tty(port) if !port.is_pty() => CallsBack::Stuck,
            Self::Rfc2217(port) if port.is_stoppable() => CallsBack::AtOnce,
            Self::Tty(_) | Self::Tcp(_) | Self::Rfc2217(_) | Self::Pty(_) => CallsBack::Never,
        }
    }

    /// Whether the port makes and checks the parity bit that was asked for.
    pub fn makes_parity(&self) -> bool {
        match self {
            Self::Tty(_) | Self::Rfc2217(_) => !self
                .differences()
                .iter()
                .any(|difference| matches!(difference.setting, "parity" | "data bits")),
            Self::Tcp(_) | Self::Pty(_) => {
                let line = self.line();
                line.parity == Parity::None && line.data_bits == 8
            }
        }
    }

    /// The characters on the line: as the port reports them, or as they were
    /// asked for where it has no rate of its own.
    pub fn line(&self) -> LineParameters {
        match self {
            Self::Tty(port) => port.line(),
            Self::Tcp(port) => port.line(),
            Self::Rfc2217(port) => port.line(),
            Self::Pty(port) => port.line(),
        }
    }

    /// Settings that were asked for and the port did not take, as far as it can be
    /// used so; to be reported.
    pub fn differences(&self) -> &[SettingDifference] {
        match self {
            Self::Tty(port) => port.differences(),
            Self::Rfc2217(port) => port.differences(),
            Self::Tcp(_) | Self::Pty(_) => &[],
        }
    }

    /// Does what the port does of its own: a device server is answered, and
    /// asked whether it lives. Call it when the port becomes writable and when
    /// [`poll_timeout`](Self::poll_timeout) has come; then read, because what came
    /// may have waited. [`PortError::Gone`] if the other side is dead.
    pub fn handle_timeout(&mut self, now: Micros) -> Result<(), PortError> {
        match self {
            Self::Tcp(port) => port.handle_timeout(now),
            Self::Rfc2217(port) => port.handle_timeout(now),
            Self::Tty(_) | Self::Pty(_) => Ok(()),
        }
    }

    /// When [`handle_timeout`](Self::handle_timeout) wants to be called.
    pub fn poll_timeout(&self) -> Option<Micros> {
        match self {
            Self::Tcp(port) => Some(port.poll_timeout()),
            Self::Rfc2217(port) => Some(port.poll_timeout()),
            Self::Tty(_) | Self::Pty(_) => None,
        }
    }

    /// Whether bytes of the port's own wait for room: then wait for room, too.
    pub fn has_output(&self) -> bool {
        match self {
            Self::Rfc2217(port) => port.has_output(),
            Self::Tty(_) | Self::Tcp(_) | Self::Pty(_) => false,
        }
    }

    /// Whether the other side wants a pause: room to write says nothing then,
    /// and the end of the pause comes with what is read.
    pub fn is_suspended(&self) -> bool {
        match self {
            Self::Rfc2217(port) => port.is_suspended(),
            Self::Tty(_) | Self::Tcp(_) | Self::Pty(_) => false,
        }
    }

    /// Whether changes of modem lines come with what is read. Elsewhere they
    /// must be looked for.
    pub fn tells_modem_lines(&self) -> bool {
        match self {
            Self::Rfc2217(_) => true,
            Self::Tty(_) | Self::Tcp(_) | Self::Pty(_) => false,
        }
    }

    fn set_break(&mut self, on: bool) -> Result<(), PortError> {
        match self {
            Self::Tty(port) => port.set_break(on),
            Self::Rfc2217(port) => port.set_break(on),
            Self::Tcp(_) | Self::Pty(_) => Err(PortError::Unsupported { what: "send a break" }),
        }
    }
}
