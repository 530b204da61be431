//! Which modules links use, so that garbage collection leaves them, whoever asks for it.

use std::fmt::Write as _;
use std::path::PathBuf;

use softplug_host::Digest;
use softplug_live::store::safe_name;

use super::{Library, LibraryError};
use crate::disk;

const MOST_BYTES: usize = 1_024;

/// The modules that a link needs.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Use {
    /// The one that it runs.
    pub running: Option<Digest>,
    /// The last one that ran well, to go back to.
    pub last_good: Option<Digest>,
}

impl Use {
    pub(super) fn has(&self, digest: Digest) -> bool {
        self.running == Some(digest) || self.last_good == Some(digest)
    }
}

impl Library {
    /// Notes what a link uses. Nothing at all: the link is gone.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn note_use(&self, link: &str, used: Use) -> Result<(), LibraryError> {
        let Some(path) = self.use_path(link) else { return Ok(()) };
        if used == Use::default() {
            return match disk::remove(&path) {
                Err(error) if error.is_missing() => Ok(()),
                removed => Ok(removed?),
            };
        }
        let mut text = String::new();
        for (key, digest) in [("running", used.running), ("last-good", used.last_good)] {
            if let Some(digest) = digest {
                let _ = writeln!(text, "{key} {digest}");
            }
        }
        Ok(disk::write_whole(&path, text.as_bytes())?)
    }

    /// What a link uses, as far as it was noted.
    pub fn use_of(&self, link: &str) -> Use {
        let text = self.use_path(link).and_then(|path| disk::read_small(&path, MOST_BYTES).ok());
        let text = text.and_then(|text| String::from_utf8(text).ok()).unwrap_or_default();
        let digest = |key: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(key))?;
            line.trim().parse().ok()
        };
        Use { running: digest("running "), last_good: digest("last-good ") }
    }

    pub(super) fn uses(&self) -> Result<Vec<(String, Use)>, LibraryError> {
        let links = disk::names_in(&self.folder.join("used"))?;
        let uses = links.into_iter().map(|link| {
            let used = self.use_of(&link);
            (link, used)
        });
        Ok(uses.collect())
    }

    /// A link's name is a plain one; another has no file.
    fn use_path(&self, link: &str) -> Option<PathBuf> {
        let is_plain = safe_name(link).is_some_and(|safe| safe == link);
        is_plain.then(|| self.folder.join("used").join(link))
    }
}
