//! The kill matrix: which run notices which mutant. Made by running them, kept
//! in the repository, so that it cannot shrink unseen.

use super::{Catalogue, Hunt, Mutant};
use crate::FileError;
use crate::given::file_error::read_toml;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// All mutants and clauses of some catalogues. Sorted by their ids.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, Hunt, Kill, Matrix};
/// use std::path::Path;
///
/// let text = r#"
/// profile = "echo"
/// plugin = "echo"
///
/// [[mutant]]
/// id = "echo.tx.at-once/late"
/// text = "Bytes are sent back a second later"
///
/// [[mutant]]
/// id = "echo.tx.at-once/slow"
/// text = "It takes twice the fuel"
/// survivor = "No clause bounds the fuel."
///
/// [[unbreakable]]
/// clause = "echo.line.parameters"
/// reason = "A plug-in cannot choose the line's parameters."
/// "#;
/// let catalogue = Catalogue::parse(Path::new("echo.toml"), text)?;
/// let hunt_of = |is_killed: bool| {
///     let (run, class) = ("echo.tx.first/uncut".to_owned(), "diverged".to_owned());
///     let kill = is_killed.then_some(Kill { run, class, cites: true });
///     Hunt { kill, not_kills: Vec::new(), runs: 1 }
/// };
/// let matrix = Matrix::new(&[catalogue], |mutant| hunt_of(mutant.id.ends_with("/late")));
/// let matrix = matrix.expect("the catalogue says the same");
/// assert_eq!(matrix.kills[0].run, "echo.tx.first/uncut");
/// assert_eq!(matrix.survivors[0].reason, "No clause bounds the fuel.");
/// assert_eq!(matrix.unbreakable[0].clause, "echo.line.parameters");
/// assert_eq!(matrix.killed_by_clause()["echo.tx.at-once"], 1);
/// assert_eq!(Matrix::parse(Path::new("matrix.toml"), &matrix.to_toml())?, matrix);
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Matrix {
    /// Mutants that a case notices.
    #[serde(default, rename = "kill", skip_serializing_if = "Vec::is_empty")]
    pub kills: Vec<KillRow>,
    /// Mutants that no case can notice.
    #[serde(default, rename = "survivor", skip_serializing_if = "Vec::is_empty")]
    pub survivors: Vec<SurvivorRow>,
    /// Clauses that no change of a plug-in can break.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unbreakable: Vec<UnbreakableRow>,
}

/// A mutant that a case notices.
///
/// The example of [`Matrix`] shows one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KillRow {
    /// The mutant: its clause, a slash, a slug.
    pub mutant: String,
    /// The profile that notices it.
    pub profile: String,
    /// The plug-in that it is a mutant of.
    pub plugin: String,
    /// What is wrong with it.
    pub text: String,
    /// The first run that notices.
    pub run: String,
    /// The kind of wrong behaviour that it sees.
    pub class: String,
    /// Whether the run's case cites the broken clause.
    pub cites: bool,
}

/// A mutant that no case can notice.
///
/// The example of [`Matrix`] shows one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurvivorRow {
    /// The mutant.
    pub mutant: String,
    /// The profile whose cases do not notice it.
    pub profile: String,
    /// The plug-in that it is a mutant of.
    pub plugin: String,
    /// What is wrong with it.
    pub text: String,
    /// Why no case can notice.
    pub reason: String,
}

/// A clause that no change of a plug-in can break.
///
/// The example of [`Matrix`] shows one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnbreakableRow {
    /// The clause.
    pub clause: String,
    /// Its profile.
    pub profile: String,
    /// Why.
    pub reason: String,
}

