//! Faults as they are kept: what is shown, and the trace that led there.

use std::path::PathBuf;
use std::sync::Arc;

use softplug_live::reactor::LaneFault;

use super::Shared;
use super::loading::Prepared;
use crate::supervise::evidence::{self, About};
use crate::view::{FaultView, day, now_ms};

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
