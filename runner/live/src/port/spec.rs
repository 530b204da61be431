//! Ports and line settings as people write them.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use softplug_abi::{LineParameters, Parity};

use crate::error::{BadSpec, PortError};

/// Which port to open.
///
/// ```
/// use softplug_live::PortSpec;
///
/// let server: PortSpec = "tcp://10.0.0.7:4001".parse().unwrap();
/// assert_eq!(server, PortSpec::Tcp { host: "10.0.0.7".into(), port: 4001 });
/// assert!("COM".parse::<PortSpec>().is_err());
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum PortSpec {
    /// A terminal device: a serial port, or the slave of a pty.
    Device(PathBuf),
    /// A raw TCP connection to a device server.
    Tcp {
        /// Name or address.
        host: String,
        /// TCP port.
        port: u16,
    },
    /// A device server that sets its port as asked (RFC 2217).
    Rfc2217 {
        /// Name or address.
        host: String,
        /// TCP port.
        port: u16,
    },
    /// A new pty; the other side opens its slave.
    Pty,
}

impl PortSpec {
    /// Whether whoever opens it must say at which rate.
    pub fn needs_rate(&self) -> bool {
        match self {
            Self::Device(_) => true,
            Self::Tcp { .. } | Self::Rfc2217 { .. } | Self::Pty => false,
        }
    }

    /// Whether the line is set as whoever opens it asks.
    pub fn sets_line(&self) -> bool {
        match self {
            Self::Device(_) | Self::Rfc2217 { .. } => true,
            Self::Tcp { .. } | Self::Pty => false,
        }
    }

    /// Whether opening it waits for a machine elsewhere.
    pub(crate) fn waits_for_others(&self) -> bool {
        match self {
            Self::Tcp { .. } | Self::Rfc2217 { .. } => true,
            Self::Device(_) | Self::Pty => false,
        }
    }

    /// Whether only one can have it at a time.
    pub fn is_exclusive(&self) -> bool {
        match self {
            Self::Device(_) | Self::Tcp { .. } | Self::Rfc2217 { .. } => true,
            Self::Pty => false,
        }
    }
}

impl FromStr for PortSpec {
    type Err = BadSpec;

    fn from_str(text: &str) -> Result<Self, BadSpec> {
        if text == "pty:" || text == "pty" {
            return Ok(Self::Pty);
        }
        for (scheme, spec) in SCHEMES {
            if let Some(address) = text.strip_prefix(scheme) {
                let address = address.strip_prefix("//").unwrap_or(address);
                let (host, port) =
                    host_and_port(address).ok_or_else(|| BadSpec::Address(text.to_owned()))?;
                return Ok(spec(host, port));
            }
        }
        if is_device(text) {
            return Ok(Self::Device(PathBuf::from(text)));
        }
        Err(BadSpec::Form(text.to_owned()))
    }
}

impl fmt::Display for PortSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(path) => path.display().fmt(f),
            Self::Tcp { host, port } => write!(f, "tcp://{}", address_text(host, *port)),
            Self::Rfc2217 { host, port } => write!(f, "rfc2217://{}", address_text(host, *port)),
            Self::Pty => f.write_str("pty:"),
        }
    }
}

