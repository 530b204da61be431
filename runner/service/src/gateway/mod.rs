//! The gateway that runs: one door for whoever wants something of it.
//!
//! [`Gateway`] is a handle that can be cloned and shared. Its calls block, but
//! never for long: what takes time goes on by itself and is seen in views and in
//! the stream of changes. Behind it one thread, the control loop, owns all
//! that is decided; bytes pass on the reactor's threads and never wait for it.

mod control;
mod feeding;
mod watching;

pub use feeding::Feeding;
pub use watching::{Next, Watching};

use std::fs::File;
use std::io::Read;
use std::sync::Arc;

use tokio::sync::broadcast;

use crate::Refusal;
use crate::view::{
    Change, HealthView, JobFilter, JobOrder, JobView, JournalEntry, JournalFilter, KindView,
    LinkView, PluginRef, PluginView, ProgramView, ReadyView, ReceptionView, ReloadView, StopHow,
    SwapOrder, SwapView,
};
use control::Shared;

/// A running gateway.
#[derive(Clone, Debug)]
pub struct Gateway {
    shared: Arc<Shared>,
}

/// A file to be read to its end.
#[derive(Debug)]
pub struct Download {
    /// Its name, without folders.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// The file, at its beginning.
    pub file: File,
}

/// Links.
impl Gateway {
    /// All links, in the order of their names.
    pub fn links(&self) -> Result<Vec<LinkView>, Refusal> {
        Err(soon())
    }

    /// One link.
    pub fn link(&self, name: &str) -> Result<LinkView, Refusal> {
        Err(Refusal::no_link(name))
    }

    /// The kinds of job that a link's plug-in takes.
    pub fn job_kinds(&self, link: &str) -> Result<Vec<KindView>, Refusal> {
        Err(Refusal::no_link(link))
    }

    /// Closes a link's port and opens it again.
    pub fn reopen(&self, link: &str) -> Result<LinkView, Refusal> {
        Err(Refusal::no_link(link))
    }

    /// Swaps a link's plug-in. Loads it first, which may take a second; then
    /// waits a moment for the swap, which may have to wait for the link.
    pub fn swap(&self, link: &str, order: &SwapOrder) -> Result<SwapView, Refusal> {
        let _ = order;
        Err(Refusal::no_link(link))
    }

    /// Goes on although the machine holds the line.
    pub fn force_resume(&self, link: &str) -> Result<LinkView, Refusal> {
        Err(Refusal::no_link(link))
    }

    /// Lets a link out of quarantine: its plug-in is started again.
    pub fn release(&self, link: &str) -> Result<LinkView, Refusal> {
        Err(Refusal::no_link(link))
    }

    /// What passes on a link's line from now on. A link never waits for who watches it.
    pub fn watch(&self, link: &str) -> Result<Watching, Refusal> {
        Err(Refusal::no_link(link))
    }
}

/// Jobs.
impl Gateway {
    /// Jobs, the newest first.
    pub fn jobs(&self, filter: &JobFilter) -> Result<Vec<JobView>, Refusal> {
        let _ = filter;
        Err(soon())
    }

    /// One job.
    pub fn job(&self, id: u32) -> Result<JobView, Refusal> {
        Err(Refusal::no_job(id))
    }

    /// Puts a job into a link's queue. A program that it sends is copied first:
    /// editing the file afterwards changes nothing.
    pub fn submit(&self, link: &str, order: &JobOrder) -> Result<JobView, Refusal> {
        let _ = order;
        Err(Refusal::no_link(link))
    }

    /// Begins a job whose data comes from the caller while it runs; refused if
    /// the link is busy. The order's program is only a name.
    pub fn feed(
        &self,
        link: &str,
        order: &JobOrder,
        size: Option<u64>,
    ) -> Result<(JobView, Feeding), Refusal> {
        let _ = (order, size);
        Err(Refusal::no_link(link))
    }

    /// Pauses a job.
    pub fn pause(&self, id: u32) -> Result<JobView, Refusal> {
        Err(Refusal::no_job(id))
    }

    /// Ends its pause.
    pub fn resume(&self, id: u32) -> Result<JobView, Refusal> {
        Err(Refusal::no_job(id))
    }

    /// Aborts a job, or takes it out of the queue.
    pub fn abort(&self, id: u32) -> Result<JobView, Refusal> {
        Err(Refusal::no_job(id))
    }

