//! Random sessions: what no case shows, held to the profile's model.

mod group;
mod trace;

pub(crate) use group::model_of;
pub use group::{FailedSession, GroupRun, SessionGroup};
#[cfg(feature = "wasmtime")]
pub(crate) use trace::given_as;

#[cfg(feature = "wasmtime")]
use crate::corpus::Corpus;
#[cfg(feature = "wasmtime")]
use crate::run::subject::{Sandboxed, SubjectError};
#[cfg(feature = "wasmtime")]
use softplug_host::{Host, HostOptions};
#[cfg(feature = "wasmtime")]
use std::error::Error;
#[cfg(feature = "wasmtime")]
use std::time::{Duration, Instant};

/// Groups of a profile's sessions; each is a case of its own, so that they are spread
/// over threads.
pub(crate) const GROUPS: u64 = 8;

/// How many sessions a whole certification of a profile that has a model runs.
pub(crate) const WHOLE: u32 = 2_000;

/// Sessions that are run to see how long they take.
#[cfg(feature = "wasmtime")]
const TRIED: u32 = 64;

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

    /// About as many as a plug-in gets through in this time.
    ///
    /// # Errors
    /// The engine fails, or the plug-in cannot be judged.
    #[cfg(feature = "wasmtime")]
    pub fn within(
        module: &[u8],
        corpus: &Corpus,
        profile: &str,
        time: Duration,
        threads: usize,
    ) -> Result<u32, SubjectError> {
        let boxed = |error| SubjectError::from(Box::<dyn Error + Send + Sync>::from(error));
        let host = Host::new(HostOptions::default()).map_err(|error| boxed(error.to_string()))?;
        let plugin = host.load_bytes(module).map_err(|error| boxed(error.to_string()))?;
        let subject = Sandboxed::new(plugin);
        let few = Self { count: TRIED, ..Self::whole(profile) };
        let begin = Instant::now();
        for group in corpus.sessions.iter().filter(|group| group.profile == profile) {
            group.run(&subject, few, &[], &|| false);
        }
        let rate = f64::from(TRIED) / begin.elapsed().as_secs_f64().max(1e-6);
        Ok((rate * time.as_secs_f64() * threads as f64) as u32)
    }

    /// Of a group from 1.
    pub(crate) fn numbers(self, group: u64) -> impl Iterator<Item = u64> {
        (group - 1..u64::from(self.count)).step_by(GROUPS as usize)
    }
}