/// Whether this is how the system names a device.
fn is_device(text: &str) -> bool {
    if cfg!(windows) {
        let name = text.strip_prefix(r"\\.\").unwrap_or(text).to_ascii_uppercase();
        let number = name.strip_prefix("COM").unwrap_or_default();
        return (1..=3).contains(&number.len()) && number.bytes().all(|byte| byte.is_ascii_digit());
    }
    text.contains('/') && !text.contains("://") && !text.contains('\0')
}

type MakeSpec = fn(String, u16) -> PortSpec;

const SCHEMES: [(&str, MakeSpec); 2] = [
    ("tcp:", |host, port| PortSpec::Tcp { host, port }),
    ("rfc2217:", |host, port| PortSpec::Rfc2217 { host, port }),
];

/// Host and port as they are written in an address.
pub(crate) fn address_text(host: &str, port: u16) -> String {
    if host.contains(':') { format!("[{host}]:{port}") } else { format!("{host}:{port}") }
}

/// Host and port of an address such as `10.0.0.7:4001` or `[::1]:4001`.
pub(crate) fn host_and_port(address: &str) -> Option<(String, u16)> {
    let (host, port) = address.trim_end_matches('/').rsplit_once(':')?;
    let host = match host.strip_prefix('[') {
        Some(inner) => inner.strip_suffix(']')?,
        // An IPv6 address without brackets has no place where the port begins.
        None if host.contains(':') => return None,
        None => host,
    };
    let port = port.parse().ok().filter(|port| *port != 0)?;
    let good = !host.is_empty() && !host.contains(|c: char| c.is_whitespace() || c == '/');
    good.then(|| (host.to_owned(), port))
}

/// What a port does by itself: who reacts to XON/XOFF, and what the modem lines are for.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum Flow {
    /// The plug-in sees and sends the control codes; the gateway paces.
    #[default]
    Host,
    /// Kernel or adapter reacts; the codes never reach the plug-in.
    Device,
    /// The port stops while CTS is off, and takes RTS away while it has no room.
    RtsCts,
    /// The port stops while DSR is off, and takes DTR away while it has no room. Only device
    /// servers can do so.
    DsrDtr,
    /// Of a half-duplex line (RS-485): RTS is on while the port sends, which turns the line around.
    Rs485,
}

impl Flow {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Host, Self::Device, Self::RtsCts, Self::DsrDtr, Self::Rs485];

    /// Its name, as in `gateway.toml`.
    ///
    /// ```
    /// use softplug_live::Flow;
    ///
    /// assert_eq!(Flow::ALL.map(Flow::name), ["host", "device", "rts-cts", "dsr-dtr", "rs-485"]);
    /// ```
    pub const fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Device => "device",
            Self::RtsCts => "rts-cts",
            Self::DsrDtr => "dsr-dtr",
            Self::Rs485 => "rs-485",
        }
    }

    /// Whether the machine can stop the port, so that the port holds what it was given.
    pub const fn is_stoppable(self) -> bool {
        match self {
            Self::Device | Self::RtsCts | Self::DsrDtr => true,
            Self::Host | Self::Rs485 => false,
        }
    }

    /// Whether a port of this kind can do so, as far as that is known before it is opened.
    ///
    /// # Errors
    /// It cannot: says what to do.
    pub fn check(self, port: &PortSpec) -> Result<(), PortError> {
        let no = |what, instead| Err(PortError::NoFlow { what, instead });
        match (self, port) {
            (Self::Host | Self::Device, _)
            | (Self::RtsCts | Self::Rs485, PortSpec::Device(_))
            | (Self::RtsCts | Self::DsrDtr, PortSpec::Rfc2217 { .. }) => Ok(()),
            (Self::DsrDtr, PortSpec::Device(_)) => no(
                "DSR/DTR flow control, which the kernel does not know",
                "lead the machine's DTR to our CTS and take rts-cts, or use a device server (rfc2217://)",
            ),
            (Self::Rs485, PortSpec::Rfc2217 { .. }) => no(
                "way to turn a line around, which RFC 2217 does not know",
                "set the device server to RS-485 itself, and take host",
            ),
            (_, PortSpec::Tcp { .. }) => no(
                "modem lines, as a raw TCP connection",
                "set the device server itself and take host, or use rfc2217://",
            ),
            (_, PortSpec::Pty) => no("modem lines, as a pty", "take host"),
        }
    }
}

/// How to open a port.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PortOptions {
    /// The characters on the line. A baud rate of 0 leaves it to a device
    /// server or a pty; a terminal needs one.
    pub line: LineParameters,
    /// Who reacts to XON/XOFF.
    pub flow: Flow,
    /// Keep other programs away from a terminal.
    pub exclusive: bool,
    /// How long connecting to a device server may take.
    pub connect_timeout: Duration,
}