/// A mutant that proves the opposite of what its catalogue says.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, Hunt, Matrix};
/// use std::path::Path;
///
/// let text = r#"
/// profile = "echo"
/// plugin = "echo"
///
/// [[mutant]]
/// id = "echo.tx.at-once/late"
/// text = "Bytes are sent back a second later"
/// "#;
/// let catalogue = Catalogue::parse(Path::new("echo.toml"), text)?;
/// let survived = |_: &_| Hunt { kill: None, not_kills: Vec::new(), runs: 3 };
/// let unproved = Matrix::new(&[catalogue], survived).unwrap_err();
/// assert!(unproved[0].to_string().starts_with("echo.toml: \"echo.tx.at-once/late\" survived 3 runs"));
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Unproved {
    /// No case noticed it.
    #[error(
        "{}: \"{mutant}\" survived {runs} runs{not_kills}: write a case that notices it, or the \
         reason why none can", file.display()
    )]
    Survived {
        /// The catalogue.
        file: PathBuf,
        /// The mutant.
        mutant: String,
        /// How many runs there were.
        runs: usize,
        /// Runs that failed without wrong behaviour, in words; mostly nothing.
        not_kills: String,
    },
    /// A case noticed it, though its catalogue says that none can.
    #[error(
        "{}: \"{mutant}\" does not survive, {run} notices it: remove the reason", file.display()
    )]
    Killed {
        /// The catalogue.
        file: PathBuf,
        /// The mutant.
        mutant: String,
        /// The run.
        run: String,
    },
}

impl Matrix {
    /// Takes up what came of every mutant.
    ///
    /// # Errors
    /// All mutants that survived without a reason, or have a reason and were killed.
    pub fn new(
        catalogues: &[Catalogue],
        hunt_of: impl Fn(&Mutant) -> Hunt,
    ) -> Result<Self, Vec<Unproved>> {
        let mut matrix = Self::default();
        let mut unproved = Vec::new();
        for catalogue in catalogues {
            for mutant in &catalogue.mutants {
                if let Err(error) = matrix.add(catalogue, mutant, &hunt_of(mutant)) {
                    unproved.push(error);
                }
            }
            matrix.unbreakable.extend(catalogue.unbreakable.iter().map(|clause| UnbreakableRow {
                clause: clause.clause.clone(),
                profile: catalogue.profile.clone(),
                reason: clause.reason.clone(),
            }));
        }
        matrix.kills.sort();
        matrix.survivors.sort();
        matrix.unbreakable.sort();
        if unproved.is_empty() { Ok(matrix) } else { Err(unproved) }
    }

    fn add(&mut self, catalogue: &Catalogue, mutant: &Mutant, hunt: &Hunt) -> Result<(), Unproved> {
        let file = catalogue.file.clone();
        match (&hunt.kill, &mutant.survivor) {
            (Some(kill), None) => self.kills.push(KillRow {
                mutant: mutant.id.clone(),
                profile: catalogue.profile.clone(),
                plugin: mutant.plugin.clone(),
                text: mutant.text.clone(),
                run: kill.run.clone(),
                class: kill.class.clone(),
                cites: kill.cites,
            }),
            (None, Some(reason)) => self.survivors.push(SurvivorRow {
                mutant: mutant.id.clone(),
                profile: catalogue.profile.clone(),
                plugin: mutant.plugin.clone(),
                text: mutant.text.clone(),
                reason: reason.clone(),
            }),
            (Some(kill), Some(_)) => {
                let (mutant, run) = (mutant.id.clone(), kill.run.clone());
                return Err(Unproved::Killed { file, mutant, run });
            }
            (None, None) => {
                return Err(Unproved::Survived {
                    file,
                    mutant: mutant.id.clone(),
                    runs: hunt.runs,
                    not_kills: hunt.not_kills_in_words(),
                });
            }
        }
        Ok(())
    }

    /// Reads what [`Matrix::to_toml`] wrote.
    ///
    /// # Errors
    /// The text is no matrix.
    pub fn parse(file: &Path, text: &str) -> Result<Self, FileError> {
        read_toml(file, text)
    }

    /// For machines.
    pub fn to_toml(&self) -> String {
        let rows = toml::to_string(self).unwrap_or_default();
        format!("# Written by `cargo xtask mutants`; not to be edited.\n\n{rows}")
    }

    /// How many mutants of each clause are killed.
    pub fn killed_by_clause(&self) -> BTreeMap<&str, u32> {
        let mut killed = BTreeMap::new();
        for row in &self.kills {
            *killed.entry(clause(&row.mutant)).or_default() += 1;
        }
        killed
    }
}

/// The clause that a mutant breaks.
pub(super) fn clause(mutant: &str) -> &str {
    mutant.split('/').next().unwrap_or_default()
}
