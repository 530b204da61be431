//! What an endpoint is made with.

use std::net::SocketAddr;

use softplug_abi::Micros;

/// What an endpoint speaks.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum EndpointKind {
    /// Bytes and nothing else.
    #[default]
    Raw,
    /// Telnet with the serial port's settings and lines (RFC 2217).
    Rfc2217,
}

/// How what a client sends becomes jobs.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum Framing {
    /// One job, which ends with the connection. If the job fails, the connection
    /// is closed.
    #[default]
    Stream,
    /// A job ends when nothing comes for so long. If it fails, what comes until
    /// such a pause is dropped.
    Gap(Micros),
}

/// What an RFC 2217 client is told that asks for line settings. The port keeps
/// its own in any case.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum LineAnswer {
    /// The port's own settings.
    #[default]
    Own,
    /// What the client asked for, for software that insists.
    AsAsked,
}

/// What an endpoint is made with.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct EndpointSetup {
    /// Where to listen.
    pub listen: SocketAddr,
    /// What to speak.
    pub kind: EndpointKind,
    /// For how long small deliveries are gathered; zero: not at all.
    pub gather: Micros,
    /// How what comes becomes jobs.
    pub framing: Framing,
    /// What is told about line settings.
    pub line: LineAnswer,
}

impl EndpointSetup {
    /// Bytes and nothing else, one job a connection, nothing gathered.
    pub fn new(listen: SocketAddr) -> Self {
        Self {
            listen,
            kind: EndpointKind::default(),
            gather: Micros::ZERO,
            framing: Framing::default(),
            line: LineAnswer::default(),
        }
    }
}