impl PortOptions {
    /// Exclusive, control codes left to the plug-in, 5 s to connect.
    pub fn new(line: LineParameters) -> Self {
        let connect_timeout = Duration::from_secs(5);
        Self { line, flow: Flow::Host, exclusive: true, connect_timeout }
    }
}

impl Default for PortOptions {
    fn default() -> Self {
        Self::new(LineParameters::new(9_600))
    }
}

/// Reads line settings such as `9600 8N1`, `7E2` or `19200`; what the text
/// does not give stays as in `base`. Stop bits are 1, 1.5 or 2.
///
/// ```
/// use softplug_abi::LineParameters;
/// use softplug_live::port::{line_text, parse_line};
///
/// let line = parse_line("4800 7E2", LineParameters::new(9_600)).unwrap();
/// assert_eq!(line.half_bits(), 22);
/// assert_eq!(line_text(&line), "4800 7E2");
/// ```
pub fn parse_line(text: &str, base: LineParameters) -> Result<LineParameters, BadSpec> {
    let mut line = base;
    let (mut rate, mut form) = (false, false);
    let words = text.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let mut any = false;
    for word in words {
        any = true;
        let seen = if word.bytes().all(|byte| byte.is_ascii_digit()) {
            line.baud = parse_baud(word)?;
            &mut rate
        } else {
            let format = parse_format(word).ok_or_else(|| BadSpec::Format(word.to_owned()))?;
            line = LineParameters { baud: line.baud, ..format };
            &mut form
        };
        if *seen {
            return Err(BadSpec::Twice(word.to_owned()));
        }
        *seen = true;
    }
    if any { Ok(line) } else { Err(BadSpec::Format(text.to_owned())) }
}

/// Line settings as [`parse_line`] reads them; without the rate where it is
/// unknown.
pub fn line_text(line: &LineParameters) -> String {
    let parity = match line.parity {
        Parity::None => 'N',
        Parity::Odd => 'O',
        Parity::Even => 'E',
        Parity::Mark => 'M',
        Parity::Space => 'S',
    };
    let stop = match line.stop_half_bits {
        3 => "1.5",
        4 => "2",
        _ => "1",
    };
    match line.baud {
        0 => format!("{}{parity}{stop}", line.data_bits),
        baud => format!("{baud} {}{parity}{stop}", line.data_bits),
    }
}

/// What a line does not do whose characters are not those that the protocol names; `None` where
/// they are the same. Another rate is the machine's own affair.
///
/// ```
/// use softplug_abi::LineParameters;
/// use softplug_live::port::{line_mismatch, parse_line};
///
/// let named = parse_line("4800 7E2", LineParameters::new(9_600)).unwrap();
/// let line = LineParameters::new(9_600);
/// assert_eq!(line_mismatch(line, named), Some("a wrong parity bit is not looked at"));
/// assert_eq!(line_mismatch(LineParameters { baud: 300, ..named }, named), None);
/// ```
pub fn line_mismatch(line: LineParameters, named: LineParameters) -> Option<&'static str> {
    if line.parity != named.parity {
        return Some(match (line.parity, named.parity) {
            (Parity::None, _) => "a wrong parity bit is not looked at",
            (_, Parity::None) => "a parity bit is expected that the protocol does not have",
            _ => "a parity bit is expected that the protocol has otherwise",
        });
    }
    if line.data_bits != named.data_bits {
        return Some("characters have another number of bits");
    }
    (line.stop_half_bits != named.stop_half_bits).then_some("only the stop bits differ")
}

/// 16 Mbaud is the most that any adapter known to Linux makes.
fn parse_baud(word: &str) -> Result<u32, BadSpec> {
    let baud = word.parse().ok().filter(|baud| (50..=16_000_000).contains(baud));
    baud.ok_or_else(|| BadSpec::Baud(word.to_owned()))
}

