//! What can go wrong with programs, by blame.

use std::io;

use thiserror::Error;

use crate::disk::DiskError;

/// Why a program cannot be had or kept.
#[derive(Debug, Error)]
pub enum ProgramError {
    /// A name that is none.
    #[error(
        "\"{0}\" is no name of a program: letters, digits, spaces and . - _ + = , ( ) # @ & are allowed, folders with /, nothing hidden"
    )]
    Name(String),
    /// There is no such program.
    #[error("there is no program \"{0}\"")]
    NotFound(String),
    /// It is there already.
    #[error(
        "there is a program \"{0}\" already: give another name, or say that it shall be replaced"
    )]
    Exists(String),
    /// A folder has its name, or a program that of its folder.
    #[error("\"{0}\" is a folder, or would lie in a program: give another name")]
    InTheWay(String),
    /// There is nothing in it.
    #[error("the program \"{0}\" is empty: there is nothing to send")]
    Empty(String),
    /// Somebody writes to it all the time.
    #[error("the program \"{0}\" is being written: try again when that has ended")]
    Busy(String),
    /// It is too large.
    #[error("the program is larger than {most} bytes, which is the most that is taken")]
    TooLarge {
        /// The most.
        most: u64,
    },
    /// Whoever gave it stopped in the middle.
    #[error("the program did not come to its end: {0}")]
    Source(#[source] io::Error),
    /// No folder of programs is set up.
    #[error("no folder of programs is set up: name one in the configuration (programs)")]
    NoFolder,
    /// Our disk.
    #[error(transparent)]
    Disk(#[from] DiskError),
}
