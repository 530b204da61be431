//! How many random sessions of a corpus a plug-in gets through.

use super::Corpus;
use crate::random::Sessions;
use crate::run::subject::{Sandboxed, SubjectError};
use softplug_host::{Host, HostOptions};
use std::error::Error;
use std::time::{Duration, Instant};

/// Sessions that are run to see how long they take.
const TRIED: u32 = 64;

impl Sessions {
    /// About as many as a plug-in gets through in this time.
    ///
    /// # Errors
    /// The engine fails, or the plug-in cannot be judged.
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
}
