//! Driving a port of a device server without a station.

use softplug_abi::{LineErrorKind, LineParameters, LinkDownReason, Micros};
use softplug_live::clock::Clock;
use softplug_live::poll::{Interest, Poller};
use softplug_live::port::parse_line;
use softplug_live::{Flow, Input, Port, PortOptions, PortSpec, ReadOutcome};

/// So long that only something lost makes a test wait for it.
pub(crate) const NEVER: Micros = Micros::from_secs(30);

pub(crate) fn options(line: &str) -> PortOptions {
    PortOptions::new(parse_line(line, LineParameters::new(9_600)).unwrap())
}

pub(crate) fn device_options(line: &str) -> PortOptions {
    PortOptions { flow: Flow::Device, ..options(line) }
}

pub(crate) fn rfc2217(address: std::net::SocketAddr) -> PortSpec {
    format!("rfc2217://{address}").parse().unwrap()
}

/// What a port has heard.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Heard {
    pub(crate) bytes: Vec<u8>,
    /// Kind, span, and how many bytes had come before.
    pub(crate) errors: Vec<(LineErrorKind, u32, usize)>,
}

impl Heard {
    fn add(&mut self, input: &Input<'_>) {
        match input {
            Input::Bytes(bytes) => self.bytes.extend_from_slice(bytes),
            Input::LineError { kind, byte, span } => {
                assert_eq!(*byte, None, "RFC 2217 does not say which character it was");
                self.errors.push((*kind, *span, self.bytes.len()));
            }
        }
    }
}

/// Serves the port until `is_enough`.
pub(crate) fn serve(
    port: &mut Port,
    heard: &mut Heard,
    mut is_enough: impl FnMut(&Port, &Heard) -> bool,
) {
    if let Err(reason) = serve_or_lose(port, heard, &mut is_enough) {
        panic!("{reason} after {} bytes", heard.bytes.len());
    }
}

/// Serves a port that may get lost until `is_enough`.
pub(crate) fn serve_or_lose(
    port: &mut Port,
    heard: &mut Heard,
    mut is_enough: impl FnMut(&Port, &Heard) -> bool,
) -> Result<(), LinkDownReason> {
    let clock = Clock::start();
    let mut poller = Poller::new(clock).unwrap();
    loop {
        while let ReadOutcome::Read(_) = match port.read(usize::MAX, &mut |input| heard.add(&input))
        {
            Ok(ReadOutcome::Gone(reason)) => return Err(reason),
            outcome => outcome.unwrap(),
        } {}
        if is_enough(port, heard) {
            return Ok(());
        }
        let interest = Interest { read: true, write: port.has_output() };
        let ready = poller.wait(Some(&port.fd()), interest, Some(NEVER)).unwrap();
        assert!(!ready.timer, "nothing follows {heard:?}");
        if ready.writable {
            port.handle_timeout(Micros(0)).unwrap();
        }
    }
}

/// Writes all of `bytes`, waiting for room where there is none.
pub(crate) fn write_all(port: &mut Port, heard: &mut Heard, mut bytes: &[u8]) {
    let mut poller = Poller::new(Clock::start()).unwrap();
    while !bytes.is_empty() {
        let count = port.write(bytes).unwrap();
        bytes = &bytes[count..];
        if count == 0 {
            let interest = Interest { read: true, write: !port.is_suspended() };
            let ready = poller.wait(Some(&port.fd()), interest, Some(NEVER)).unwrap();
            assert!(!ready.timer, "{} bytes find no room", bytes.len());
        }
        port.read(usize::MAX, &mut |input| heard.add(&input)).unwrap();
    }
}
