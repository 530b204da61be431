//! Programs that other programs load: each becomes a job that waits for its start.

use softplug_abi::JobId;
use std::sync::Arc;

use softplug_cell::{ChannelId, End, Event, Stop};

use super::Control;
use crate::Refusal;
use crate::jobs::{Data, JobSpec, Note, Start, Subject, Weight};

impl Control {
    /// The job of a program that was loaded there and is not started.
    pub(super) fn loaded_job(&self, link: &str) -> Option<JobId> {
        let live = self.shared.parts.jobs.live();
        let mut loaded = live.iter().filter(|job| {
            job.spec.link == link && job.spec.start == Some(Start::Awaited) && !job.has_begun()
        });
        loaded.next().map(|job| job.id)
    }

    /// Makes a job of a program that was loaded: it waits for its start.
    pub(super) fn load(&self, name: &str, channel: ChannelId, program: &str) {
        let Some(state) = self.cells.by_name.get(name) else { return };
        let Some(of) = self.channel_of(state.config.setup.channel_name(channel)) else { return };
        let (name, program) = (name.to_owned(), program.to_owned());
        let shared = Arc::clone(&self.shared);
        self.shared.parts.requests.give(move || {
            let _hold = shared.parts.snapshots.hold();
            let link = of.config.setup.channel_name(channel).to_owned();
            let taken = of.find(&shared, channel, &program).and_then(|found| {
                let data = shared.parts.programs.snapshot(&found, &shared.parts.snapshots)?;
                of.read(&shared, data)
            });
            let written = shared.ask(move |control| {
                control.loaded(&name, channel, &link, &program, taken);
                Ok(())
            });
            if let Err(error) = written {
                tracing::error!(%error, "a program that was loaded is not in the queue");
            }
        });
    }

    /// A program that was to be loaded was read, or could not be.
    fn loaded(
        &mut self,
        name: &str,
        channel: ChannelId,
        link: &str,
        program: &str,
        taken: Result<(Data, Vec<Stop>), Refusal>,
    ) {
        let Some(state) = self.cells.by_name.get(name) else { return };
        let is_loaded = state.cell.channel(channel).loaded.is_some();
        let is_started =
            !is_loaded && state.cell.runs(channel) && state.jobs[usize::from(channel.0)].is_none();
        let is_there = self.loaded_job(link).is_some();
        if is_there || (!is_loaded && !is_started) {
            // Somebody ended it meanwhile, and may have loaded another one.
            return;
        }
        let submitted = taken.and_then(|(data, stops)| {
            let start = if is_started { Start::Given } else { Start::Awaited };
            let spec = JobSpec { start: Some(start), ..JobSpec::send(link, program, data) };
            Ok(self.shared.parts.jobs.submit_with(spec, stops)?)
        });
        match submitted {
            Ok(job) => {
                self.show_job(&job);
                self.begin_next(link);
            }
            Err(refusal) => {
                let text = format!("{name}: {program} cannot be loaded into {link}: {refusal}");
                let note = Note::new(Subject::Cell, text).of_link(link).weighing(Weight::Alarm);
                self.shared.parts.journal_writer.note(note);
                self.happened(
                    name,
                    if is_started {
                        Event::Ended { channel, end: End::Failed }
                    } else {
                        Event::Unloaded { channel }
                    },
                );
            }
        }
    }
}