fn parse_format(word: &str) -> Option<LineParameters> {
    let mut letters = word.chars();
    let data_bits = letters.next()?.to_digit(10).filter(|bits| (5..=8).contains(bits))? as u8;
    let parity = match letters.next()?.to_ascii_uppercase() {
        'N' => Parity::None,
        'O' => Parity::Odd,
        'E' => Parity::Even,
        'M' => Parity::Mark,
        'S' => Parity::Space,
        _ => return None,
    };
    let stop_half_bits = match letters.as_str() {
        "1" => 2,
        "1.5" => 3,
        "2" => 4,
        _ => return None,
    };
    Some(LineParameters { baud: 0, data_bits, parity, stop_half_bits })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn ports_are_told_apart() {
        let cases = [
            ("/dev/ttyUSB0", PortSpec::Device("/dev/ttyUSB0".into())),
            ("./line", PortSpec::Device("./line".into())),
            ("pty:", PortSpec::Pty),
            ("tcp:moxa:4001", PortSpec::Tcp { host: "moxa".into(), port: 4001 }),
            ("tcp://moxa:4001/", PortSpec::Tcp { host: "moxa".into(), port: 4001 }),
            ("rfc2217:moxa:4001", PortSpec::Rfc2217 { host: "moxa".into(), port: 4001 }),
            ("rfc2217://[fe80::1]:1", PortSpec::Rfc2217 { host: "fe80::1".into(), port: 1 }),
            ("tcp://[::1]:7", PortSpec::Tcp { host: "::1".into(), port: 7 }),
        ];
        for (text, spec) in cases {
            assert_eq!(text.parse(), Ok(spec.clone()), "{text}");
            assert_eq!(spec.to_string().parse(), Ok(spec), "{text}");
        }
        for text in [
            "tcp:moxa",
            "tcp://:1",
            "tcp://a:0",
            "tcp://::1:7",
            "tcp://a:99999",
            "tcp:a b:1",
            "rfc2217:a",
        ] {
            assert_eq!(text.parse::<PortSpec>(), Err(BadSpec::Address(text.into())), "{text}");
        }
        for text in ["", "COM3", "ttyUSB0", "http://host:1", "/dev/\0"] {
            assert_eq!(text.parse::<PortSpec>(), Err(BadSpec::Form(text.into())), "{text}");
        }
    }

    #[test]
    fn bad_line_settings_name_the_bad_word() {
        let base = LineParameters::new(9_600);
        let parse = |text| parse_line(text, base);
        assert_eq!(parse("9600 9N1"), Err(BadSpec::Format("9N1".into())));
        assert_eq!(parse("8X1"), Err(BadSpec::Format("8X1".into())));
        assert_eq!(parse("8N3"), Err(BadSpec::Format("8N3".into())));
        assert_eq!(parse("0 8N1"), Err(BadSpec::Baud("0".into())));
        assert_eq!(parse("99999999999"), Err(BadSpec::Baud("99999999999".into())));
        assert_eq!(parse("9600 19200"), Err(BadSpec::Twice("19200".into())));
        assert_eq!(parse(" "), Err(BadSpec::Format(" ".into())));
        assert_eq!(parse("19200"), Ok(LineParameters { baud: 19_200, ..base }));
        assert_eq!(parse("5n1.5").map(|line| line.stop_half_bits), Ok(3));
    }

    proptest! {
        #[test]
        fn settings_survive_being_written_out(
            baud in 50_u32..16_000_000, data_bits in 5_u8..=8, parity in 0_usize..5,
            stop_half_bits in 2_u8..=4,
        ) {
            let parities =
                [Parity::None, Parity::Odd, Parity::Even, Parity::Mark, Parity::Space];
            let line = LineParameters { baud, data_bits, parity: parities[parity], stop_half_bits };
            prop_assert_eq!(parse_line(&line_text(&line), LineParameters::new(50)), Ok(line));
        }

        #[test]
        fn no_text_panics(text in ".{0,20}") {
            let _ = text.parse::<PortSpec>();
            let _ = parse_line(&text, LineParameters::new(50));
        }
    }
}
