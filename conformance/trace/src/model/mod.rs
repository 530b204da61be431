//! What a trace says, apart from how it is written.

mod common;
mod entry;
mod front;
mod payload;
mod time;

pub use common::{Assignment, ModemLevels, ModemLine, Room};
pub(crate) use entry::UNDER_WAY;
pub use entry::{Drain, Entry, Exact, Expected, Given, HostRequest, LineEvent, SourceLine, What};
pub use front::{ByteClass, Edge, FrontMatter, Level, LineSettings, Origin, Permutations};
pub use payload::{BadKind, Digest, Files, Item, NoFile, NoFiles, Payload, PayloadError, Piece};
pub use time::{Time, When};

/// A case: what it is about, and what happens in it.
///
/// ```
/// use softplug_trace::{Time, Trace};
///
/// # let text = "\
/// # id: echo.tx.first
/// # title: The first byte leaves at once
/// # profile: echo
/// # clauses: echo.tx.at-once
/// # level: must
/// # line: 9600 8N1 depth=1 reaction=0
/// # since: 1
/// # origin: hand-written
/// # ---
/// # ? 0.000000 send 1 \"A\"
/// # > 0.000000 41             ; 'A'
/// # = 0.001042 done 1 sent=1
/// # ";
/// // A job of one byte, the byte on the line, and the job's end a character later.
/// let trace = Trace::parse(text)?;
/// assert_eq!(trace.inputs().count(), 1);
/// assert_eq!(trace.end(), Time(1_042));
/// # Ok::<(), softplug_trace::ParseError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Trace {
    /// The case's properties.
    pub front: FrontMatter,
    /// The lines below the front matter.
    pub body: Vec<Line>,
}

/// A line of the body, or a block of alternatives.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Line {
    /// An empty line; runs of them count as one.
    Blank,
    /// What stands after `#`, to the end of the line.
    Comment(String),
    /// An event.
    Entry(Entry),
    /// `{ alt CLAUSE … | … }`.
    Alternatives(Alternatives),
}

/// Courses of events of which a clause leaves the choice to the plug-in.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Alternatives {
    /// The clause that leaves the choice.
    pub clause: String,
    /// At least two; each holds expectations, comments and blank lines only. A
    /// branch may be empty.
    pub branches: Vec<Vec<Line>>,
}