    /// Puts a job that has ended into the queue again, as a new job, from a
    /// block on (counted from 1); the whole of it if none is given.
    pub fn restart(&self, id: u32, from_block: Option<u64>) -> Result<JobView, Refusal> {
        let _ = from_block;
        Err(Refusal::no_job(id))
    }

    /// Gives a job that waits another priority.
    pub fn prioritise(&self, id: u32, priority: i32) -> Result<JobView, Refusal> {
        let _ = priority;
        Err(Refusal::no_job(id))
    }
}

/// Programs and receptions.
impl Gateway {
    /// All programs.
    pub fn programs(&self) -> Result<Vec<ProgramView>, Refusal> {
        Err(soon())
    }

    /// Stores a program under a name such as `O1234.nc` or `lathes/O1234.nc`: all
    /// of it or nothing. Reads `source` to its end.
    pub fn upload(
        &self,
        name: &str,
        overwrite: bool,
        source: &mut dyn Read,
    ) -> Result<ProgramView, Refusal> {
        let _ = (name, overwrite, source);
        Err(soon())
    }

    /// A program.
    pub fn download(&self, name: &str) -> Result<Download, Refusal> {
        Err(Refusal::NotFound(format!("there is no program \"{}\"", name.escape_debug())))
    }

    /// Deletes a program. Jobs that send it have a copy.
    pub fn delete(&self, name: &str) -> Result<(), Refusal> {
        Err(Refusal::NotFound(format!("there is no program \"{}\"", name.escape_debug())))
    }

    /// What a link has received, the newest first.
    pub fn receptions(&self, link: &str) -> Result<Vec<ReceptionView>, Refusal> {
        Err(Refusal::no_link(link))
    }

    /// Something that a link has received.
    pub fn download_reception(&self, link: &str, file: &str) -> Result<Download, Refusal> {
        let _ = file;
        Err(Refusal::no_link(link))
    }

    /// Deletes something that a link has received.
    pub fn delete_reception(&self, link: &str, file: &str) -> Result<(), Refusal> {
        let _ = file;
        Err(Refusal::no_link(link))
    }

    /// The trace that led to a fault, by the file's name in its view.
    pub fn download_trace(&self, link: &str, file: &str) -> Result<Download, Refusal> {
        let _ = file;
        Err(Refusal::no_link(link))
    }
}

/// The library of plug-ins.
impl Gateway {
    /// All plug-ins.
    pub fn plugins(&self) -> Result<Vec<PluginView>, Refusal> {
        Err(soon())
    }

    /// Checks a module and adds it.
    pub fn add_plugin(&self, module: &[u8]) -> Result<PluginView, Refusal> {
        let _ = module;
        Err(soon())
    }

    /// Removes a plug-in that no link runs: `name@version` or `name@sha256:…`.
    pub fn remove_plugin(&self, plugin: &str) -> Result<(), Refusal> {
        Err(Refusal::NotFound(format!("there is no plug-in \"{}\"", plugin.escape_debug())))
    }

    /// Removes modules that nothing refers to; which ones.
    pub fn collect_garbage(&self) -> Result<Vec<PluginRef>, Refusal> {
        Err(soon())
    }
}

/// The gateway itself.
impl Gateway {
    /// Entries of the journal, the newest first.
    pub fn journal(&self, filter: &JournalFilter) -> Result<Vec<JournalEntry>, Refusal> {
        let _ = filter;
        Err(soon())
    }

    /// All that changes from now on. A reader who is too slow misses the oldest
    /// and is told how many.
    pub fn subscribe(&self) -> broadcast::Receiver<Arc<Change>> {
        self.shared.changes.subscribe()
    }

    /// How it is.
    pub fn health(&self) -> HealthView {
        HealthView {
            is_healthy: true,
            problems: Vec::new(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            started_ms: self.shared.started_ms,
            links: crate::view::LinkCounts::default(),
        }
    }

    /// Whether it takes work.
    pub fn ready(&self) -> ReadyView {
        ReadyView { is_ready: false, reasons: vec!["the gateway starts".to_owned()] }
    }

    /// Reads the configuration again and applies what changed in it, without
    /// touching other links.
    pub fn reload(&self) -> Result<ReloadView, Refusal> {
        Err(soon())
    }

    /// Stops the gateway; returns at once.
    pub fn stop(&self, how: StopHow) {
        let _ = how;
    }
}

fn soon() -> Refusal {
    Refusal::Unavailable("the gateway starts; try again in a moment".to_owned())
}
