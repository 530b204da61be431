//! Traces from and for other tools: captures, hex dumps, logs of logic analysers.
//!
//! These formats hold what happens on a line and nothing else. What of a trace
//! one cannot hold, and what of a file a trace cannot hold, is told as
//! [`Note`]s beside the result; nothing is dropped in silence.
//! `docs/trace-format.md` has a table of both.
//!
//! ```
//! use softplug_trace::exchange::{self, Format, Import, Source};
//! use softplug_trace::{FrontMatter, NoFiles};
//!
//! let front = FrontMatter::parse("\
//! id: echo.rx.first
//! title: Recorded at the machine
//! profile: echo
//! clauses: echo.rx.any
//! level: may
//! line: 9600 8N1 depth=1 reaction=0
//! since: 1
//! origin: recorded(lathe, 2026-03-01, candump)
//! ")?;
//! let log = Source { name: "lathe.log", bytes: b"(0.500000) port#11 R\n(0.750000) port#4142 T\n" };
//! let import = exchange::import(&[log], Format::Candump, &Import::new(front))?;
//! assert!(import.trace.format().ends_with("\
//! < 0.500000 11             ; DC1=XON
//! > 0.750000 \"AB\"
//! "));
//!
//! let export = exchange::export(&import.trace, Format::Candump, &NoFiles)?;
//! assert_eq!(export.bytes, log.bytes);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod candump;
mod capture;
mod error;
mod hexdump;
mod note;
pub(crate) mod pace;
mod pcapng;
mod rtac;
mod saleae;
#[cfg(test)]
mod tests;
mod text;
mod timeline;

pub use error::{ExportError, ImportError, ImportFault, Place};
pub use note::{Left, Note};

use crate::model::{Files, FrontMatter, Trace};
use note::Notes;
use timeline::Timeline;

/// A format of another tool.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Format {
    /// A capture for Wireshark with LINKTYPE_RTAC_SERIAL. Classic pcap is read too.
    Pcapng,
    /// A hex dump that `text2pcap -D -t %s.%f` reads.
    Hexdump,
    /// Lines like `(1.500000) port#4142 R`. Lines of CAN frames, `(1.500000) can0 123#4142`, as
    /// `candump -L` writes them, are read too.
    Candump,
    /// The table that Saleae Logic exports of its analyser for serial lines.
    Saleae,
}

impl Format {
    /// Every format.
    pub const ALL: &'static [Self] = &[Self::Pcapng, Self::Hexdump, Self::Candump, Self::Saleae];

    /// The name on a command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pcapng => "pcapng",
            Self::Hexdump => "hexdump",
            Self::Candump => "candump",
            Self::Saleae => "saleae",
        }
    }
}

/// A trace in another format.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// What the format cannot hold.
    pub notes: Vec<Note>,
}

/// Writes what happens on the line in another format. Times count from the start
/// of the case; of a window the start is taken, of alternatives the first.
///
/// # Errors
/// A `file:` or `gen:` item has no bytes, or they are too many.
pub fn export(trace: &Trace, format: Format, files: &impl Files) -> Result<Exported, ExportError> {
    let mut notes = Notes::default();
    let timeline = Timeline::of(trace, files, &mut notes)?;
    let bytes = match format {
        Format::Pcapng => pcapng::write(&timeline, &mut notes),
        Format::Hexdump => hexdump::write(&timeline, &mut notes),
        Format::Candump => candump::write(&timeline, &mut notes),
        Format::Saleae => saleae::write(&timeline, &mut notes),
    };
    Ok(Exported { bytes, notes: notes.finish() })
}

/// A file to import.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Source<'a> {
    /// As it is called in errors.
    pub name: &'a str,
    /// What stands in it.
    pub bytes: &'a [u8],
}

/// How to import.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Import {
    /// What the file does not tell. Its line gives the time of a character; its
    /// modem lines are replaced where the file knows them.
    pub front: FrontMatter,
    /// Times count from the first event, and not as the file has them. They do so
    /// anyway where the file's times do not fit a trace: calendar times and times
    /// before zero.
    pub from_first: bool,
    /// Saleae: the name of the analyser at the line that the plug-in receives
    /// from. Without: "rx". candump: the identifier of the CAN frames that it receives.
    pub received: Option<String>,
    /// Saleae: the name of the analyser at the line that it sends on. Without: "tx". candump: the
    /// identifier of the CAN frames that it sends.
    pub sent: Option<String>,
}

impl Import {
    /// With this front matter and times as they are.
    pub fn new(front: FrontMatter) -> Self {
        Self { front, from_first: false, received: None, sent: None }
    }
}

/// A file as a trace.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Imported {
    /// The trace: `<`, `<<`, `>` and `!` lines.
    pub trace: Trace,
    /// The time in the file, in µs, that is zero in the trace. In captures with
    /// calendar times: since 1970.
    pub zero: i64,
    /// What a trace cannot hold.
    pub notes: Vec<Note>,
}

/// Reads a file of another format. Saleae's first version keeps each direction in a
/// file of its own: first the one that the plug-in receives, then the other.
///
/// # Errors
/// The first fault, with its place; a number of files that the format does not
/// have; nothing in them that a trace could hold; too much of it.
pub fn import(
    sources: &[Source<'_>],
    format: Format,
    import: &Import,
) -> Result<Imported, ImportError> {
    let most = if format == Format::Saleae { 2 } else { 1 };
    let first = match sources {
        [first, ..] if sources.len() <= most => *first,
        _ => {
            let name = sources.get(most).map_or("", |source| source.name);
            return Err(ImportError::whole(name, ImportFault::Sources { most }));
        }
    };
    for source in sources {
        if source.bytes.len() > crate::limits::IMPORT_BYTES {
            return Err(ImportError::whole(source.name, ImportFault::FileTooLong));
        }
    }
    let mut notes = Notes::default();
    let mut timeline = Timeline::new(import.front.line);
    match format {
        Format::Pcapng => pcapng::read(first, &mut timeline, &mut notes)?,
        Format::Hexdump => hexdump::read(first, &mut timeline)?,
        Format::Candump => candump::read(first, import, &mut timeline, &mut notes)?,
        Format::Saleae => saleae::read(sources, import, &mut timeline, &mut notes)?,
    }
    let (trace, zero) =
        assemble::trace(timeline, import).map_err(|fault| ImportError::whole(first.name, fault))?;
    Ok(Imported { trace, zero, notes: notes.finish() })
}
