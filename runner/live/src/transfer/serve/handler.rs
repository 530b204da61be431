//! What a serving station asks of whoever runs it, and what it tells.

use softplug_abi::{Failure, RequestId};
use std::fmt;
use std::io;
use std::time::Duration;

use crate::transfer::source::{ReadSeek, Source};
use crate::transfer::{Note, SendOutcome};

/// The host's side of a station that serves: where deliveries go, and what
/// machines may have.
pub trait ServeHandler {
    /// A delivery begins.
    fn begin(&mut self) -> io::Result<()>;
    /// Its next bytes.
    fn deliver(&mut self, bytes: &[u8]) -> io::Result<()>;
    /// It has ended.
    fn end(&mut self, delivered: &Delivered) -> io::Result<()>;
    /// The machine asks for something.
    fn asked(&mut self, request: &Request) -> Reply;
    /// Something to tell people.
    fn tell(&mut self, news: &News<'_>);
}

/// A delivery that has ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Delivered {
    /// The name that the protocol found. From the line: nothing in it can be trusted.
    pub name: Option<String>,
    /// Why it is not complete, with the protocol's own code.
    pub failure: Option<(Failure, u16)>,
    /// From its beginning to its end.
    pub elapsed: Duration,
}

/// A request of the plug-in.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Request {
    /// The plug-in's number for it.
    pub id: RequestId,
    /// Place of its kind in the manifest.
    pub kind: u16,
    /// Its fields as value records.
    pub fields: Vec<u8>,
}

/// The answer to a request.
#[derive(Debug)]
pub enum Reply {
    /// It cannot be had.
    Refused(Failure),
    /// This is it.
    Data(Vec<u8>),
    /// It is granted, and this program is sent as a job of its own.
    Program(Program),
}

/// What happens at a station.
#[derive(Clone, Debug)]
pub enum News<'a> {
    /// A request was answered.
    Answered {
        /// The request.
        request: &'a Request,
        /// Why it was refused.
        refused: Option<Failure>,
    },
    /// A program that was asked for begins.
    JobBegins {
        /// Its name, for people.
        name: &'a str,
        /// Its length.
        size: Option<u64>,
    },
    /// It has ended.
    JobEnds(JobReport<'a>),
    /// The plug-in said something.
    Note(&'a Note),
}

/// A program to send.
pub struct Program {
    /// What it is called, for people.
    pub name: String,
    /// Bytes of it, if known.
    pub size: Option<u64>,
    /// Place of the kind of job in the manifest.
    pub job_kind: u16,
    /// Feed the data once as a check first; the manifest says whether the
    /// plug-in needs that.
    pub check: bool,
    pub(super) source: Source<Box<dyn ReadSeek>>,
}

impl Program {
    /// All of `source`, to be sent as a job of this kind, without a check.
    pub fn new(name: impl Into<String>, job_kind: u16, source: Box<dyn ReadSeek>) -> Self {
        let source = Source::new(source);
        Self { name: name.into(), size: None, job_kind, check: false, source }
    }
}

impl fmt::Debug for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, size, job_kind, .. } = self;
        f.debug_struct("Program")
            .field("name", name)
            .field("size", size)
            .field("job_kind", job_kind)
            .finish_non_exhaustive()
    }
}

/// What came of a program that was asked for.
#[derive(Clone, Debug)]
pub struct JobReport<'a> {
    /// Its name, for people.
    pub name: &'a str,
    /// How it ended.
    pub outcome: SendOutcome,
    /// Why the program could not be read to its end.
    pub unreadable: Option<&'a io::Error>,
    /// Another program was asked for in its place.
    pub is_superseded: bool,
    /// Bytes that left for it, as the plug-in counts.
    pub sent: u64,
    /// From its begin to its end.
    pub elapsed: Duration,
}
