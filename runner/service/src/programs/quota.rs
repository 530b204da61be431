//! What a link may put on the disk: a machine, or a plug-in that invents what a machine sends,
//! must not take the room that the jobs of all others need.
//!
//! Past a quota nothing is taken any more: the plug-in loses its room for deliveries and holds
//! the machine. So nothing that was taken is lost, and it goes on when the quota is raised, the
//! day is over or there is room again.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

use thiserror::Error;

use crate::view::DAY;

/// What one link may receive.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Quota {
    /// Bytes of one reception.
    pub reception: u64,
    /// Receptions of a day.
    pub receptions: u64,
    /// Bytes of a day.
    pub bytes: u64,
}

impl Default for Quota {
    /// More than any serial line brings in a day.
    fn default() -> Self {
        Self { reception: 256 << 20, receptions: 100_000, bytes: 4 << 30 }
    }
}

/// What a link has received on one day, which begins at midnight UTC.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Today {
    pub(crate) day: u64,
    /// Receptions that were begun.
    pub receptions: u64,
    /// Bytes of those that have ended.
    pub bytes: u64,
}

impl Today {
    /// What counts at this time: of another day nothing does.
    pub(crate) fn at(self, now: u64) -> Self {
        let day = now / DAY;
        if self.day == day { self } else { Self { day, ..Self::default() } }
    }
}

/// Room on the disk that is kept for jobs and journal, if nothing else is said.
pub const FREE_SPACE: u64 = 256 << 20;

/// Why nothing more is taken.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum OverQuota {
    /// By blame of the machine or its plug-in.
    #[error(
        "this reception has {most} bytes, and none may have more (quota.reception of the link); raise it, \
         or stop the plug-in: softplug link quarantine"
    )]
    Reception {
        /// The quota.
        most: u64,
    },
    /// No more receptions may come today.
    #[error(
        "{most} receptions came today, and no more may (quota.receptions of the link); raise it, or stop the \
         plug-in: softplug link quarantine"
    )]
    Receptions {
        /// The quota.
        most: u64,
    },
    /// No more bytes may come today.
    #[error(
        "{most} bytes came today, and no more may (quota.bytes of the link); raise it, or stop the plug-in: \
         softplug link quarantine"
    )]
    Bytes {
        /// The quota.
        most: u64,
    },
    /// Of the set-up: the disk.
    #[error(
        "{} has less than {keep} bytes left, which are kept for jobs (free-space); make room on the disk",
        folder.display()
    )]
    FreeSpace {
        /// What is kept.
        keep: u64,
        /// Where.
        folder: PathBuf,
    },
}

/// The quotas of all links. Clones are the same.
#[derive(Clone, Debug)]
pub struct Quotas {
    links: Arc<RwLock<BTreeMap<String, Quota>>>,
    free_space: u64,
    folder: PathBuf,
}

impl Quotas {
    /// So much of the disk that `folder` is on is never touched.
    pub fn new(folder: &Path, free_space: u64) -> Self {
        Self { links: Arc::default(), free_space, folder: folder.to_owned() }
    }

    /// Other quotas, from here on.
    pub fn set(&self, links: BTreeMap<String, Quota>) {
        *self.links.write().unwrap_or_else(PoisonError::into_inner) = links;
    }

    /// Whether a reception may begin.
    ///
    /// # Errors
    /// So many have come today, or there is no room.
    pub fn begin(&self, link: &str, today: Today) -> Result<(), OverQuota> {
        let Quota { receptions, bytes, .. } = self.of(link);
        if today.receptions >= receptions {
            return Err(OverQuota::Receptions { most: receptions });
        }
        if today.bytes >= bytes {
            return Err(OverQuota::Bytes { most: bytes });
        }
        self.free().map(drop)
    }

    /// How many bytes more may come of one that has so many, at least 1. `today` is without them.
    ///
    /// # Errors
    /// None may.
    pub fn room(&self, link: &str, today: Today, written: u64) -> Result<u64, OverQuota> {
        let quota = self.of(link);
        let of_one = quota.reception.saturating_sub(written);
        let of_day = quota.bytes.saturating_sub(today.bytes.saturating_add(written));
        if of_one == 0 {
            return Err(OverQuota::Reception { most: quota.reception });
        }
        if of_day == 0 {
            return Err(OverQuota::Bytes { most: quota.bytes });
        }
        Ok(of_one.min(of_day).min(self.free()?))
    }

