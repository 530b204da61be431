//! A serial port through the `serialport` crate, where the system is not Linux.
//!
//! It does not tell of damaged characters and breaks, nor of what a UART holds; of the modem
//! lines it does. Calls return at once but for a write, which the system may keep until the
//! characters have left, for [`WRITE_TIME`] at most.

use std::fmt;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use serialport::{ClearBuffer, DataBits, FlowControl, Parity as Bit, SerialPort, StopBits};
use softplug_abi::{LineParameters, LinkDownReason, ModemLines, Parity};

use crate::difference::{SettingDifference, line_differences, refused};
use crate::error::{BadSpec, PortError};
use crate::port::input_sink::{Backlog, InputSink};
use crate::port::marks::Input;
use crate::port::read_outcome::ReadOutcome;
use crate::port::scratch::with_scratch;
use crate::port::spec::{Flow, PortOptions};

/// How long a write may be kept: more than the characters take that are in flight at most, at
/// any usual rate.
const WRITE_TIME: Duration = Duration::from_millis(500);

/// A serial port. Nobody else can open it meanwhile.
pub struct TtyPort {
    /// Reading the lines takes it mutably.
    port: Mutex<Box<dyn SerialPort>>,
    path: PathBuf,
    line: LineParameters,
    differences: Vec<SettingDifference>,
    flow: Flow,
}

impl TtyPort {
    /// Opens and sets the port. One that has something else in the end is
    /// [`PortError::NotTaken`].
    pub fn open(path: &Path, options: &PortOptions) -> Result<Self, PortError> {
        let asked = options.line;
        if asked.baud == 0 {
            return Err(BadSpec::BaudMissing(path.to_owned()).into());
        }
        let flow = match options.flow {
            Flow::Host => FlowControl::None,
            Flow::Device => FlowControl::Software,
            Flow::RtsCts => FlowControl::Hardware,
            Flow::DsrDtr | Flow::Rs485 => {
                return Err(PortError::NoFlow {
                    what: "way to do so on this system",
                    instead: "use a device server (rfc2217://), or an adapter that turns the line \
                              around by itself, and take host",
                });
            }
        };
        let name = path.to_string_lossy();
        let mut port = serialport::new(name, asked.baud)
            .data_bits(data_bits(asked.data_bits))
            .parity(parity_bit(asked.parity))
            .stop_bits(stop_bits(asked.stop_half_bits))
            .flow_control(flow)
            .dtr_on_open(true)
            .timeout(WRITE_TIME)
            .open()
            .map_err(|error| not_open(path, &error))?;
        if options.flow != Flow::RtsCts {
            // As on Linux: a machine may look at it before it sends.
            let _ = port.write_request_to_send(true);
        }
        let _ = port.clear(ClearBuffer::Input);
        let differences = line_differences(asked, line_of(&*port, asked));
        if let Some(found) = refused(&differences) {
            return Err(PortError::NotTaken { port: path.display().to_string(), found });
        }
        Ok(Self {
            port: Mutex::new(port),
            path: path.to_owned(),
            line: asked,
            differences,
            flow: options.flow,
        })
    }

