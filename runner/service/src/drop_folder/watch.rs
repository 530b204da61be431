//! The thread of one drop folder.

use softplug_abi::JobId;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use softplug_host::Digest;
use softplug_live::store::is_open_for_writing;
use thiserror::Error;

use super::names::shown;
use super::place::{Found, Held, Place, Shelf, Whose, state_of};
use super::result::{self, Now};
use super::settling::{FileState, Settling};
use crate::config::DropConfig;
use crate::disk::{copy, is_full};
use crate::jobs::{Claim, Claimed, Job, JobsError, Weight};
use crate::view::{DropView, now_ms};

/// Of what cannot be taken, so many names are told in [`ODD_AGAIN`].
const ODD_TOLD: usize = 100;
/// After so long a name is told again.
const ODD_AGAIN: Duration = Duration::from_hours(1);

/// A file that is to become a job.
#[derive(Debug)]
pub(crate) struct Dropped<'a> {
    /// Its claim.
    pub(crate) claim: Claim,
    /// Its name, for people.
    pub(crate) name: String,
    /// The file, at its beginning.
    pub(crate) file: &'a File,
    /// More bytes than these are not taken.
    pub(crate) most: u64,
}

/// Why a file does not become a job.
#[derive(Debug)]
pub(crate) enum NotTaken {
    /// Not now: it is tried again.
    Later(String),
    /// Never, as it is.
    Never(String),
}

/// What a drop folder needs of the gateway.
pub(crate) trait Queue: Send {
    /// Nothing new is to be begun.
    fn is_stopping(&self) -> bool;
    /// How many more jobs may wait.
    fn room(&self) -> usize;
    /// What the folder says of whose it is.
    fn owner(&self) -> Result<String, JobsError>;
    /// Whether this folder was looked after before.
    fn is_known(&self, folder: &Path) -> Result<bool, JobsError>;
    /// It is looked after from now on.
    fn know(&self, folder: &Path) -> Result<(), JobsError>;
    /// The job of a claim, if there is one.
    fn claimed(&self, claim: &str) -> Result<Option<Claimed>, JobsError>;
    /// A job.
    fn job(&self, id: JobId) -> Result<Job, JobsError>;
    /// Makes a job of a file, once for each claim.
    fn submit(&self, dropped: &Dropped<'_>) -> Result<(), NotTaken>;
    /// A claim is settled.
    fn settle(&self, claim: &str) -> Result<(), JobsError>;
    /// Something for the journal.
    fn tell(&self, weight: Weight, text: String);
}

/// A drop folder that is looked after. Dropped, its thread ends after what it is doing.
#[derive(Debug)]
pub(crate) struct DropFolder {
    pub(crate) config: DropConfig,
    view: Arc<Mutex<DropView>>,
    stop: Option<Sender<()>>,
    ended: Receiver<()>,
}

impl DropFolder {
    pub(crate) fn start(config: DropConfig, queue: impl Queue + 'static) -> io::Result<Self> {
        let view = Arc::new(Mutex::new(DropView {
            folder: config.folder.display().to_string(),
            ..DropView::default()
        }));
        let (stop, stopped) = channel();
        let (alive, ended) = channel();
        let watch = Watch {
            config: config.clone(),
            queue,
            view: Arc::clone(&view),
            settling: Settling::default(),
            known: BTreeSet::new(),
            told: BTreeMap::new(),
            began: Instant::now(),
        };
        thread::Builder::new().name("softplug-drop".to_owned()).spawn(move || {
            watch.run(&stopped);
            drop(alive);
        })?;
        Ok(Self { config, view, stop: Some(stop), ended })
    }

    /// How it is.
    pub(crate) fn view(&self) -> DropView {
        look(&self.view).clone()
    }

