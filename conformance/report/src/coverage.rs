//! How much of a module was executed.

use serde::{Deserialize, Serialize};

/// How much of a module the runs have executed. Code that nothing can call, and code that does
/// nothing but trap, does not count.
///
/// ```
/// use softplug_report::{Coverage, Executed, Place};
///
/// let place = Place {
///     function: 3,
///     name: Some("receive".to_owned()),
///     at: 812,
///     source: Some("my-machine/src/lib.rs:120".to_owned()),
///     what: "the branch is never taken".to_owned(),
/// };
/// let coverage = Coverage {
///     functions: Executed { executed: 12, of: 12 },
///     branches: Executed { executed: 79, of: 80 },
///     places: vec![place],
/// };
/// assert!(coverage.adds_up());
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Functions.
    pub functions: Executed,
    /// Ways of branches: each condition has two, a table as many as it has targets.
    pub branches: Executed,
    /// Where something was reached and never executed, in the order of the module: functions
    /// that are never called, and ways that are never gone though the branch is.
    pub places: Vec<Place>,
}

/// How many of how many.
///
/// The example of [`Coverage`] shows some.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Executed {
    /// Those that were executed.
    pub executed: u32,
    /// All that there are.
    pub of: u32,
}

/// A place that was never executed.
///
/// The example of [`Coverage`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// The function's number in the module.
    pub function: u32,
    /// Its name, where the module has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Where the instruction stands in the file, in bytes.
    pub at: u64,
    /// File and line of its source, where the module has debug information.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// What was never executed.
    pub what: String,
}

impl Coverage {
    /// Whether the places account for no more than what is missing, and for something where
    /// anything is.
    pub fn adds_up(&self) -> bool {
        let missing = |part: Executed| part.of.checked_sub(part.executed).map(u64::from);
        let (Some(functions), Some(branches)) = (missing(self.functions), missing(self.branches))
        else {
            return false;
        };
        let (missing, places) = (functions + branches, self.places.len() as u64);
        places <= missing && (places > 0) == (missing > 0)
    }
}
