//! Words of coordination in NC programs.
//!
//! Each notation says how a block is read. The comment form is known in all of them. Words take
//! effect behind their block: there the feed stops.

mod bad_word;
mod comment;
mod m_codes;
mod siemens;
mod wai;

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use self::bad_word::BadWord;
use crate::setup::{AxisId, ChannelId, ChannelSet, Setup};
use crate::word::Word;

/// Most words of one program.
pub const MOST_WORDS: usize = 100_000;
/// A block that is longer holds no words.
const LONGEST_BLOCK: usize = 1_024;

/// How coordination is written in the programs of a channel.
///
/// ```
/// use softplug_cell::Notation;
///
/// assert_eq!("siemens".parse(), Ok(Notation::Siemens));
/// assert_eq!("m100-m199".parse(), Ok(Notation::MCodes { first: 100, last: 199 }));
/// assert!("M200-M100".parse::<Notation>().is_err());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum Notation {
    /// `(SOFTPLUG WAIT 10 LATHE-1 LATHE-2)`. The machine gets the block: to it, it is a comment.
    #[default]
    Comment,
    /// `WAI 10 LATHE-1 LATHE-2`, `LAD LATHE-2 O1234`, `EXE LATHE-2`. The machine does not get them.
    Wai,
    /// `WAITM(10,1,2)`, `INIT(2,"O1234")`, `START(2)`, `GET(C2)`, `GETD(C2)`, `RELEASE(C2)`. The
    /// machine does not get them.
    Siemens,
    /// Waiting M codes, as `M101 P12`. The machine does not get them.
    MCodes {
        /// The first that waits.
        first: u32,
        /// The last that waits.
        last: u32,
    },
}

/// A program as the machine gets it, and where its feed stops.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Program<'a> {
    /// What is sent.
    pub sent: Cow<'a, [u8]>,
    /// Where its feed stops, in order. Two words of one block have two stops at one place.
    pub stops: Vec<Stop>,
    /// Blocks that the machine does not get, counted from 1.
    pub left_out: Vec<u32>,
}

/// A place in a program behind which the feed stops.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Stop {
    /// Bytes of what is sent that lie before it.
    pub at: u64,
    /// The block, counted from 1, in the program as it was written.
    pub block: u32,
    /// What it says.
    pub word: Word,
}

/// A block that coordinates, and cannot be understood.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[error("block {block}: {text}")]
pub struct WordError {
    /// Counted from 1.
    pub block: u32,
    /// What is wrong and what to write.
    pub text: String,
}

/// No notation has this name.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error(
    "no notation of words is called so: write \"comment\", \"wai\", \"siemens\" or a range of waiting M codes, such as \"M100-M199\""
)]
pub struct NoNotation;

/// A block as one notation reads it.
enum Block {
    /// None of our business.
    Other,
    /// The machine gets it, and the feed stops behind it.
    Sent(Vec<Word>),
    /// The machine does not get it.
    LeftOut(Vec<Word>),
}

/// What names in a program mean: who says it, in which cell.
#[derive(Copy, Clone)]
struct Names<'a> {
    by: ChannelId,
    setup: &'a Setup,
}

type Read<T> = Result<T, BadWord>;

impl Program<'_> {
    /// Reads a program of a channel.
    ///
    /// # Errors
    /// The first block that coordinates and cannot be understood.
    pub fn read<'a>(
        program: &'a [u8],
        by: ChannelId,
        setup: &Setup,
        notation: Notation,
    ) -> Result<Program<'a>, WordError> {
        let names = Names { by, setup };
        let mut sent: Cow<'a, [u8]> = Cow::Borrowed(&program[..0]);
        let (mut stops, mut left_out): (Vec<Stop>, Vec<u32>) = (Vec::new(), Vec::new());
        let mut at = 0;
        for (block, line) in (1..).zip(lines(program)) {
            let wrong = |error: BadWord| WordError { block, text: error.to_string() };
            let text = String::from_utf8_lossy(line.trim_ascii());
            let read = match line.len() {
                0..=LONGEST_BLOCK => notation.block(&text, names).map_err(wrong)?,
                _ => Block::Other,
            };
            let words = match read {
                Block::Other => Vec::new(),
                Block::Sent(words) => words,
                Block::LeftOut(words) => {
                    sent.to_mut();
                    left_out.push(block);
                    for word in words {
                        stops.push(Stop { at: sent.len() as u64, block, word });
                    }
                    at += line.len();
                    continue;
                }
            };
            match &mut sent {
                // Nothing was left out so far.
                Cow::Borrowed(sent) => *sent = &program[..at + line.len()],
                Cow::Owned(sent) => sent.extend_from_slice(line),
            }
            at += line.len();
            stops.extend(words.into_iter().map(|word| Stop { at: sent.len() as u64, block, word }));
            if stops.len() > MOST_WORDS {
                return Err(wrong(BadWord::TooMany));
            }
        }
        Ok(Program { sent, stops, left_out })
    }
}

impl Notation {
    fn block(self, text: &str, names: Names<'_>) -> Read<Block> {
        let in_comments = comment::words(text, names)?;
        let bare = without_comments(text.trim_start_matches('\u{feff}'));
        let (bare, is_skipped) = match bare.trim_start().strip_prefix('/') {
            Some(rest) => (rest.trim_start_matches(|c: char| c.is_ascii_digit()).to_owned(), true),
            None => (bare, false),
        };
        let said = match self {
            Self::Comment => Vec::new(),
            Self::Wai => wai::words(&bare, names)?,
            Self::Siemens => siemens::words(&bare, names)?,
            Self::MCodes { first, last } => m_codes::words(&bare, first..=last, names)?,
        };
        match (in_comments.is_empty(), said.is_empty()) {
            (true, true) => Ok(Block::Other),
            (false, true) => Ok(Block::Sent(in_comments)),
            (true, false) if is_skipped => Err(BadWord::Skipped),
            (true, false) => Ok(Block::LeftOut(said)),
            (false, false) => Err(BadWord::TwoNotations),
        }
    }
}

