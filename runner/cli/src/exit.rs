//! How the command ends: one table of exit codes for every verb.

use std::fmt::Write as _;
use std::process::ExitCode;

/// An exit code.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Exit {
    Done,
    Failed,
    Usage,
    PlugIn,
    NothingSelected,
    Incomplete,
    Port,
    Internal,
}

impl Exit {
    /// All of them, as `--help` lists them.
    pub(crate) const ALL: [Self; 8] = [
        Self::Done,
        Self::Failed,
        Self::Usage,
        Self::PlugIn,
        Self::NothingSelected,
        Self::Incomplete,
        Self::Port,
        Self::Internal,
    ];

    /// The number that the shell sees.
    pub(crate) const fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::PlugIn => 3,
            Self::NothingSelected => 4,
            Self::Incomplete => 5,
            Self::Port => 6,
            Self::Internal => 70,
        }
    }

    /// What it means, for people.
    pub(crate) const fn text(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed: a transfer, a verdict, or what was to be verified",
            Self::Usage => {
                "wrong usage; a file, or standard output, that cannot be read or written"
            }
            Self::PlugIn => "the plug-in cannot be loaded, or judged",
            Self::NothingSelected => "nothing was selected",
            Self::Incomplete => "incomplete, partial or aborted",
            Self::Port => "the port or the network",
            Self::Internal => "a bug in this command",
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}

/// The table at the end of `--help`.
pub(crate) fn table() -> String {
    let mut table = String::from("Exit codes:");
    for exit in Exit::ALL {
        let _ = write!(table, "\n  {:>2}  {}", exit.code(), exit.text());
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_its_own() {
        let codes = Exit::ALL.map(Exit::code);
        assert_eq!(codes, [0, 1, 2, 3, 4, 5, 6, 70]);
        assert_eq!(table().lines().count(), 1 + Exit::ALL.len());
    }
}