    /// How many bytes may be written before what is kept free is touched, at least 1.
    ///
    /// # Errors
    /// None may.
    pub fn free(&self) -> Result<u64, OverQuota> {
        // A disk that does not say how full it is says so when it is written to.
        let Ok(disk) = rustix::fs::statvfs(&self.folder) else { return Ok(u64::MAX) };
        let left = disk.f_bavail.saturating_mul(disk.f_frsize).saturating_sub(self.free_space);
        if left == 0 && self.free_space > 0 {
            let (keep, folder) = (self.free_space, self.folder.clone());
            return Err(OverQuota::FreeSpace { keep, folder });
        }
        Ok(left.max(1))
    }

    /// The source, which fails as a full disk does where what is kept free would be touched.
    pub fn within<'a>(&'a self, source: &'a mut dyn Read) -> WithinFree<'a> {
        WithinFree { quotas: self, source, left: 0 }
    }

    fn of(&self, link: &str) -> Quota {
        let links = self.links.read().unwrap_or_else(PoisonError::into_inner);
        links.get(link).copied().unwrap_or_default()
    }
}

/// So many bytes are read before it is looked again how full the disk is: others write too.
const LOOK_EVERY: u64 = 1 << 20;

/// What is read of it goes onto the disk.
pub struct WithinFree<'a> {
    quotas: &'a Quotas,
    source: &'a mut dyn Read,
    left: u64,
}

impl Read for WithinFree<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            let full = |over| io::Error::new(io::ErrorKind::StorageFull, over);
            self.left = self.quotas.free().map_err(full)?.min(LOOK_EVERY);
        }
        let most = usize::try_from(self.left).unwrap_or(usize::MAX).min(buffer.len());
        let count = self.source.read(&mut buffer[..most])?;
        self.left -= count as u64;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_quota_is_found_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let quotas = Quotas::new(folder.path(), 0);
        let quota = Quota { reception: 100, receptions: 3, bytes: 250 };
        quotas.set(BTreeMap::from([("lathe".to_owned(), quota)]));
        let today = |receptions, bytes| Today { receptions, bytes, ..Today::default() };
        assert_eq!(quotas.begin("lathe", today(2, 0)), Ok(()));
        assert_eq!(quotas.begin("lathe", today(3, 0)), Err(OverQuota::Receptions { most: 3 }));
        assert_eq!(quotas.begin("lathe", today(2, 250)), Err(OverQuota::Bytes { most: 250 }));
        assert_eq!(quotas.begin("mill", today(3, 0)), Ok(()));
        assert_eq!(quotas.room("lathe", today(1, 0), 10), Ok(90));
        assert_eq!(quotas.room("lathe", today(1, 200), 10), Ok(40));
        assert_eq!(quotas.room("lathe", today(1, 0), 100), Err(OverQuota::Reception { most: 100 }));
        assert_eq!(quotas.room("lathe", today(1, 240), 10), Err(OverQuota::Bytes { most: 250 }));
    }

    #[test]
    fn what_is_kept_free_is_not_touched() {
        let folder = tempfile::tempdir().unwrap();
        let full = Quotas::new(folder.path(), u64::MAX);
        let over = full.free().unwrap_err();
        assert!(over.to_string().ends_with("; make room on the disk"), "{over}");
        assert!(full.begin("lathe", Today::default()).is_err());
        let mut buffer = Vec::new();
        let error = full.within(&mut &b"G1"[..]).read_to_end(&mut buffer).unwrap_err();
        assert_eq!((error.kind(), buffer.len()), (io::ErrorKind::StorageFull, 0));
        let roomy = Quotas::new(folder.path(), 0);
        roomy.within(&mut &b"G1"[..]).read_to_end(&mut buffer).unwrap();
        assert_eq!(buffer, b"G1");
    }
}