    /// Has it end, and waits for that no longer than `patience`: a share may never answer.
    pub(crate) fn end(&mut self, patience: Duration) -> bool {
        drop(self.stop.take());
        !matches!(self.ended.recv_timeout(patience), Err(RecvTimeoutError::Timeout))
    }
}

fn look(view: &Mutex<DropView>) -> MutexGuard<'_, DropView> {
    view.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Watch<Q> {
    config: DropConfig,
    queue: Q,
    view: Arc<Mutex<DropView>>,
    settling: Settling,
    /// Claims that were in this folder, and are not settled yet.
    known: BTreeSet<String>,
    /// What could not be taken, and when it was told.
    told: BTreeMap<OsString, Duration>,
    began: Instant,
}

/// What one look has found.
#[derive(Default)]
struct Looked {
    waiting: u64,
    under_way: u64,
    odd: BTreeMap<OsString, String>,
    /// The first thing that went wrong, and may go right at the next look.
    trouble: Option<String>,
    /// It keeps other files from being taken.
    is_blocked: bool,
}

impl Looked {
    fn failed(&mut self, text: impl Into<String>) {
        self.trouble.get_or_insert(text.into());
        self.is_blocked = true;
    }
}

/// Why a drop folder cannot be looked after.
#[derive(Debug, Error)]
enum Unusable {
    #[error(transparent)]
    Jobs(#[from] JobsError),
    #[error("the drop folder {} is not there: make it, or mount its share", .0.display())]
    Missing(PathBuf),
    #[error("the drop folder {} cannot be used: {}", folder.display(), told(error))]
    Io { folder: PathBuf, error: io::Error },
    #[error(
        "the drop folder {} is not the one that it was, it has no work/.owner: mount its share; if \
         it was emptied on purpose, make an empty file work/.owner in it",
        .0.display()
    )]
    Another(PathBuf),
    #[error(
        "the drop folder {} belongs to {theirs}, which is not this one: give each link a folder of \
         its own; if that one is gone, see what is left in work, and remove work/.owner",
        folder.display()
    )]
    Theirs { folder: PathBuf, theirs: String },
}

impl<Q: Queue> Watch<Q> {
    fn run(mut self, stopped: &Receiver<()>) {
        loop {
            if !self.queue.is_stopping() {
                let mut looked = Looked::default();
                if let Err(error) = self.look(stopped, &mut looked) {
                    self.settling.forget();
                    looked.failed(error.to_string());
                }
                self.show(looked);
            }
            match stopped.recv_timeout(self.config.poll) {
                Err(RecvTimeoutError::Timeout) => {}
                Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
    }

    fn look(&mut self, stopped: &Receiver<()>, looked: &mut Looked) -> Result<(), Unusable> {
        let is_stopped =
            || !matches!(stopped.try_recv(), Err(std::sync::mpsc::TryRecvError::Empty));
        let folder = self.config.folder.clone();
        let cannot = |error| Unusable::Io { folder: folder.clone(), error };
        let is_known = self.queue.is_known(&folder)?;
        let found = Place::open(&folder, is_known).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => Unusable::Missing(folder.clone()),
            _ => cannot(error),
        })?;
        let Found::Place(place) = found else {
            return Err(Unusable::Another(folder));
        };
        let owner = self.queue.owner()?;
        if let Whose::Theirs(theirs) = place.whose(&owner).map_err(cannot)? {
            let theirs = softplug_live::plain_text(theirs.lines().next().unwrap_or_default());
            return Err(Unusable::Theirs { folder, theirs });
        }
        if !is_known {
            self.queue.know(&folder)?;
        }
        self.known.extend(place.claims().map_err(cannot)?);
        // Also those whose folders somebody has removed.
        for claim in self.known.clone() {
            if is_stopped() {
                return Ok(());
            }
            self.settle(&place, &claim, looked);
        }
        let listing = place.list().map_err(cannot)?;
        looked.waiting = listing.files.len() as u64;
        let odd = listing.odd.into_iter().map(|(name, what)| (name, format!("is {what}")));
        looked.odd.extend(odd);
        let settled = self.settling.look(listing.files, self.began.elapsed(), self.config.settle);
        let mut room = self.queue.room();
        for (name, state) in settled {
            if room == 0 || looked.is_blocked || is_stopped() || self.queue.is_stopping() {
                break;
            }
            if let Some(claim) = claim_one(&place, &name, state, looked) {
                room -= 1;
                looked.waiting -= 1;
                self.take(&place, &claim, looked);
                self.known.insert(claim);
            }
        }
        Ok(())
    }

