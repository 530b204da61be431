//! Why a trace cannot be exported, or a file not imported, and where.

use std::fmt;

use crate::limits;
use crate::model::{PayloadError, SourceLine};

/// Why a trace cannot be exported.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ExportError {
    /// The bytes of a line cannot be had.
    #[error("line {}: {source}", line.0)]
    Payload {
        /// The line of the trace.
        line: SourceLine,
        /// Why.
        source: PayloadError,
    },
    /// All bytes together are too many.
    #[error(
        "the trace has more than {} bytes on the line; export a shorter one",
        limits::EXPORT_BYTES
    )]
    TooMuch,
}

/// Why a file cannot be imported.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{file}{place}: {fault}")]
pub struct ImportError {
    /// The file, as it was called.
    pub file: String,
    /// Where in it.
    pub place: Place,
    /// What is wrong.
    pub fault: ImportFault,
}

impl ImportError {
    pub(super) fn whole(file: &str, fault: ImportFault) -> Self {
        Self { file: file.to_owned(), place: Place::Whole, fault }
    }
}

/// Where in a file.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Place {
    /// The file as a whole.
    Whole,
    /// In a text.
    Line {
        /// From 1.
        line: u32,
        /// In characters, from 1.
        column: u32,
    },
    /// In binary data: the byte, from 0.
    Byte(usize),
}

/// What stands behind the file's name.
impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Line { line, column } => write!(f, ":{line}:{column}"),
            Self::Byte(at) => write!(f, ": byte {at}"),
        }
    }
}

/// What is wrong with a file.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportFault {
    /// The format has another number of files.
    #[error("one file is needed, and no more than {most} of this format")]
    Sources {
        /// The most.
        most: usize,
    },
    /// The file is too long.
    #[error("the file has more than {} bytes; cut the recording", limits::IMPORT_BYTES)]
    FileTooLong,
    /// What it holds does not fit a trace.
    #[error(
        "the trace would have more than {} lines or {} bytes; cut the recording",
        limits::LINES,
        limits::FILE_BYTES
    )]
    TraceTooLong,
    /// The first and the last event lie too far apart.
    #[error("the recording takes more than {} seconds; cut it", limits::SECONDS)]
    TooFarApart,
    /// There is nothing in it.
    #[error("nothing in it happens on a serial line")]
    Nothing,
    /// Something else belongs here.
    #[error("expected {0}")]
    Expected(&'static str),
    /// A time is beyond all sense.
    #[error("this time cannot be counted in µs")]
    Time,
    /// A text is not UTF-8.
    #[error("this is not text in UTF-8")]
    NotUtf8,
    /// A table lacks a column.
    #[error("the table has no column \"{0}\"")]
    NoColumn(&'static str),
    /// A row cannot be read.
    #[error("this row of the table cannot be read: {0}")]
    Row(String),
    /// Names of analysers that say nothing of the direction.
    #[error(
        "which of the analysers is which? Say --received NAME and --sent NAME; the file has {found}"
    )]
    Names {
        /// The names in the file.
        found: String,
    },
    /// CAN frames that are not said to be of the line.
    #[error(
        "which frames are those of the line? Say --received ID and --sent ID; the file has {found}"
    )]
    Frames {
        /// The identifiers in the file.
        found: String,
    },
    /// The file is no capture.
    #[error("this is no capture; expected a file that begins like pcapng or pcap")]
    NotCapture,
    /// The file ends too early.
    #[error("the file ends inside {0}; it was cut short")]
    CutShort(&'static str),
    /// A length that cannot be.
    #[error("{what} has an impossible length, {length}")]
    Length {
        /// Of what.
        what: &'static str,
        /// The length.
        length: u64,
    },
    /// A packet of an interface that no block describes.
    #[error("the packet belongs to interface {0}, which nothing describes")]
    NoInterface(u32),
    /// Too many interfaces.
    #[error("the capture describes more than {} interfaces", limits::INTERFACES)]
    TooManyInterfaces,
    /// Two lines in one capture.
    #[error(
        "packets of a second serial line begin here; keep one of them (Wireshark: frame.interface_id)"
    )]
    SecondLine,
    /// A resolution of time that cannot be counted with.
    #[error("the capture's resolution of time, if_tsresol {0}, is beyond what can be counted with")]
    Resolution(u8),
    /// A packet of plain bytes without direction.
    #[error("the packet does not say its direction; it has to be inbound or outbound")]
    NoDirection,
}
