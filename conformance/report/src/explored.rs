//! What came of exploring a plug-in: everything that may happen, up to so many faults.

use crate::{Coverage, VerdictKind, text};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A plug-in, explored in the configurations of its profile.
///
/// ```
/// use softplug_report::{Explored, ExploredConfiguration, VerdictKind};
///
/// let configuration = ExploredConfiguration {
///     name: "one-block".to_owned(),
///     states: 3_058,
///     digest: "0".repeat(32),
///     ..ExploredConfiguration::default()
/// };
/// let explored =
///     Explored { faults: 1, configurations: vec![configuration], ..Explored::default() };
/// let conformant = (VerdictKind::Conformant, "all 5 required cases passed".to_owned());
/// let (verdict, reason) = explored.weigh(conformant);
/// assert_eq!(verdict, VerdictKind::Conformant);
/// assert!(reason.ends_with("; nothing wrong in any of 3058 states with 1 fault"), "{reason}");
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Explored {
    /// Faults and requests out of turn on one way, at most.
    pub faults: u8,
    /// Those that were explored, in the order of the profile; the last one only as far as something
    /// was found, if it was.
    pub configurations: Vec<ExploredConfiguration>,
    /// Why it could not be explored to the end, one sentence; none: it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// How much of the module was executed; only where all of it was explored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coverage: Option<Coverage>,
}

/// One configuration: a plug-in with settings and jobs, and what stands at the other end.
///
/// The example of [`Explored`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExploredConfiguration {
    /// Its name.
    pub name: String,
    /// What stands at the other end.
    pub partner: String,
    /// The plug-in was held to the profile's model besides the promises.
    pub held_to_model: bool,
    /// States that were found.
    pub states: u64,
    /// Choices that were made.
    pub transitions: u64,
    /// Choices from the first state to the last one.
    pub depth: u32,
    /// From any state: how long it takes at most to come to rest when nothing goes wrong any more,
    /// in µs; none where something was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest_us: Option<i64>,
    /// What the protocol cannot keep from happening, and how often it did.
    pub unavoidable: BTreeMap<String, u64>,
    /// Over all states, 32 hex digits.
    pub digest: String,
    /// What must never be, if it can be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found: Option<Found>,
}

/// Something that must never be, and the shortest way to it.
///
/// ```
/// use softplug_report::{Drawn, Found, Side};
///
/// let row = Drawn { at_us: 4_001, side: Side::Line, text: "the character to 1 is lost".into() };
/// let found = Found { promise: "altered".into(), drawn: vec![row], ..Found::default() };
/// assert!(found.text.is_empty());
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// The promise that is broken, in one word.
    pub promise: String,
    /// How, one sentence.
    pub text: String,
    /// The way, from the top down.
    pub drawn: Vec<Drawn>,
}

/// A row of the way.
///
/// The example of [`Found`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drawn {
    /// µs from the opening of the link.
    pub at_us: i64,
    /// Where it happened.
    pub side: Side,
    /// What.
    pub text: String,
}

/// Where something on a way happened.
///
/// The example of [`Found`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The plug-in was given it, or did it.
    Plugin,
    /// So was, or did, the second plug-in at the other end.
    Partner,
    /// Something went wrong between them.
    Line,
}

impl Explored {
    /// The configuration in which something was found, and what.
    pub fn found(&self) -> Option<(&ExploredConfiguration, &Found)> {
        self.configurations
            .iter()
            .find_map(|explored| explored.found.as_ref().map(|found| (explored, found)))
    }

    /// States of all configurations.
    pub fn states(&self) -> u64 {
        self.configurations.iter().fold(0, |sum, explored| sum.saturating_add(explored.states))
    }

    /// Choices of all configurations.
    pub fn transitions(&self) -> u64 {
        self.configurations.iter().fold(0, |sum, explored| sum.saturating_add(explored.transitions))
    }

    /// A verdict and its reason with what was found besides.
    ///
    /// The example of [`Explored`] shows it.
    pub fn weigh(&self, (verdict, reason): (VerdictKind, String)) -> (VerdictKind, String) {
        if !verdict.is_conformant() {
            return (verdict, reason);
        }
        let faults = text::count(self.faults.into(), "fault");
        if let Some((configuration, found)) = self.found() {
            let (name, what) = (text::line(&configuration.name), text::line(&found.text));
            let why = format!("{reason}, but exploring {name} with {faults} found: {what}");
            return (VerdictKind::NotConformant, why);
        }
        if let Some(refused) = &self.refused {
            let why = format!("{reason}, but it was not explored: {}", text::line(refused));
            return (VerdictKind::Partial, why);
        }
        let states = self.states();
        (verdict, format!("{reason}; nothing wrong in any of {states} states with {faults}"))
    }

    /// What is not as it can be.
    pub(crate) fn wrong(&self) -> Option<&'static str> {
        let is_digest = |text: &str| {
            text.len() == 32 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
        };
        if !self.configurations.iter().all(|explored| is_digest(&explored.digest)) {
            return Some("has a digest that is not 32 digits of 0 to 9 and a to f");
        }
        if let [before @ .., _] = &self.configurations[..]
            && before.iter().any(|explored| explored.found.is_some())
        {
            return Some("goes on behind what was found");
        }
        if self.configurations.is_empty() && self.refused.is_none() {
            return Some("has no configuration and no reason for that");
        }
        if self.found().is_some() && self.refused.is_some() {
            return Some("was refused, and found something");
        }
        if self.coverage.as_ref().is_some_and(|coverage| !coverage.adds_up()) {
            return Some("names more or fewer places than are missing");
        }
        None
    }
}
