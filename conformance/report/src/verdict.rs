//! The verdict: a function of what was executed, and of nothing else.

use crate::{Counts, Coverage, Selection, text};
use serde::{Deserialize, Serialize};

/// The five verdicts.
///
/// ```
/// use softplug_report::VerdictKind;
///
/// assert_eq!(VerdictKind::ConformantWithWarnings.text(), "conformant with warnings");
/// assert!(!VerdictKind::NotJudged.is_conformant());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VerdictKind {
    /// Every required case was executed and passed.
    Conformant,
    /// Every required case was executed and passed, but for some that SHOULD pass.
    ConformantWithWarnings,
    /// Nothing failed unexpectedly, but not all that is required was executed, or the baseline
    /// excuses a failure.
    Partial,
    /// A required case failed, or the baseline is stale.
    NotConformant,
    /// The plug-in cannot be judged.
    NotJudged,
}

impl VerdictKind {
    /// The name in reports, with spaces for people.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Conformant => "conformant",
            Self::ConformantWithWarnings => "conformant with warnings",
            Self::Partial => "partial",
            Self::NotConformant => "not conformant",
            Self::NotJudged => "not judged",
        }
    }
}

/// What can decide a verdict before any count does.
///
/// ```
/// use softplug_report::{Counts, Reason, Selection, VerdictKind, verdict};
///
/// let all = Counts { required: 2, executed: 2, passed: 2, ..Counts::default() };
/// let stale = "the baseline expects xon-xoff.tx.hold to fail, and it passes".to_owned();
/// let reason = Reason::Baseline(stale.clone());
/// let judged = verdict(&all, &Selection::default(), &reason);
/// assert_eq!(judged, (VerdictKind::NotConformant, stale));
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Reason {
    /// Nothing does.
    None,
    /// The plug-in cannot be judged: one sentence.
    NotJudged(String),
    /// The baseline expects a failure that is none, or is stale: one sentence.
    Baseline(String),
    /// What of the module was executed is not known. A strict run is not satisfied.
    Unmeasured,
    /// So many places of the module were never executed. Where nothing else speaks against
    /// the plug-in, a strict run is not satisfied.
    Unexecuted(usize),
}

impl Reason {
    /// What the executed places say of a plug-in.
    pub fn of(coverage: &Coverage) -> Self {
        match coverage.places.len() {
            0 => Self::None,
            places => Self::Unexecuted(places),
        }
    }
}

/// The verdict and its reason as one sentence.
///
/// ```
/// use softplug_report::{Counts, Reason, Selection, VerdictKind, verdict};
///
/// let all = Counts { required: 2, executed: 2, passed: 2, ..Counts::default() };
/// assert_eq!(verdict(&all, &Selection::default(), &Reason::None).0, VerdictKind::Conformant);
/// let skipped = Counts { executed: 1, passed: 1, ..all };
/// assert_eq!(verdict(&skipped, &Selection::default(), &Reason::None).0, VerdictKind::Partial);
/// ```
pub fn verdict(counts: &Counts, selection: &Selection, reason: &Reason) -> (VerdictKind, String) {
    match reason {
        Reason::NotJudged(why) => return (VerdictKind::NotJudged, why.clone()),
        Reason::Baseline(why) => return (VerdictKind::NotConformant, why.clone()),
        Reason::None | Reason::Unexecuted(_) | Reason::Unmeasured => {}
    }
    if counts.failed > 0 {
        let why = format!("{} of {} required cases failed", counts.failed, counts.required);
        return (VerdictKind::NotConformant, why);
    }
    if selection.interrupted && counts.executed == counts.required {
        let why = "it was ended before it was known what of the module no run executes";
        return (VerdictKind::Partial, why.to_owned());
    }
    let is_whole = !selection.interrupted
        && selection.cases.is_empty()
        && counts.required > 0
        && counts.executed == counts.required;
    if !is_whole && counts.required > 0 && counts.executed == counts.required {
        let why = "only cases that match patterns were asked for, though that is all of them";
        return (VerdictKind::Partial, why.to_owned());
    }
    if !is_whole {
        let ended = if selection.interrupted { ": it was ended" } else { "" };
        let Counts { executed, required, .. } = counts;
        let why = format!("only {executed} of {required} required cases were executed{ended}");
        return (VerdictKind::Partial, why);
    }
    if selection.sessions < selection.sessions_needed {
        let (run, needed) = (selection.sessions, selection.sessions_needed);
        let why = format!("only {run} of {needed} random sessions were asked for");
        return (VerdictKind::Partial, why);
    }
    if counts.expected > 0 {
        let why = format!(
            "{} of {} required cases failed as the baseline expects",
            counts.expected, counts.required
        );
        return (VerdictKind::Partial, why);
    }
    let unexecuted = match reason {
        Reason::Unexecuted(places) => {
            let places = text::count(u32::try_from(*places).unwrap_or(u32::MAX), "place");
            format!("{places} of the module never executed")
        }
        Reason::Unmeasured => "what of the module was executed is not known".to_owned(),
        _ => String::new(),
    };
    if selection.strict && !unexecuted.is_empty() {
        let why = format!("all {} required cases passed, but {unexecuted}", counts.required);
        return (VerdictKind::Partial, why);
    }
    let behind = if unexecuted.is_empty() { unexecuted } else { format!("; {unexecuted}") };
    if counts.warned > 0 {
        let why = format!("{} that should pass failed{behind}", text::count(counts.warned, "case"));
        return (VerdictKind::ConformantWithWarnings, why);
    }
    (VerdictKind::Conformant, format!("all {} required cases passed{behind}", counts.required))
}
