//! Drop folders: which are looked after, and how a file becomes a job.

use softplug_abi::JobId;
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{Control, Gateway, Shared, calls};
use crate::Refusal;
use crate::config::LinkConfig;
use crate::disk::{Moment, is_full};
use crate::drop_folder::{DropFolder, Dropped, NotTaken, Queue};
use crate::jobs::{Claimed, Job, JobSpec, JobsError, Origin, Subject, Weight};
use crate::programs::ProgramError;
use crate::view::{JobOrder, LinkView};

/// So many jobs of a link may wait; files beyond that stay in its folder, and others can still be put
/// into the queue.
const WAITING: usize = 100;
/// How long threads are waited for at the end: a share may never answer.
const ENDING: Duration = Duration::from_secs(5);

/// The drop folders of a gateway, by link.
#[derive(Debug, Default)]
pub(super) struct Drops {
    by_link: BTreeMap<String, DropFolder>,
}

impl Drops {
    /// Has them all end.
    pub(super) fn end(self) {
        let until = Instant::now() + ENDING;
        for (link, mut folder) in self.by_link {
            if !folder.end(until.saturating_duration_since(Instant::now())) {
                tracing::warn!(link, "the drop folder does not answer, and is left behind");
            }
        }
    }
}

impl Control {
    /// Looks after these folders from now on. Those that are the same are not touched.
    pub(super) fn set_drops(&mut self, links: &[LinkConfig]) {
        let wanted: BTreeMap<_, _> =
            links.iter().filter_map(|link| Some((&link.name, link.drop.as_ref()?))).collect();
        let journal = &self.shared.parts.journal_writer;
        self.drops.by_link.retain(|link, folder| {
            let is_wanted = wanted.get(link) == Some(&&folder.config);
            let is_left = wanted.get(link).is_none_or(|new| new.folder != folder.config.folder);
            let (jobs, place) = (folder.view().under_way, folder.config.folder.display());
            if !is_wanted && is_left && jobs > 0 {
                let text = format!(
                    "the drop folder {place} is no longer looked after: {jobs} of its files are jobs \
                     that go on, and the files stay in its work until it is the link's folder again"
                );
                journal.link(Subject::Job, Weight::Warning, link, text);
            }
            is_wanted
        });
        for (link, config) in wanted {
            if self.drops.by_link.contains_key(link) {
                continue;
            }
            let gateway = Gateway { shared: Arc::clone(&self.shared) };
            let queue = LinkQueue { gateway, link: link.clone() };
            match DropFolder::start(config.clone(), queue) {
                Ok(folder) => drop(self.drops.by_link.insert(link.clone(), folder)),
                Err(error) => {
                    let text = format!("the drop folder is not looked after: {error}");
                    journal.link(Subject::Job, Weight::Alarm, link, text);
                }
            }
        }
    }

    /// A link as it is shown, with its drop folder.
    pub(super) fn with_drop(&self, mut view: LinkView) -> LinkView {
        view.drop = self.drops.by_link.get(&view.name).map(DropFolder::view);
        view.trouble.extend(view.drop.iter().filter_map(|drop| drop.trouble.clone()));
        view
    }
}

/// The queue of one link, as a drop folder needs it.
struct LinkQueue {
    gateway: Gateway,
    link: String,
}

impl LinkQueue {
    fn shared(&self) -> &Shared {
        &self.gateway.shared
    }
}

impl Queue for LinkQueue {
    fn is_stopping(&self) -> bool {
        self.shared().is_stopping()
    }

    fn room(&self) -> usize {
        let queued = self.shared().parts.jobs.queued();
        WAITING.saturating_sub(queued.get(&self.link).copied().unwrap_or(0) as usize)
    }

    fn owner(&self) -> Result<String, JobsError> {
        let owner = self.shared().parts.jobs.owner()?;
        Ok(format!("the link \"{}\" of the gateway {owner:016x}\n", self.link))
    }

    fn is_known(&self, folder: &Path) -> Result<bool, JobsError> {
        self.shared().parts.jobs.reader().knows_drop_folder(&folder.to_string_lossy())
    }

