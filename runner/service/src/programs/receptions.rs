//! What machines have sent: a folder for each link. Nothing is overwritten, what is not
//! whole is marked, and what is said to be there is on the disk.

use softplug_abi::JobId;
use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use softplug_catalogue::{HEAD_BYTES, Notations};
use softplug_live::store::{Inbox, Mark, safe_name};

use super::ProgramError;
use crate::disk::{self, DiskError, make_folder};

/// The end of a failed one's name.
const FAILED: &str = ".failed";

/// The folders of receptions.
#[derive(Clone, Debug)]
pub struct Receptions {
    folder: PathBuf,
    /// How programs say their names, by place.
    names: Arc<RwLock<HashMap<String, Notations>>>,
}

/// A reception in a folder.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ReceptionFile {
    /// Its name.
    pub name: String,
    /// Bytes.
    pub size: u64,
    /// When it was written, in milliseconds since 1970.
    pub modified: u64,
    /// It is not all, or not as it was sent.
    pub is_failed: bool,
}

/// A reception that is being written.
#[derive(Debug)]
pub struct Arrival {
    inbox: Inbox,
    folder: PathBuf,
    head: Vec<u8>,
    names: Notations,
}

/// One that is on the disk.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Arrived {
    /// Its file; none if nothing came.
    pub path: Option<PathBuf>,
    /// The program's name, as far as it could be found out.
    pub name: Option<String>,
    /// Bytes.
    pub bytes: u64,
}

/// What a gateway that was killed had of a reception.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LeftOver {
    /// The folder among the receptions.
    pub place: String,
    /// The job that it belongs to.
    pub job: JobId,
    /// Where it is kept.
    pub arrived: Arrived,
}

impl Arrived {
    /// The name of its file.
    pub fn file(&self) -> Option<String> {
        Some(self.path.as_ref()?.file_name()?.to_string_lossy().into_owned())
    }
}

impl Receptions {
    /// The folder of the folders, which is made if need be.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn open(folder: &Path) -> Result<Self, DiskError> {
        make_folder(folder)?;
        Ok(Self { folder: folder.to_owned(), names: Arc::default() })
    }

    /// From now on programs say their names so, by place; elsewhere as is known.
    pub fn set_names(&self, names: HashMap<String, Notations>) {
        *self.names.write().unwrap_or_else(PoisonError::into_inner) = names;
    }

    /// A reception begins. `place` is the link's name or what the configuration says.
    ///
    /// # Errors
    /// No file can be made.
    pub fn begin(&self, place: &str, job: JobId) -> Result<Arrival, ProgramError> {
        let folder = self.place(place)?;
        make_folder(&folder)?;
        let mut inbox = Inbox::new(&folder).map_err(DiskError::when("write into", &folder))?;
        inbox.begin_as(&format!("job-{job}")).map_err(DiskError::when("write into", &folder))?;
        let names = self.names.read().unwrap_or_else(PoisonError::into_inner);
        let names = names.get(place).cloned().unwrap_or_default();
        Ok(Arrival { inbox, folder, head: Vec::new(), names })
    }

    /// Keeps as failed what a gateway that was killed left behind.
    ///
    /// # Errors
    /// A folder cannot be read, or a file not renamed.
    pub fn recover(&self) -> Result<Vec<LeftOver>, DiskError> {
        let mut recovered = Vec::new();
        for place in disk::names_in(&self.folder)? {
            let folder = self.folder.join(&place);
            if !folder.is_dir() {
                continue;
            }
            let failed = |error| DiskError::when("mend", &folder)(error);
            let left = Inbox::new(&folder).and_then(|mut inbox| inbox.keep_left_over());
            for (stem, kept) in left.map_err(failed)? {
                // A second one of the same job has a number behind it.
                let job = stem.strip_prefix("job-").and_then(|rest| rest.split('-').next());
                if let Some(job) = job.and_then(|job| job.parse().ok().map(JobId)) {
                    let (path, bytes) = (kept.path, kept.bytes);
                    let arrived = Arrived { path, name: None, bytes };
                    recovered.push(LeftOver { place: place.clone(), job, arrived });
                }
            }
        }
        Ok(recovered)
    }

    /// What is there of a link, the newest first.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn list(&self, place: &str) -> Result<Vec<ReceptionFile>, ProgramError> {
        let folder = self.place(place)?;
        let names = match disk::names_in(&folder) {
            Err(error) if error.is_missing() => return Ok(Vec::new()),
            names => names?,
        };
        let file = |name: String| {
            let metadata = fs::symlink_metadata(folder.join(&name)).ok()?;
            let is_ours = metadata.is_file() && !name.ends_with(".partial");
            is_ours.then(|| ReceptionFile {
                size: metadata.len(),
                modified: modified(&metadata),
                is_failed: name.ends_with(FAILED),
                name,
            })
        };
        let mut files: Vec<_> = names.into_iter().filter_map(file).collect();
        files.sort_by(|one, other| {
            other.modified.cmp(&one.modified).then_with(|| one.name.cmp(&other.name))
        });
        Ok(files)
    }

    /// A reception, to be read, and its length.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn read(&self, place: &str, name: &str) -> Result<(File, u64), ProgramError> {
        let path = self.file(place, name)?;
        let open = || {
            let file = File::open(&path)?;
            let size = file.metadata()?.len();
            Ok((file, size))
        };
        Ok(open().map_err(DiskError::when("read", &path))?)
    }

    /// Removes a reception.
    ///
    /// # Errors
    /// There is none of this name, or it cannot be removed.
    pub fn delete(&self, place: &str, name: &str) -> Result<(), ProgramError> {
        Ok(disk::remove(&self.file(place, name)?)?)
    }

    fn place(&self, place: &str) -> Result<PathBuf, ProgramError> {
        let is_plain = safe_name(place).is_some_and(|safe| safe == place);
        let bad =
            || ProgramError::Name(place.chars().take(80).flat_map(char::escape_debug).collect());
        is_plain.then(|| self.folder.join(place)).ok_or_else(bad)
    }

    /// The name is compared with what is there: nothing else can be meant by it.
    fn file(&self, place: &str, name: &str) -> Result<PathBuf, ProgramError> {
        if self.list(place)?.iter().any(|file| file.name == name) {
            return Ok(self.place(place)?.join(name));
        }
        Err(ProgramError::NotFound(name.chars().take(80).flat_map(char::escape_debug).collect()))
    }
}