    /// Goes on with a file that was claimed before.
    fn settle(&mut self, place: &Place, claim: &str, looked: &mut Looked) {
        let claimed = match self.queue.claimed(claim) {
            Ok(Some(claimed)) => claimed,
            Ok(None) => {
                self.known.remove(claim);
                return self.take(place, claim, looked);
            }
            Err(error) => return looked.failed(error.to_string()),
        };
        let job = match self.queue.job(claimed.job) {
            Ok(job) if job.state.is_final() => Some(job),
            Ok(_) => return looked.under_way += 1,
            Err(JobsError::NotFound(_)) => None,
            Err(error) => return looked.failed(error.to_string()),
        };
        if let Err(error) = self.put_away(place, claim, claimed, job.as_ref()) {
            return looked.failed(not_put_away(&error));
        }
        match self.queue.settle(claim) {
            // In this order, so that a claim without its folder is one that somebody has removed.
            Ok(()) => place.forget(claim),
            Err(error) => tracing::debug!(%error, claim, "a claim is settled at the next look"),
        }
        self.known.remove(claim);
    }

    /// Puts away the file of a claim whose job has ended; none: nobody knows any more how. Where the
    /// file has gone from `work`, what became of it is said all the same.
    fn put_away(
        &self,
        place: &Place,
        claim: &str,
        claimed: Claimed,
        job: Option<&Job>,
    ) -> io::Result<()> {
        let tag = claimed.job.to_string();
        let held = place.claimed(claim)?;
        let now = match (&held, job) {
            (Held::PutAway, _) => return Ok(()),
            (Held::Nothing, _) => Now::Gone,
            (Held::File(name), Some(job)) => file_now(place.read(claim, name), claimed, job),
            (Held::File(_), None) => Now::AsTaken,
        };
        let (shelf, text) = match job {
            Some(job) => result::of_job(job, claimed, now),
            None => (Shelf::Failed, result::of_forgotten(claimed)),
        };
        if let Held::File(name) = held {
            return place.put_away(claim, shelf, &name, &tag, &text).map(drop);
        }
        let name =
            job.and_then(|job| job.spec.program.as_deref()).unwrap_or("file").replace('/', "_");
        let result = place.put_result(claim, shelf, OsStr::new(&name), &tag, &text)?;
        self.queue.tell(
            Weight::Warning,
            format!(
                "the file of job {tag} is gone from work in the drop folder; what became of it is in \
                 {}/{}",
                shelf.name(),
                shown(&result)
            ),
        );
        Ok(())
    }

    /// Makes a job of a file that was claimed.
    fn take(&self, place: &Place, claim: &str, looked: &mut Looked) {
        let mut taken = || {
            let Held::File(name) = place.claimed(claim)? else {
                place.forget(claim);
                return Ok(());
            };
            let file = place.read(claim, &name)?;
            if file.as_ref().and_then(is_open_for_writing) == Some(true) {
                looked.waiting += 1;
                return Ok(());
            }
            let not_taken = match file {
                None => Err(NotTaken::Never("it is no file".to_owned())),
                Some(file) => {
                    let size = state_of(&file)?.size;
                    let claim = Claim { name: claim.to_owned(), size };
                    let (name, most) = (shown(&name), self.config.largest);
                    self.queue.submit(&Dropped { claim, name, file: &file, most })
                }
            };
            match not_taken {
                Ok(()) => looked.under_way += 1,
                Err(NotTaken::Later(why)) => looked.failed(why),
                Err(NotTaken::Never(why)) => self.refuse(place, claim, &name, &why)?,
            }
            Ok(())
        };
        if let Err(error) = taken() {
            // Others may be taken meanwhile.
            let text = format!("a file of the drop folder cannot be read: {}", told(&error));
            looked.trouble.get_or_insert(text);
        }
    }

    fn refuse(&self, place: &Place, claim: &str, name: &OsStr, why: &str) -> io::Result<()> {
        let tag = &claim[claim.len() - 8..];
        let text = result::of_refused(why);
        let kept = place.put_away(claim, Shelf::Failed, name, tag, &text)?;
        place.forget(claim);
        let text = format!(
            "{} of the drop folder is not taken: {why}; it is now failed/{}",
            shown(name),
            shown(&kept)
        );
        self.queue.tell(Weight::Warning, text);
        Ok(())
    }

