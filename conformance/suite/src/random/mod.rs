//! Random sessions: what no case shows, held to the profile's model.

mod digest;
mod group;
#[cfg(test)]
mod tests;
mod trace;

pub(crate) use group::model_of;
pub use group::{FailedSession, GroupRun, SessionGroup};
#[cfg(feature = "wasmtime")]
pub(crate) use trace::given_as;

/// Groups of a profile's sessions; each is a case of its own, so that they are spread
/// over threads.
pub(crate) const GROUPS: u64 = 8;

/// How many sessions a whole certification of a profile that has a model runs.
pub(crate) const WHOLE: u32 = 2_000;

/// Which sessions are run.
///
/// ```
/// use softplug_conformance::Sessions;
///
/// let whole = Sessions::whole("xon-xoff");
/// assert_eq!((whole.seed, whole.count > 100), (1, true));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Sessions {
    /// How many.
    pub count: u32,
    /// What they are drawn from.
    pub seed: u64,
}

impl Sessions {
    /// As many as a verdict on this profile needs; none where it has no model.
    pub fn whole(profile: &str) -> Self {
        let has_model = softplug_models::profile(profile).is_some();
        Self { count: if has_model { WHOLE } else { 0 }, seed: 1 }
    }

    /// Of a group from 1.
    pub(crate) fn numbers(self, group: u64) -> impl Iterator<Item = u64> {
        (group - 1..u64::from(self.count)).step_by(GROUPS as usize)
    }
}