impl Trace {
    /// Every entry outside alternatives, in order.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.body.iter().filter_map(Line::entry)
    }

    /// What the plug-in is given, in order. Alternatives hold none of it.
    pub fn inputs(&self) -> impl Iterator<Item = &Entry> {
        self.entries().filter(|entry| entry.what.is_input())
    }

    /// Whether it is a flight recording: the plug-in is given exact events.
    pub fn is_recording(&self) -> bool {
        self.inputs().any(|entry| matches!(entry.what, What::Given(Given::Exact(_))))
    }

    /// The blocks of alternatives, in order.
    pub fn alternatives(&self) -> impl Iterator<Item = &Alternatives> {
        self.body.iter().filter_map(|line| match line {
            Line::Alternatives(block) => Some(block),
            _ => None,
        })
    }

    /// Every timeline that the trace allows: one for each combination
    /// of alternatives, each with all entries sorted by start. A trace without
    /// alternatives has one. At most [`VARIANTS`](crate::limits::VARIANTS) in a
    /// trace that was parsed.
    ///
    /// ```
    /// use softplug_trace::Trace;
    ///
    /// # let text = "\
    /// # id: echo.tx.first
    /// # title: The first byte leaves at once
    /// # profile: echo
    /// # clauses: echo.tx.at-once
    /// # level: must
    /// # line: 9600 8N1 depth=1 reaction=0
    /// # since: 1
    /// # origin: hand-written
    /// # ---
    /// # ? 0.000000 send 1 \"A\"
    /// # { alt echo.tx.at-once
    /// # > 0.000000 41
    /// # |
    /// # > 0.000010 41
    /// # }
    /// # ";
    /// // The clause leaves the plug-in two courses.
    /// let trace = Trace::parse(text)?;
    /// assert_eq!(trace.variants().len(), 2);
    /// # Ok::<(), softplug_trace::ParseError>(())
    /// ```
    pub fn variants(&self) -> Vec<Vec<&Entry>> {
        let mut variants: Vec<Vec<&Entry>> = vec![Vec::new()];
        for line in &self.body {
            match line {
                Line::Entry(entry) => variants.iter_mut().for_each(|variant| variant.push(entry)),
                Line::Alternatives(block) => {
                    variants = variants
                        .iter()
                        .flat_map(|variant| {
                            block.branches.iter().map(move |branch| {
                                let mut longer = variant.clone();
                                longer.extend(branch.iter().filter_map(Line::entry));
                                longer
                            })
                        })
                        .collect();
                }
                Line::Blank | Line::Comment(_) => {}
            }
        }
        for variant in &mut variants {
            variant.sort_by_key(|entry| entry.when.from);
        }
        variants
    }

    /// The trace with another byte of its [class](FrontMatter::bytes) in place of the one
    /// that is written, in everything that is given and demanded. One without a class
    /// stays as it is.
    ///
    /// ```
    /// use softplug_trace::{Payload, Trace};
    ///
    /// # let text = "\
    /// # id: echo.tx.any
    /// # title: Any byte comes back
    /// # profile: echo
    /// # clauses: echo.tx.at-once
    /// # level: must
    /// # line: 9600 8N1 depth=1 reaction=0
    /// # since: 1
    /// # origin: hand-written
    /// # bytes: 55 = 00-FF
    /// # ---
    /// # < 0.000000 55
    /// # > 0.000000 55
    /// # ";
    /// let other = Trace::parse(text)?.with_byte(0x13);
    /// let sent = other.entries().last().and_then(|entry| entry.what.payload().cloned());
    /// assert_eq!(sent, Some(Payload::hex(&[0x13])));
    /// # Ok::<(), softplug_trace::ParseError>(())
    /// ```
    pub fn with_byte(&self, byte: u8) -> Self {
        let Some(class) = &self.front.bytes else { return self.clone() };
        let (written, mut other) = (class.written, self.clone());
        for line in &mut other.body {
            match line {
                Line::Entry(entry) => entry.replace_byte(written, byte),
                Line::Alternatives(block) => {
                    let lines = block.branches.iter_mut().flatten();
                    for line in lines {
                        if let Line::Entry(entry) = line {
                            entry.replace_byte(written, byte);
                        }
                    }
                }
                Line::Blank | Line::Comment(_) => {}
            }
        }
        other
    }

    /// The latest time that any line names: a run lasts until there, that
    /// instant included.
    pub fn end(&self) -> Time {
        let inside = self
            .alternatives()
            .flat_map(|block| block.branches.iter().flatten())
            .filter_map(Line::entry);
        self.entries().chain(inside).map(|entry| entry.when.to).max().unwrap_or_default()
    }
}

impl Line {
    /// The entry, if the line is one.
    pub fn entry(&self) -> Option<&Entry> {
        match self {
            Self::Entry(entry) => Some(entry),
            _ => None,
        }
    }

    /// When the line begins: for a block the earliest start in it.
    pub(crate) fn start(&self) -> Option<Time> {
        match self {
            Self::Entry(entry) => Some(entry.when.from),
            Self::Alternatives(block) => {
                block.branches.iter().flatten().filter_map(Self::start).min()
            }
            Self::Blank | Self::Comment(_) => None,
        }
    }
}

/// Makes runs of blank lines one, and drops those at the start and the end.
pub(crate) fn tidy_blank_lines(lines: &mut Vec<Line>) {
    lines.dedup_by(|next, before| *next == Line::Blank && *before == Line::Blank);
    if lines.first() == Some(&Line::Blank) {
        lines.remove(0);
    }
    if lines.last() == Some(&Line::Blank) {
        lines.pop();
    }
}
