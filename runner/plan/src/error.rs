//! Why a shop cannot be meant: what, where, and what to do.

use std::fmt;

use thiserror::Error;

use crate::limits::{MOST_MACHINES, MOST_NAME};

/// A place in `shop.toml`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Place {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// A shop that cannot be meant. Prints as one sentence, with its place where it was read from a
/// file: `LINE:COLUMN: what is wrong; what to do`.
#[derive(Clone, PartialEq, Debug, Error)]
pub struct ShopError {
    /// Where; `None` if it was not read from a file.
    pub place: Option<Place>,
    /// What is wrong.
    pub wrong: Wrong,
}

impl fmt::Display for ShopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            Some(place) => write!(f, "{place}: {}", self.wrong),
            None => write!(f, "{}", self.wrong),
        }
    }
}

/// What is wrong with a shop.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum Wrong {
    /// The file is too long to be a list of machines.
    #[error(
        "the file has more than {most} bytes; give machines that are alike one table with `count`"
    )]
    TooLong {
        /// Its length, or how much of it was read to see that it is too long.
        bytes: usize,
        /// The most that is read.
        most: usize,
    },
    /// It is no TOML, or has keys that are not known.
    #[error("{message}; {hint}")]
    Form {
        /// What the parser says.
        message: String,
        /// What to do.
        hint: String,
    },
    /// A value is none that can be meant.
    #[error("`{key}` is {value}; give {needs}")]
    Value {
        /// The key.
        key: &'static str,
        /// What it is.
        value: String,
        /// What it may be.
        needs: String,
    },
    /// A name that cannot be shown.
    #[error("{name} is no name; give 1 to {MOST_NAME} characters that can be seen")]
    Name {
        /// The name, in quotes and escaped.
        name: String,
    },
    /// Two machines have one name; those of a `count` are called NAME-1, NAME-2 and so on.
    #[error(
        "there are two machines {name}; rename one, and mind that a `count` makes NAME-1, NAME-2 and so on"
    )]
    Twice {
        /// The name, in quotes and escaped.
        name: String,
    },
    /// Nobody to feed.
    #[error("there are no machines; add a table [[machine]] for each")]
    NoMachines,
    /// More machines than a bus is planned for.
    #[error(
        "there are {machines} machines; a bus is planned for at most {MOST_MACHINES}, so lower `count` or plan each bus by itself"
    )]
    TooMany {
        /// How many there are, all counts together.
        machines: u64,
    },
}
