//! Once a second all links are looked at.

use std::time::Instant;

use softplug_live::reactor::LaneFigures;

use super::block_finder::Wanted;
use super::history::STEP;
use super::{Control, show};
use crate::Refusal;
use crate::jobs::Kind;
use crate::view::{HistoryView, now_ms};

impl Control {
    /// Once a second: what each link did, how fast its job gets on, and at which block it is.
    pub(super) fn sample(&mut self) {
        let now = Instant::now();
        if now < self.next_sample {
            return;
        }
        let missed = now.duration_since(self.next_sample).as_secs() as usize;
        self.next_sample += STEP * (1 + u32::try_from(missed).unwrap_or(u32::MAX - 1));
        let (time, now_ms) = (self.time(), now_ms());
        let mut wanted = Vec::new();
        for (name, link) in &mut self.links {
            let figures: LaneFigures = link.status.read();
            let (counters, buffer) = (show::counters(link, &figures), show::buffer(link));
            // What is awaited is not held, though the line stands.
            let counts_hold = link.is_held(&figures) || !figures.is_held;
            link.history.take(&counters, &buffer, counts_hold, (missed, now_ms));
            let Some(running) = &link.job else { continue };
            let (id, spec) = (running.job.id, running.job.spec.clone());
            let Some(progress) = link.lane_progress(id, &figures) else { continue };
            if let Some(data) = spec.data
                && spec.kind == Kind::Send
                && !progress.is_check
            {
                let surely = progress.extent.surely;
                let (begins, link) = ((spec.from_block, spec.from), name.clone());
                wanted.push(Wanted { job: id, link, data, begins, byte: surely });
            }
            if let Some(running) = &mut link.job {
                running.rate.take(time, progress.extent.surely);
            }
        }
        self.find_blocks(wanted);
    }

    /// What a link did.
    pub(super) fn history(&self, name: &str) -> Result<HistoryView, Refusal> {
        let link = self.links.get(name).ok_or_else(|| Refusal::no_link(name))?;
        Ok(link.history.view())
    }
}
