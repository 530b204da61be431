//! How many random sessions of a corpus a plug-in gets through.

use super::Corpus;
use crate::random::Sessions;
use crate::run::subject::Sandboxed;
use std::time::{Duration, Instant};

/// Sessions that are run to see how long they take.
const TRIED: u32 = 64;

impl Sessions {
    /// About as many as a plug-in gets through in this time.
    pub(crate) fn within(
        subject: &Sandboxed,
        corpus: &Corpus,
        profile: &str,
        time: Duration,
        threads: usize,
    ) -> u32 {
        let few = Self { count: TRIED, ..Self::whole(profile) };
        let begin = Instant::now();
        for group in corpus.sessions.iter().filter(|group| group.profile == profile) {
            group.run(subject, few, &[], &|| false);
        }
        let rate = f64::from(TRIED) / begin.elapsed().as_secs_f64().max(1e-6);
        (rate * time.as_secs_f64() * threads as f64) as u32
    }
}