impl Arrival {
    /// More bytes of it.
    ///
    /// # Errors
    /// They cannot be written. None of them counts then; they may be given again.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inbox.write(bytes)?;
        // Only then: what is given again would stand in it twice.
        let room = HEAD_BYTES - self.head.len();
        self.head.extend_from_slice(&bytes[..bytes.len().min(room)]);
        Ok(())
    }

    /// It has ended. When this returns it is on the disk under its name. Without a name from the
    /// line it gets the one that stands in it, or a number.
    ///
    /// # Errors
    /// It cannot be brought onto the disk; what came stays under its temporary name.
    pub fn end(mut self, name: Option<&str>, mark: Mark) -> Result<Arrived, DiskError> {
        let name = name.map(ToOwned::to_owned).or_else(|| self.names.name_in(&self.head));
        let kept = self.inbox.end(name.as_deref(), mark);
        let kept = kept.map_err(DiskError::when("keep what came in", &self.folder))?;
        Ok(Arrived { path: kept.path, name, bytes: kept.bytes })
    }
}

fn modified(metadata: &fs::Metadata) -> u64 {
    let since = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    since.map_or(0, |since| since.as_millis() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_place_has_its_notations() {
        let folder = tempfile::tempdir().unwrap();
        let receptions = Receptions::open(folder.path()).unwrap();
        let own = Notations::before_known(vec!["({name})".parse().unwrap()]);
        receptions.set_names(HashMap::from([("deckel".to_owned(), own)]));
        let receive = |place, text: &str| {
            let mut arrival = receptions.begin(place, JobId(1)).unwrap();
            arrival.write(text.as_bytes()).unwrap();
            arrival.end(None, Mark::Complete).unwrap().file().unwrap()
        };
        assert_eq!(receive("deckel", "%\n(PART A)\nM30"), "PART A");
        assert_eq!(receive("deckel", "%\n(../../etc/passwd\u{202e})\n"), "_.._etc_passwd_");
        assert_eq!(receive("deckel", "%\n(NUL)\n"), "_NUL");
        assert_eq!(receive("lathe", "%\n(PART A)\nM30"), "000001");
        assert_eq!(receive("lathe", "%\nO<PART A>\nM30"), "PART A");
        assert_eq!(receive("lathe", "%_N_WELLE_12_MPF\n"), "WELLE_12_MPF");
    }

    #[test]
    fn receptions_keep_all_versions_and_what_was_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        let receptions = Receptions::open(folder.path()).unwrap();
        let receive = |job, text: &str, name, mark| {
            let mut arrival = receptions.begin("lathe 1", job).unwrap();
            arrival.write(text.as_bytes()).unwrap();
            arrival.end(name, mark).unwrap().file()
        };
        let file = |name: &str| Some(name.to_owned());
        assert_eq!(receive(JobId(1), "%\nO7\nM30", None, Mark::Complete), file("O7"));
        assert_eq!(receive(JobId(2), "%\nO7\nM30", Some("O7"), Mark::Complete), file("O7-2"));
        assert_eq!(receive(JobId(3), "%\nO7\nM3", None, Mark::Failed), file("O7.failed"));
        assert_eq!(receive(JobId(4), "N10", Some("../x"), Mark::Complete), file("_x"));
        let mut killed = receptions.begin("lathe 1", JobId(5)).unwrap();
        killed.write(b"half").unwrap();
        let nothing = receptions.begin("lathe 1", JobId(6)).unwrap();
        std::mem::forget((killed, nothing));

        let recovered = receptions.recover().unwrap();
        assert_eq!(recovered.len(), 2);
        let of = |job| recovered.iter().find(|left| left.job == job).unwrap().arrived.clone();
        assert_eq!((of(JobId(5)).file(), of(JobId(5)).bytes), (file("000001.failed"), 4));
        assert_eq!((of(JobId(6)).file(), of(JobId(6)).bytes), (None, 0));
        assert_eq!(receptions.recover().unwrap(), []);

        let listed = receptions.list("lathe 1").unwrap();
        let mut names: Vec<_> = listed.iter().map(|file| (&*file.name, file.is_failed)).collect();
        names.sort_unstable();
        assert_eq!(
            names,
            [
                ("000001.failed", true),
                ("O7", false),
                ("O7-2", false),
                ("O7.failed", true),
                ("_x", false)
            ]
        );
        assert_eq!(receptions.read("lathe 1", "O7").unwrap().1, 8);
        for (place, name) in
            [("lathe 1", "../lathe 1/O7"), ("..", "O7"), ("lathe 1", "O8"), ("", "O7")]
        {
            assert!(receptions.read(place, name).is_err(), "{place}/{name}");
        }
        receptions.delete("lathe 1", "O7").unwrap();
        assert!(receptions.delete("lathe 1", "O7").is_err());
        assert_eq!(receptions.list("mill").unwrap(), []);
    }
}