    /// The port that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn is_pty(&self) -> bool {
        false
    }

    /// The characters on the line.
    pub fn line(&self) -> LineParameters {
        self.line
    }

    pub(crate) fn line_before(&self) -> LineParameters {
        self.line
    }

    /// What was asked for and the port did not take, as far as it can be used so.
    pub fn differences(&self) -> &[SettingDifference] {
        &self.differences
    }

    /// Whether there is something to read; also if the port is gone.
    pub(crate) fn is_readable(&self) -> bool {
        self.with(|port| port.bytes_to_read().map_or(true, |count| count > 0))
    }

    pub(crate) fn read_to(
        &mut self,
        most: usize,
        sink: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        let there = match self.with(|port| port.bytes_to_read()) {
            Ok(0) => return Ok(ReadOutcome::Empty),
            Ok(count) => count as usize,
            Err(_) => return Ok(ReadOutcome::Gone(LinkDownReason::Unplugged)),
        };
        with_scratch(|buffer| {
            let most = most.min(buffer.len()).min(there);
            match self.with(|port| io::Read::read(port, &mut buffer[..most])) {
                Ok(0) => Ok(ReadOutcome::Empty),
                Ok(count) => {
                    sink.came(|| self.backlog());
                    sink.heard(Input::Bytes(&buffer[..count]));
                    Ok(ReadOutcome::Read(count))
                }
                Err(error) if is_for_later(&error) => Ok(ReadOutcome::Empty),
                Err(_) => Ok(ReadOutcome::Gone(LinkDownReason::Unplugged)),
            }
        })
    }

    /// Writes what the port takes; 0 if it is full.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match self.with(|port| io::Write::write(port, bytes)) {
            Ok(count) => Ok(count),
            Err(error) if is_for_later(&error) => Ok(0),
            Err(_) => Err(PortError::Gone(LinkDownReason::Unplugged)),
        }
    }

    /// Bytes that the system holds, as far as it tells.
    pub(crate) fn unsent(&self) -> usize {
        self.with(|port| port.bytes_to_write()).map_or(0, |count| count as usize)
    }

    pub(crate) fn backlog(&self) -> Backlog {
        Backlog { bytes: self.unsent(), is_empty: false }
    }

    pub(crate) fn is_stoppable(&self) -> bool {
        self.flow.is_stoppable()
    }

    pub(crate) fn leaves_when_stopped(&self) -> Option<u32> {
        None
    }

    pub(crate) fn transmitter_empty(&self) -> Option<bool> {
        None
    }

    pub(crate) fn discard_output(&mut self) -> Result<(), PortError> {
        self.with(|port| port.clear(ClearBuffer::Output))
            .map_err(|error| PortError::io("discard the port's output", io::Error::from(error)))
    }

    /// The lines that the port has, and those that are on.
    pub(crate) fn modem_lines(&self) -> Option<(ModemLines, ModemLines)> {
        let known = [ModemLines::CTS, ModemLines::DSR, ModemLines::DCD, ModemLines::RI];
        self.with(|port| {
            let on = [
                port.read_clear_to_send().ok()?,
                port.read_data_set_ready().ok()?,
                port.read_carrier_detect().ok()?,
                port.read_ring_indicator().ok()?,
            ];
            let on = known.iter().zip(on).filter(|(_, is_on)| *is_on);
            let on = on.fold(ModemLines::default(), |all, (line, _)| all.union(*line));
            let known = known.into_iter().fold(ModemLines::OUTPUTS, ModemLines::union);
            Some((known, on))
        })
    }

    pub(crate) fn set_modem_lines(
        &mut self,
        mask: ModemLines,
        on: ModemLines,
    ) -> Result<(), PortError> {
        self.with(|port| {
            if mask.contains(ModemLines::RTS) {
                port.write_request_to_send(on.contains(ModemLines::RTS))?;
            }
            if mask.contains(ModemLines::DTR) {
                port.write_data_terminal_ready(on.contains(ModemLines::DTR))?;
            }
            Ok(())
        })
        .map_err(|_: serialport::Error| PortError::Unsupported { what: "set modem lines" })
    }

    pub(crate) fn set_break(&mut self, on: bool) -> Result<(), PortError> {
        self.with(|port| if on { port.set_break() } else { port.clear_break() })
            .map_err(|_| PortError::Unsupported { what: "send a break" })
    }

    fn with<R>(&self, act: impl FnOnce(&mut dyn SerialPort) -> R) -> R {
        let mut port = self.port.lock().unwrap_or_else(PoisonError::into_inner);
        act(&mut **port)
    }
}

impl fmt::Debug for TtyPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TtyPort").field("path", &self.path).field("line", &self.line).finish()
    }
}

impl Drop for TtyPort {
    fn drop(&mut self) {
        // What a machine holds would keep the port from closing.
        let _ = self.discard_output();
    }
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

fn not_open(path: &Path, error: &serialport::Error) -> PortError {
    use serialport::ErrorKind as Kind;
    let path = path.to_owned();
    match error.kind() {
        // The crate says the same of one that is in use.
        Kind::NoDevice | Kind::Io(ErrorKind::PermissionDenied | ErrorKind::NotFound) => {
            let there = serialport::available_ports().unwrap_or_default();
            if there.iter().any(|port| port.port_name.eq_ignore_ascii_case(&path.to_string_lossy()))
            {
                PortError::InUse { path, holders: Vec::new() }
            } else {
                PortError::NotFound { path }
            }
        }
        Kind::InvalidInput => PortError::NotATerminal { path },
        _ => PortError::io("open the port", io::Error::from(error.clone())),
    }
}

fn data_bits(count: u8) -> DataBits {
    match count {
        5 => DataBits::Five,
        6 => DataBits::Six,
        7 => DataBits::Seven,
        _ => DataBits::Eight,
    }
}

/// The crate has no mark and space, nor 1.5 stop bits: then the port has another setting, which
/// is found by comparing.
fn parity_bit(parity: Parity) -> Bit {
    match parity {
        Parity::None | Parity::Mark | Parity::Space => Bit::None,
        Parity::Odd => Bit::Odd,
        Parity::Even => Bit::Even,
    }
}

fn stop_bits(half_bits: u8) -> StopBits {
    if half_bits == 2 { StopBits::One } else { StopBits::Two }
}

/// The settings that the port has now, as far as it tells.
fn line_of(port: &dyn SerialPort, asked: LineParameters) -> LineParameters {
    LineParameters {
        baud: port.baud_rate().unwrap_or(asked.baud),
        data_bits: port.data_bits().map_or(asked.data_bits, u8::from),
        parity: port.parity().map_or(asked.parity, |bit| match bit {
            Bit::None => Parity::None,
            Bit::Odd => Parity::Odd,
            Bit::Even => Parity::Even,
        }),
        stop_half_bits: port.stop_bits().map_or(asked.stop_half_bits, |bits| 2 * u8::from(bits)),
    }
}
