//! What may become of a job: no I/O, no clock.

use std::fmt;

pub use crate::view::JobState as State;

/// All states.
#[cfg(test)]
pub(super) const ALL: [State; 7] = [
    State::Queued,
    State::Running,
    State::Paused,
    State::Done,
    State::Failed,
    State::Aborted,
    State::Interrupted,
];

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
            proptest::sample::select(&ALL[..]).prop_map(Step::End),
        ]
    }

    proptest! {
        #[test]
        fn a_job_begins_once_and_ends_once(steps in proptest::collection::vec(step(), 0..40)) {
            let (mut state, mut has_begun) = (State::Queued, false);
            for step in steps {
                let Some(next) = after(state, has_begun, step) else { continue };
                prop_assert!(!state.is_final(), "{} became {}", state.name(), next.name());
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
            assert!(aborted == Some(State::Aborted) || has_begun, "{}", state.name());
            let ended =
                aborted.and_then(|state| after(state, has_begun, Step::End(State::Aborted)));
            assert_eq!(ended.is_some(), has_begun);
        }
        for state in ALL.into_iter().filter(|state| state.is_final()) {
            assert_eq!(after(state, true, Step::Resume), None);
        }
    }
}
