//! What is wrong with a trace, and where.

use std::fmt::Write as _;

use crate::hidden::forbidden;
use crate::limits;

/// A fault in a trace.
///
/// ```
/// use softplug_trace::Trace;
///
/// let error = Trace::parse("id: x\ntitel: one\n").unwrap_err();
/// assert_eq!((error.line, error.column), (2, 1));
/// // For people, with the line and a caret.
/// assert!(error.report("x.spt").contains("--> x.spt:2:1"));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("line {line}, column {column}: {kind}")]
pub struct ParseError {
    /// From 1.
    pub line: u32,
    /// In characters, from 1; one past the end where something is missing.
    pub column: u32,
    /// What is wrong.
    pub kind: ParseErrorKind,
    /// The line as it stands in the file.
    pub source_line: String,
}

/// What is wrong.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParseErrorKind {
    /// Something else belongs here.
    #[error("expected {0}")]
    Expected(&'static str),
    /// A word of a fixed set belongs here.
    #[error("unknown {what} \"{}\"{}", shown(word), meant(suggestion.as_deref(), known))]
    UnknownWord {
        /// What it should name.
        what: &'static str,
        /// The word.
        word: String,
        /// What may have been meant.
        suggestion: Option<String>,
        /// All that are known.
        known: String,
    },
    /// A number, or the bytes it counts, is outside what is allowed.
    #[error("{what} must be {low} to {high}")]
    OutOfRange {
        /// What the number is.
        what: &'static str,
        /// The least.
        low: u64,
        /// The most.
        high: u64,
    },
    /// Something stands here twice.
    #[error("{what} \"{}\" stands here twice; keep one", shown(name))]
    Twice {
        /// What it is.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// The front matter lacks a key.
    #[error("the front matter ends without \"{0}:\"; add it above this line")]
    MissingKey(&'static str),
    /// An id does not begin with the profile.
    #[error("the id must begin with \"{}.\", as the profile says", shown(profile))]
    ForeignId {
        /// The profile.
        profile: String,
    },
    /// A line is earlier than one above it.
    #[error("{time} is earlier than {before} above it; sort the lines by their start")]
    NotSorted {
        /// The time here.
        time: crate::Time,
        /// The time above.
        before: crate::Time,
    },
    /// A window ends before it begins.
    #[error("the window ends before it begins; write the earlier time first")]
    WindowBackwards,
    /// A damaged character outside received bytes.
    #[error("a damaged character has a meaning only in received bytes (`<`, `<<`)")]
    BadCharacterHere,
    /// Nothing where at least one byte is needed.
    #[error("expected at least one byte")]
    NoBytes,
    /// Alternatives hold expectations only.
    #[error(
        "only expectations (`>`, `=`), `.` and comments stand in alternatives; move this line out of the block"
    )]
    InputInAlternatives,
    /// A block inside a block.
    #[error("a block of alternatives cannot stand in another; close the first with `}}`")]
    NestedAlternatives,
    /// `|` or `}` outside a block.
    #[error("`{0}` has no block to belong to; a block begins with `{{ alt CLAUSE`")]
    OutsideAlternatives(char),
    /// A block that leaves no choice.
    #[error("a block needs at least two alternatives, with a line `|` between them")]
    OneAlternative,
    /// The file ends inside a block.
    #[error("the block of alternatives is not closed; add a line `}}`")]
    OpenAlternatives,
    /// Too many combinations.
    #[error(
        "the alternatives combine to more than {} courses of events; split the case",
        limits::VARIANTS
    )]
    TooManyVariants,
    /// A character that a reviewer would not see.
    #[error("the character U+{:04X} may not stand in a trace; in quoted text write it as \\xNN", u32::from(*.0))]
    ForbiddenCharacter(char),
    /// A reason that the ABI does not know.
    #[error("\"{0}\" is no failure of the ABI")]
    NoFailure(String),
    /// Text that is not UTF-8 after its escapes were resolved.
    #[error("this text is not UTF-8")]
    NotUtf8,
    /// The file is too long.
    #[error("the file has more than {} bytes", limits::FILE_BYTES)]
    FileTooLong,
    /// The line is too long.
    #[error(
        "the line has more than {} bytes; use `gen:` or `file:` for long data",
        limits::LINE_BYTES
    )]
    LineTooLong,
    /// The file has too many lines.
    #[error("the file has more than {} lines; split the case", limits::LINES)]
    TooManyLines,
    /// The generators make too much.
    #[error(
        "the generators of this trace make more than {} bytes together",
        limits::GENERATED_BYTES
    )]
    TooMuchGenerated,
}

/// Characters of a word that are repeated in a message.
const SHOWN: usize = 40;
/// Characters of a source line that a report shows.
const WIDTH: usize = 100;

fn shown(word: &str) -> String {
    match word.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &word[..end]),
        None => word.to_owned(),
    }
}

fn meant(suggestion: Option<&str>, known: &str) -> String {
    match suggestion {
        Some(word) => format!("; did you mean \"{word}\"?"),
        None => format!("; known are: {known}"),
    }
}

impl ParseError {
    /// Several lines for people: the fault, the place, the line with a caret
    /// below. `path` is shown as it is given. Ends without a line end.
    pub fn report(&self, path: &str) -> String {
        let column = self.column.max(1) as usize - 1;
        // A window on long lines, so that the caret stays in sight.
        let first = if column < WIDTH { 0 } else { column - WIDTH / 2 };
        let visible = |c: char| match c {
            '\t' => ' ',
            c if forbidden(c) => '\u{FFFD}',
            c => c,
        };
        let mut line: String =
            self.source_line.chars().skip(first).take(WIDTH).map(visible).collect();
        if self.source_line.chars().nth(first + WIDTH).is_some() {
            line.push('…');
        }
        let lead = if first > 0 { "…" } else { "" };
        let number = self.line.to_string();
        let margin = " ".repeat(number.len());
        let caret = " ".repeat(column - first + lead.chars().count());
        let mut report = format!("error: {}\n", self.kind);
        let _ = writeln!(report, "{margin}--> {path}:{}:{}", self.line, self.column);
        let _ = writeln!(report, "{margin} |");
        let _ = writeln!(report, "{number} | {lead}{line}");
        let _ = write!(report, "{margin} | {caret}^");
        report
    }
}