    fn know(&self, folder: &Path) -> Result<(), JobsError> {
        self.shared().parts.jobs.know_drop_folder(&folder.to_string_lossy())
    }

    fn claimed(&self, claim: &str) -> Result<Option<Claimed>, JobsError> {
        self.shared().parts.jobs.reader().claimed(claim)
    }

    fn job(&self, id: JobId) -> Result<Job, JobsError> {
        self.shared().parts.jobs.reader().job(id)
    }

    fn submit(&self, dropped: &Dropped<'_>) -> Result<(), NotTaken> {
        let shared = self.shared();
        let order = JobOrder { program: Some(dropped.name.clone()), ..JobOrder::default() };
        let plugin = self.gateway.plugin_of(&self.link).map_err(|refusal| later(&refusal))?;
        let job = calls::order(&self.link, &order, &plugin).map_err(never)?;
        let _hold = shared.parts.snapshots.hold();
        let data = self.copied(dropped)?;
        let names = self.gateway.names_of(&self.link).map_err(|refusal| later(&refusal))?;
        let named = shared.parts.snapshots.name_of(data, &names);
        let (data, stops) = self.gateway.words_of(&self.link, data).map_err(never)?;
        let job = JobSpec { data: Some(data), named, origin: Origin::Drop, ..job };
        let submitted = shared.parts.jobs.submit_claimed(job, stops, &dropped.claim);
        let job = submitted.map_err(|error| match error {
            JobsError::Spec(text) => NotTaken::Never(text),
            error => later(&error),
        })?;
        shared.tell(move |control| {
            control.show_job(&job);
            control.begin_next(&job.spec.link);
        });
        Ok(())
    }

    fn settle(&self, claim: &str) -> Result<(), JobsError> {
        self.shared().parts.jobs.settle(claim)
    }

    fn tell(&self, weight: Weight, text: String) {
        self.shared().parts.journal_writer.link(Subject::Job, weight, &self.link, text);
    }
}

impl LinkQueue {
    /// The file as it is at one moment.
    fn copied(&self, dropped: &Dropped<'_>) -> Result<crate::jobs::Data, NotTaken> {
        let parts = &self.shared().parts;
        let mut source = Source { file: dropped.file, failed: None };
        let before = Moment::of(dropped.file).map_err(|error| later(&error))?;
        if before.size > dropped.most {
            return Err(never(ProgramError::TooLarge { most: dropped.most }));
        }
        let copied = {
            let mut source = parts.quotas.within(&mut source);
            parts.snapshots.take_all(&mut source, &dropped.name, dropped.most)
        };
        if let Some(error) = source.failed {
            return Err(later(&format!("a file of the drop folder cannot be read: {error}")));
        }
        let data = copied.map_err(|error| match error {
            ProgramError::TooLarge { .. } | ProgramError::Empty(_) => never(error),
            error => later(&error),
        })?;
        let after = Moment::of(dropped.file).map_err(|error| later(&error))?;
        if after != before || data.size != before.size {
            return Err(later(&"a file of the drop folder was written to while it was read"));
        }
        Ok(data)
    }
}

/// A share may fail in the middle, which is not our disk's fault.
struct Source<'a> {
    file: &'a std::fs::File,
    failed: Option<io::Error>,
}

impl Read for Source<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.file.read(buffer).inspect_err(|error| {
            if !is_full(error) && error.kind() != io::ErrorKind::Interrupted {
                self.failed = Some(io::Error::new(error.kind(), error.to_string()));
            }
        })
    }
}

fn later(why: &dyn std::fmt::Display) -> NotTaken {
    NotTaken::Later(why.to_string())
}

/// What cannot become a job as it is; but for what passes by itself.
fn never(why: impl Into<Refusal>) -> NotTaken {
    let refusal = why.into();
    let text = refusal.to_string();
    match refusal {
        Refusal::Unavailable(_) | Refusal::Internal(_) => NotTaken::Later(text),
        Refusal::Invalid { reason, .. } => NotTaken::Never(reason),
        _ => NotTaken::Never(text),
    }
}
