//! What came of changes of the reference plug-ins' modules. Made by trying them, which takes
//! long, and kept in the repository.

use crate::FileError;
use crate::given::file_error::read_toml;
use serde::{Deserialize, Serialize};
use softplug_report::{Noticed, Score, Shown};
use std::path::Path;

/// A row for each plug-in, by name.
///
/// ```
/// use softplug_conformance::mutants::Scores;
/// use softplug_report::{Noticed, Score, Shown, Survivor};
/// use std::path::Path;
///
/// let change = "200 becomes 201".to_owned();
/// let survivor = Survivor { function: 7, at: 1_234, change, shown: Shown::Different };
/// let noticed = Noticed { cases: 8, sessions: 1, ..Noticed::default() };
/// let (tried, survivors) = (10, vec![survivor]);
/// let score = Score { changes: 5_000, tried, noticed, survivors, ..Score::default() };
///
/// let mut scores = Scores::default();
/// scores.put("echo", &score);
/// assert_eq!(scores.rows[0].share(), 900);
/// assert_eq!(Scores::parse(Path::new("scores.toml"), &scores.to_toml())?, scores);
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// The rows.
    #[serde(default, rename = "score", skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<ScoreRow>,
}

/// What came of the changes of one plug-in. For the words see [`Score`].
///
/// The example of [`Scores`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScoreRow {
    /// The plug-in.
    pub plugin: String,
    /// What the changes that were tried were drawn from, and the random sessions.
    pub seed: u64,
    /// Random sessions that were run against a change at most.
    pub sessions: u32,
    /// Changes that there are.
    pub changes: u32,
    /// Those that were tried.
    pub tried: u32,
    /// Those of them that make no valid module.
    pub invalid: u32,
    /// Those that nothing executes.
    pub not_executed: u64,
    /// Those that did in every run what the plug-in does.
    pub same: u64,
    /// Those that were noticed.
    pub noticed: Noticed,
    /// Those that did something else in some run, and were not noticed: function, place in the
    /// module in bytes, and the change.
    #[serde(default)]
    pub different: Vec<(u32, u64, String)>,
}

impl Scores {
    /// Reads what [`Scores::to_toml`] wrote.
    ///
    /// # Errors
    /// The text holds no scores.
    pub fn parse(file: &Path, text: &str) -> Result<Self, FileError> {
        read_toml(file, text)
    }

    /// For machines.
    pub fn to_toml(&self) -> String {
        let rows = toml::to_string(self).unwrap_or_default();
        format!("# Written by `cargo xtask mutants --module --long`; not to be edited.\n\n{rows}")
    }

    /// Puts a plug-in's row in place of the one that is there.
    pub fn put(&mut self, plugin: &str, score: &Score) {
        let is_different = |shown| shown == Shown::Different;
        let different = score.survivors.iter().filter(|survivor| is_different(survivor.shown));
        let row = ScoreRow {
            plugin: plugin.to_owned(),
            seed: score.seed,
            sessions: score.sessions,
            changes: score.changes,
            tried: score.tried,
            invalid: score.invalid,
            not_executed: score.survived(Shown::NotExecuted),
            same: score.survived(Shown::Same),
            noticed: score.noticed,
            different: different
                .map(|survivor| (survivor.function, survivor.at, survivor.change.clone()))
                .collect(),
        };
        self.rows.retain(|other| other.plugin != plugin);
        self.rows.push(row);
        self.rows.sort_by(|a, b| a.plugin.cmp(&b.plugin));
    }
}

impl ScoreRow {
    /// Those that were noticed of those that can be told from the module as it is, in thousandths.
    pub fn share(&self) -> u32 {
        let told = self.noticed.all() + self.different.len() as u64;
        (self.noticed.all() * 1_000).checked_div(told).unwrap_or(0) as u32
    }
}