impl fmt::Display for Notation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Comment => f.write_str("comment"),
            Self::Wai => f.write_str("wai"),
            Self::Siemens => f.write_str("siemens"),
            Self::MCodes { first, last } => write!(f, "M{first}-M{last}"),
        }
    }
}

impl FromStr for Notation {
    type Err = NoNotation;

    fn from_str(text: &str) -> Result<Self, NoNotation> {
        match text {
            "comment" => return Ok(Self::Comment),
            "wai" => return Ok(Self::Wai),
            "siemens" => return Ok(Self::Siemens),
            _ => {}
        }
        let code = |text: &str| text.trim().strip_prefix(['M', 'm'])?.parse::<u32>().ok();
        let (first, last) = text.split_once('-').ok_or(NoNotation)?;
        let (first, last) = code(first).zip(code(last)).ok_or(NoNotation)?;
        // M00 to M30 are every control's own.
        let is_range = first > 30 && first <= last && last <= 99_999_999;
        if is_range { Ok(Self::MCodes { first, last }) } else { Err(NoNotation) }
    }
}

impl Names<'_> {
    fn channel(self, name: &str) -> Read<ChannelId> {
        let name = name.trim();
        let setup = self.setup;
        let numbered = || {
            let number = name.parse::<u8>().ok()?.checked_sub(1)?;
            setup.channels().nth(usize::from(number))
        };
        setup.channel(name).or_else(numbered).ok_or_else(|| {
            let known = setup.names(setup.channels().collect());
            BadWord::Channel { name: name.to_owned(), known }
        })
    }

    fn axis(self, name: &str) -> Read<AxisId> {
        let name = name.trim();
        self.setup.axis(name).ok_or_else(|| {
            let known: Vec<&str> =
                self.setup.axes().map(|axis| self.setup.axis_name(axis)).collect();
            let known = crate::setup::listed(&known);
            BadWord::Axis { name: name.to_owned(), known }
        })
    }

    /// A channel that is started: another one, as it waits until that one runs nothing.
    fn start(self, name: &str) -> Read<Word> {
        match self.channel(name)? {
            channel if channel == self.by => Err(BadWord::StartsItself),
            channel => Ok(Word::Start { channel }),
        }
    }

    /// A meeting at a mark: of these channels and who says it, or of all.
    fn meeting<'t>(self, mark: &str, with: impl Iterator<Item = &'t str>) -> Read<Word> {
        let mark = number(mark)?;
        let mut set = ChannelSet::default();
        for name in with {
            set.insert(self.channel(name)?);
        }
        if set.is_empty() {
            set = self.setup.channels().collect();
        }
        set.insert(self.by);
        if set.len() < 2 {
            return Err(BadWord::Alone);
        }
        Ok(Word::Wait { mark, with: set })
    }
}

/// The number of a mark.
fn number(text: &str) -> Read<u32> {
    let text = text.trim();
    let number =
        if text.bytes().all(|byte| byte.is_ascii_digit()) { text.parse().ok() } else { None };
    number.ok_or_else(|| BadWord::Mark(text.to_owned()))
}

/// The name of a program, with or without quotes.
fn program_name(text: &str) -> Read<String> {
    let name = text.trim().trim_matches('"').trim();
    let is_name = !name.is_empty()
        && name.len() <= 128
        && !name.chars().any(|c| c.is_control() || c.is_whitespace());
    if is_name {
        return Ok(name.to_owned());
    }
    Err(BadWord::Program(name.to_owned()))
}

/// The block without its number, as `N30` or `30`.
fn without_number(text: &str) -> &str {
    let text = text.trim_start();
    let digits = text.strip_prefix(['N', 'n']).unwrap_or(text);
    let rest = digits.trim_start_matches(|c: char| c.is_ascii_digit());
    if rest.len() < digits.len() { rest.trim_start() } else { text }
}

fn without_comments(text: &str) -> String {
    let (mut bare, mut depth) = (String::new(), 0_usize);
    for c in text.chars() {
        match c {
            // After a name it is an argument's: WAITM(1,1,2).
            '(' if depth == 0 && bare.ends_with(|c: char| c.is_ascii_alphabetic()) => bare.push(c),
            '(' => depth += 1,
            ')' if depth > 0 => depth -= 1,
            ';' if depth == 0 => break,
            c if depth == 0 => bare.push(c),
            _ => {}
        }
    }
    bare
}

/// Each with its end, which is LF, CR LF or CR; LF CR and LF CR CR where the first one is that.
fn lines(program: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = program;
    let first = program.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
    let returns_follow = first.is_some_and(|at| program[at..].starts_with(b"\n\r"));
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let mut end = end.map_or(rest.len(), |end| end + 1);
        // CR LF, and CR CR LF as some controls punch it.
        while end < rest.len() && rest[end - 1] == b'\r' && matches!(rest[end], b'\r' | b'\n') {
            end += 1;
        }
        while returns_follow && rest.get(end) == Some(&b'\r') {
            end += 1;
        }
        let (line, after) = rest.split_at(end);
        rest = after;
        Some(line)
    })
}
