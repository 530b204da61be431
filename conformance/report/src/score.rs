//! How much a profile's runs notice of a module that is changed on purpose.

use serde::{Deserialize, Serialize};

/// What became of a module's changes: one instruction each, one at a time.
///
/// ```
/// use softplug_report::{Noticed, Score, Shown, Survivor};
///
/// let change = "200 becomes 201".to_owned();
/// let survivor = Survivor { function: 7, at: 1_234, change, shown: Shown::Different };
/// let score = Score {
///     seed: 1,
///     sessions: 400,
///     changes: 5_000,
///     tried: 12,
///     invalid: 2,
///     noticed: Noticed { lint: 0, cases: 7, permutations: 1, sessions: 1 },
///     survivors: vec![survivor],
/// };
/// assert!(score.adds_up());
/// assert_eq!(score.share(), 900);
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Score {
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
    /// Those that were noticed.
    pub noticed: Noticed,
    /// Those that nothing noticed.
    pub survivors: Vec<Survivor>,
}

/// Changes by what noticed them first.
///
/// The example of [`Score`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noticed {
    /// The module is refused.
    pub lint: u32,
    /// A case as it is written, or a script.
    pub cases: u32,
    /// A permutation of a case.
    pub permutations: u32,
    /// A random session.
    pub sessions: u32,
}

/// A change that nothing noticed.
///
/// The example of [`Score`] shows one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Survivor {
    /// The function's number in the module.
    pub function: u32,
    /// The instruction's place in the file, in bytes.
    pub at: u64,
    /// What was changed.
    pub change: String,
    /// What any run showed of it.
    pub shown: Shown,
}

/// What the runs showed of a change that none of them failed by.
///
/// The example of [`Score`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shown {
    /// Something else than without it: other bytes, deliveries or results, or others in time.
    /// Either may be right; a ledger that means only one of them has a gap here.
    Different,
    /// What it shows without the change.
    Same,
    /// Nothing executes this place at all.
    NotExecuted,
}

impl Score {
    /// Those that were noticed of those that can be told, in thousandths.
    pub fn share(&self) -> u32 {
        (self.noticed.all() * 1_000).checked_div(self.told()).unwrap_or(0) as u32
    }

    /// Those that can be told from the module as it is: noticed, or different in some run.
    pub fn told(&self) -> u64 {
        self.noticed.all() + self.survived(Shown::Different)
    }

    /// Those that nothing noticed, by what they showed.
    pub fn survived(&self, shown: Shown) -> u64 {
        self.survivors.iter().filter(|survivor| survivor.shown == shown).count() as u64
    }

    /// Whether every change that was tried is accounted for once.
    pub fn adds_up(&self) -> bool {
        let survivors = self.survivors.len() as u64;
        let tried = u64::from(self.tried);
        self.tried <= self.changes
            && u64::from(self.invalid) + self.noticed.all() + survivors == tried
    }
}

impl Noticed {
    /// Changes that anything noticed.
    pub fn all(&self) -> u64 {
        [self.lint, self.cases, self.permutations, self.sessions].map(u64::from).iter().sum()
    }
}
