//! Faults as they are kept: what is shown, and the trace that led there.

use std::path::PathBuf;
use std::sync::Arc;

use softplug_gateway::reactor::LaneFault;

use super::control::Shared;
use super::loading::Prepared;
use crate::supervise::evidence::{self, About};
use crate::view::{FaultView, TimeMs, now_ms};

/// Milliseconds of a day.
const DAY: u64 = 24 * 3_600 * 1_000;

impl Shared {
    /// A fault as it is shown; its trace is written elsewhere.
    pub(super) fn fault_view(
        self: &Arc<Self>,
        link: &str,
        plugin: &Prepared,
        fault: LaneFault,
    ) -> FaultView {
        let at_ms = now_ms();
        let number = format!("{at_ms:013}");
        let trace = (!fault.recording.is_empty()).then(|| format!("{number}.spt"));
        let view = FaultView {
            at_ms,
            plugin: plugin.which.clone(),
            event: fault.event.map_or("none", softplug_abi::EventKind::name).to_owned(),
            text: fault.sentence,
            last_words: fault.last_words,
            trace,
        };
        if view.trace.is_some() {
            let (shared, link, kept) = (Arc::clone(self), link.to_owned(), view.clone());
            let recording = fault.recording;
            self.parts.worker.give(move || {
                let day = day(kept.at_ms);
                let version = format!("{} {}", kept.plugin.version, kept.plugin.digest);
                let about = About {
                    link: &link,
                    plugin: &kept.plugin.name,
                    version: &version,
                    sentence: &kept.text,
                    last_words: kept.last_words.as_deref(),
                    day: &day,
                    number: &number,
                };
                let text = evidence::trace(&recording, &about);
                if let Err(error) = evidence::keep(&shared.trace_folder(&link), &about, &text) {
                    tracing::error!(%error, "the trace of a fault is lost");
                }
            });
        }
        view
    }

    /// Where the traces of a link's faults are. A link's name is one of a folder.
    pub(super) fn trace_folder(&self, link: &str) -> PathBuf {
        self.traces.join(link)
    }
}

/// The day of a time, as YYYY-MM-DD (UTC).
pub(crate) fn day(at: TimeMs) -> String {
    // Days since 0000-03-01, in eras of 400 years of 146,097 days.
    let days = at / DAY + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = era * 400 + year + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        for (seconds, expected) in [
            (0, "1970-01-01"),
            (951_782_399, "2000-02-28"),
            (951_782_400, "2000-02-29"),
            (951_868_800, "2000-03-01"),
            (1_735_689_599, "2024-12-31"),
            (1_735_689_600, "2025-01-01"),
            (4_107_542_400, "2100-03-01"),
        ] {
            assert_eq!(day(seconds * 1_000), expected);
        }
    }
}
