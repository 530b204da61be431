//! Ports: a terminal, a TCP connection or a pty behind one interface that
//! never blocks.

pub(crate) mod input_sink;
mod marks;
mod open;
pub mod pty;
mod read_outcome;
mod rfc2217;
pub(crate) mod rfc2217_bound;
pub(crate) mod rfc2217_values;
pub(crate) mod scratch;
mod spec;
pub(crate) mod stream;
mod tcp;

#[cfg(target_os = "linux")]
mod descriptor;
#[cfg(target_os = "linux")]
mod held;
#[cfg(target_os = "linux")]
pub(crate) mod holders;
#[cfg(target_os = "linux")]
pub(crate) mod ioctl;
#[cfg(target_os = "linux")]
mod settings;
#[cfg(target_os = "linux")]
mod tty;

#[cfg(not(target_os = "linux"))]
mod elsewhere;
#[cfg(not(target_os = "linux"))]
mod source;
#[cfg(not(target_os = "linux"))]
pub(crate) use elsewhere::{holders, tty};

pub use crate::difference::{DifferenceWeight, SettingDifference};
#[cfg(target_os = "linux")]
pub use held::discard_all;
pub use input_sink::Backlog;
pub use marks::{Input, LineCounters, MarkDecoder};
pub use open::Port;
pub(crate) use open::{CallsBack, ShortRead};
pub use read_outcome::ReadOutcome;
pub use rfc2217::Rfc2217Port;
#[cfg(target_os = "linux")]
pub use settings::read_line;
pub use spec::{Flow, PortOptions, PortSpec, line_mismatch, line_text, parse_line};
#[cfg(target_os = "linux")]
pub(crate) use spec::{address_text, host_and_port};
pub use tcp::TcpPort;
pub use tty::TtyPort;
