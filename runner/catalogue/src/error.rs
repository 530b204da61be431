//! Why a file is no machine.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::limits::{MOST_FILE_BYTES, MOST_NAME, MOST_TEXT};

/// A text that is no machine. Prints as one sentence.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum MachineError {
    /// It is longer than any machine.
    #[error("it has more than {MOST_FILE_BYTES} bytes, which no machine takes")]
    TooLong,
    /// It is no TOML, or has keys that are not known.
    #[error("line {line}: {message}")]
    Form {
        /// Counted from 1.
        line: usize,
        /// What the parser says.
        message: String,
    },
    /// Its name cannot be written where a name is asked for.
    #[error("{name} is no name of a machine; give 1 to {MOST_NAME} of a-z, 0-9 and -")]
    Name {
        /// As it stands there, escaped.
        name: String,
    },
    /// A text is too long, or cannot be shown in one line.
    #[error("`{key}` is no text to show; give 1 to {MOST_TEXT} bytes without control characters")]
    Text {
        /// The key.
        key: &'static str,
    },
    /// Programs are named in a way that is none.
    #[error("`names`: {0}")]
    Notation(#[from] NotationError),
    /// The plug-in is named by what is no name.
    #[error("`plugin` is {name}; give the name of a plug-in, such as \"xon-xoff\", and no path")]
    Plugin {
        /// As it stands there, escaped.
        name: String,
    },
}

/// A form that is no notation of a name. Prints as one sentence.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
#[error(
    "{form:?} is no notation of a name: write one {{number}} or {{name}} into it, as in O{{number}} or <{{name}}>"
)]
pub struct NotationError {
    /// The form, or its beginning.
    pub form: String,
}

/// A folder whose files are no machines.
#[derive(Debug, Error)]
pub enum FolderError {
    /// It cannot be read.
    #[error("{} cannot be read: {source}", path.display())]
    Read {
        /// The folder or file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// One of its files is no machine.
    #[error("{}: {source}", path.display())]
    Machine {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: MachineError,
    },
    /// Two of its files have machines of one name.
    #[error("{} and {} both have the machine {name}; rename one", first.display(), second.display())]
    Twice {
        /// The name.
        name: String,
        /// The file that was read first.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
    },
}
