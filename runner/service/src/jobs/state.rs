//! What may become of a job: no I/O, no clock.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Where a job stands.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// It waits for its turn.
    Queued,
    /// The plug-in has it.
    Running,
    /// It waits until somebody lets it go on; it may have begun or not.
    Paused,
    /// All of it has left, or all that was asked for has come.
    Done,
    /// It could not be carried out.
    Failed,
    /// Somebody ended it.
    Aborted,
    /// The gateway or the plug-in ended in the middle of it. It is never begun again
    /// unasked.
    Interrupted,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Queued,
        Self::Running,
        Self::Paused,
        Self::Done,
        Self::Failed,
        Self::Aborted,
        Self::Interrupted,
    ];

    /// Nothing more becomes of it.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Aborted | Self::Interrupted)
    }

    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Aborted => "aborted",
            Self::Interrupted => "interrupted",
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What happens to a job.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Step {
    /// The plug-in is about to be given it.
    Begin,
    /// Somebody wants it to pause.
    Pause,
    /// Somebody lets it go on.
    Resume,
    /// Somebody wants it to end.
    Abort,
    /// It has ended so.
    End(State),
    /// The gateway starts, and it was not ended.
    Recover,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Begin => "begun",
            Self::Pause => "paused",
            Self::Resume => "resumed",
            Self::Abort => "aborted",
            Self::End(_) => "ended",
            Self::Recover => "recovered",
        })
    }
}

/// The state after a step; `None` where there is no such step.
pub fn after(state: State, has_begun: bool, step: Step) -> Option<State> {
    match (state, step) {
        (State::Queued, Step::Begin) => Some(State::Running),
        (State::Queued | State::Running, Step::Pause) => Some(State::Paused),
        (State::Paused, Step::Resume) if has_begun => Some(State::Running),
        (State::Paused, Step::Resume) => Some(State::Queued),
        // A job under way is ended by the plug-in, which owes the partner a clean end.
        (State::Running | State::Paused, Step::Abort) if has_begun => Some(state),
        (State::Queued | State::Paused, Step::Abort) => Some(State::Aborted),
        (State::Running | State::Paused, Step::End(end)) if has_begun && end.is_final() => {
            Some(end)
        }
        (State::Running | State::Paused, Step::Recover) if has_begun => Some(State::Interrupted),
        (State::Queued | State::Paused, Step::Recover) => Some(state),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn step() -> impl Strategy<Value = Step> {
        prop_oneof![
            Just(Step::Begin),
            Just(Step::Pause),
            Just(Step::Resume),
            Just(Step::Abort),
            Just(Step::Recover),
            proptest::sample::select(&State::ALL[..]).prop_map(Step::End),
        ]
    }

    proptest! {
        #[test]
        fn a_job_begins_once_and_ends_once(steps in proptest::collection::vec(step(), 0..40)) {
            let (mut state, mut has_begun) = (State::Queued, false);
            for step in steps {
                let Some(next) = after(state, has_begun, step) else { continue };
                prop_assert!(!state.is_final(), "{state} became {next}");
                if step == Step::Begin {
                    prop_assert!(!has_begun);
                    has_begun = true;
                }
                prop_assert!(!has_begun || next != State::Queued, "begun and queued again");
                prop_assert!(has_begun || !matches!(next, State::Running | State::Done));
                if step == Step::Recover {
                    prop_assert_eq!(next == State::Interrupted, has_begun);
                }
                state = next;
            }
        }
    }

    #[test]
    fn whatever_is_not_ended_can_be_ended_by_somebody() {
        for (state, has_begun) in [
            (State::Queued, false),
            (State::Paused, false),
            (State::Running, true),
            (State::Paused, true),
        ] {
            let aborted = after(state, has_begun, Step::Abort);
            assert!(aborted == Some(State::Aborted) || has_begun, "{state}");
            let ended =
                aborted.and_then(|state| after(state, has_begun, Step::End(State::Aborted)));
            assert_eq!(ended.is_some(), has_begun);
        }
        for state in State::ALL.into_iter().filter(|state| state.is_final()) {
            assert_eq!(after(state, true, Step::Resume), None);
        }
    }
}
