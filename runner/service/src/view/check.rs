//! What a program cannot say on a link's line.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What becomes of a program on a link's line. Nothing was sent.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct CheckView {
    /// All of it in a word.
    pub result: CheckResult,
    /// The plug-in through which it was tried, as `name version`.
    pub plugin: String,
    /// The line, such as `4800 7E2`.
    pub line: String,
    /// Bytes of the program.
    pub bytes: u64,
    /// Different characters that it has.
    pub different: u64,
    /// Those that do not pass as they are written, in the order in which they come first.
    pub characters: Vec<AlteredView>,
    /// Why the program is refused.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub message: Option<String>,
    /// What is to be known of how it says its name to the link's machine.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub remark: Option<String>,
}

/// What becomes of a program.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CheckResult {
    /// All of it arrives as it is written.
    Passes,
    /// It is sent, and some of its characters arrive otherwise or not at all.
    Altered,
    /// The plug-in does not send it.
    Refused,
}

/// A character that does not pass as it is written.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, ToSchema)]
pub struct AlteredView {
    /// It, or its name or number where it cannot be seen.
    pub character: String,
    /// Its bytes, as hex digits.
    pub bytes: String,
    /// How often it is there.
    pub count: u64,
    /// The line in which it stands first, from 1.
    pub line: u64,
    /// The column there, in characters, from 1.
    pub column: u64,
    /// `dropped`, `replaced`, `foreign`, `cut` or `refused`.
    pub fate: String,
    /// What happens to it, for people.
    pub what: String,
    /// What a person would write in its place, if that is known.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub instead: Option<String>,
}