    /// Shows what was found; what went wrong is told once, until it goes right.
    fn show(&mut self, looked: Looked) {
        let Looked { waiting, under_way, odd, trouble, .. } = looked;
        let before = {
            let mut view = look(&self.view);
            let left_lying = odd.len() as u64;
            let folder = view.folder.clone();
            let now = DropView { folder, waiting, under_way, left_lying, trouble: trouble.clone() };
            std::mem::replace(&mut *view, now).trouble
        };
        match (&before, &trouble) {
            (Some(before), Some(now)) if before == now => {}
            (_, Some(now)) => self.queue.tell(Weight::Warning, now.clone()),
            (Some(_), None) => {
                self.queue.tell(Weight::Normal, "the drop folder can be used again".to_owned());
            }
            (None, None) => {}
        }
        if trouble.is_some() {
            return;
        }
        let now = self.began.elapsed();
        // What is there stays told; what is gone may come back as often as somebody likes.
        self.told.retain(|name, at| odd.contains_key(name) || now.saturating_sub(*at) < ODD_AGAIN);
        for (name, what) in odd {
            if self.told.contains_key(&name) || self.told.len() >= ODD_TOLD {
                continue;
            }
            let text = format!("{} in the drop folder {what}: it stays where it is", shown(&name));
            self.queue.tell(Weight::Warning, text);
            self.told.insert(name, now);
        }
    }
}

/// What a claimed file is now, beside what was taken of it. One that cannot be read is put away all
/// the same.
fn file_now(file: io::Result<Option<File>>, claimed: Claimed, job: &Job) -> Now {
    let sized =
        file.and_then(|file| file.map(|file| Ok((state_of(&file)?.size, file))).transpose());
    match sized {
        Err(_) => Now::Unreadable,
        Ok(None) => Now::NoFile,
        Ok(Some((size, _))) if size != claimed.size => Now::OfSize(size),
        // Where words of a cell were left out, what was sent is shorter, and tells nothing of the file.
        Ok(Some((size, file))) => match job.spec.data.filter(|data| data.size == size) {
            Some(taken) => compared(file, taken.digest),
            None => Now::AsTaken,
        },
    }
}

fn compared(mut file: impl Read, taken: Digest) -> Now {
    match copy(&mut file, &mut io::sink()) {
        Ok(found) if found.digest == taken => Now::AsTaken,
        Ok(_) => Now::Rewritten,
        Err(_) => Now::Unreadable,
    }
}

/// Claims a file if it is still what has settled, and nobody has it open for writing.
fn claim_one(place: &Place, name: &OsStr, state: FileState, looked: &mut Looked) -> Option<String> {
    match place.peek(name).and_then(|file| Ok((state_of(&file)?, file))) {
        Ok((now, file)) if now == state && is_open_for_writing(&file) != Some(true) => {}
        // The next look sees what it is then.
        Ok(_) => return None,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
        Err(error) => {
            looked.odd.insert(name.to_owned(), format!("cannot be read ({error})"));
            looked.waiting -= 1;
            return None;
        }
    }
    let claim = new_claim();
    match place.claim(name, &claim) {
        Ok(()) => Some(claim),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => {
            let text = format!("files cannot be moved within the drop folder: {}", told(&error));
            looked.failed(text);
            None
        }
    }
}

/// Sorted by time, and never given twice.
fn new_claim() -> String {
    format!("{:013x}{:016x}", now_ms(), RandomState::new().build_hasher().finish())
}

fn not_put_away(error: &io::Error) -> String {
    format!("a file of the drop folder whose job has ended cannot be put away: {}", told(error))
}

fn told(error: &io::Error) -> String {
    let advice = match error.kind() {
        _ if is_full(error) => "; make room there",
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "; give the gateway's user the right to write there"
        }
        _ => "",
    };
    format!("{error}{advice}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A share that fails in the middle.
    struct Failing;

    impl Read for Failing {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("the share is gone"))
        }
    }

    #[test]
    fn a_file_that_cannot_be_read_any_more_is_put_away_all_the_same() {
        let taken = Digest::of(b"G1");
        assert_eq!(compared(&b"G1"[..], taken), Now::AsTaken);
        assert_eq!(compared(&b"G2"[..], taken), Now::Rewritten);
        assert_eq!(compared(Failing, taken), Now::Unreadable);
    }
}
