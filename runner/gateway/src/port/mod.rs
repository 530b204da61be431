//! Ports: a terminal, a TCP connection or a pty behind one interface that
//! never blocks.

mod difference;
pub(crate) mod input_sink;
mod marks;
mod spec;

#[cfg(target_os = "linux")]
mod held;
#[cfg(target_os = "linux")]
pub(crate) mod holders;
#[cfg(target_os = "linux")]
pub(crate) mod ioctl;
#[cfg(target_os = "linux")]
mod open;
#[cfg(target_os = "linux")]
mod rfc2217;
#[cfg(target_os = "linux")]
pub(crate) mod rfc2217_bound;
#[cfg(target_os = "linux")]
pub(crate) mod rfc2217_values;
#[cfg(target_os = "linux")]
pub(crate) mod scratch;
#[cfg(target_os = "linux")]
mod settings;
#[cfg(target_os = "linux")]
pub(crate) mod stream;
#[cfg(target_os = "linux")]
mod tcp;
#[cfg(target_os = "linux")]
mod tty;

#[cfg(target_os = "linux")]
pub use self::rfc2217::Rfc2217Port;
pub use difference::{DifferenceWeight, SettingDifference};
#[cfg(target_os = "linux")]
pub use held::discard_all;
pub use input_sink::Backlog;
pub use marks::{Input, LineCounters, MarkDecoder};
#[cfg(target_os = "linux")]
pub(crate) use open::{CallsBack, ShortRead};
pub use open::{Port, ReadOutcome};
#[cfg(target_os = "linux")]
pub use settings::read_line;
pub use spec::{Flow, PortOptions, PortSpec, line_mismatch, line_text, parse_line};
#[cfg(target_os = "linux")]
pub(crate) use spec::{address_text, host_and_port};
#[cfg(target_os = "linux")]
pub use tcp::TcpPort;
#[cfg(target_os = "linux")]
pub use tty::TtyPort;
