//! Names: what a slug is, and where a trace's file belongs.

use std::path::{Path, PathBuf};

use crate::limits::NAME_BYTES;
use crate::model::FrontMatter;

/// Whether `name` is a slug: parts joined by dots, each of lower-case letters,
/// digits and single inner hyphens.
///
/// ```
/// assert!(softplug_trace::is_slug("xon-xoff.tx.hold"));
/// assert!(!softplug_trace::is_slug("xon--xoff"));
/// assert!(!softplug_trace::is_slug("Hold."));
/// ```
pub fn is_slug(name: &str) -> bool {
    let word = |word: &str| {
        !word.is_empty()
            && word.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit())
    };
    name.len() <= NAME_BYTES && name.split('.').all(|part| part.split('-').all(word))
}

/// The file of a trace is not where its id says.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{path} holds the case \"{id}\"; name the file {expected} or change the id", path = path.display(), expected = expected.display())]
pub struct FileNameError {
    /// Where the file is.
    pub path: PathBuf,
    /// The id in it.
    pub id: String,
    /// How its path should end.
    pub expected: PathBuf,
}

impl FrontMatter {
    /// `PROFILE/ID.spt`.
    pub fn file_name(&self) -> PathBuf {
        Path::new(&self.profile).join(format!("{}.spt", self.id))
    }

    /// Checks that a path ends as the profile and the id say. Only the two last
    /// parts count, and a bare file name only has its last.
    ///
    /// # Errors
    /// The path is another one.
    pub fn check_path(&self, path: &Path) -> Result<(), FileNameError> {
        let expected = self.file_name();
        let bare = path.parent().is_none_or(|folder| folder.as_os_str().is_empty());
        if path.ends_with(&expected) || (bare && expected.file_name() == path.file_name()) {
            return Ok(());
        }
        Err(FileNameError { path: path.to_owned(), id: self.id.clone(), expected })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slugs() {
        for good in ["a", "xon-xoff.tx.hold", "r3964.tx.late-dle", "3964r", "a.1"] {
            assert!(is_slug(good), "{good}");
        }
        let long = "a".repeat(NAME_BYTES + 1);
        for bad in ["", ".", "a.", ".a", "a..b", "-a", "a-", "a--b", "A", "a_b", "a b", "ä", &long]
        {
            assert!(!is_slug(bad), "{bad}");
        }
    }

    #[test]
    fn files_stand_where_their_id_says() {
        let front = crate::Trace::parse(crate::tests::HOLD).unwrap().front;
        assert_eq!(front.file_name(), Path::new("xon-xoff/xon-xoff.tx.hold.spt"));
        for good in [
            "fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt",
            "xon-xoff/xon-xoff.tx.hold.spt",
            "xon-xoff.tx.hold.spt",
        ] {
            assert_eq!(front.check_path(Path::new(good)), Ok(()));
        }
        for bad in [
            "traces/r3964/xon-xoff.tx.hold.spt",
            "xon-xoff/hold.spt",
            "hold.spt",
            "xon-xoff.tx.hold.txt",
            "",
        ] {
            assert!(front.check_path(Path::new(bad)).is_err(), "{bad}");
        }
        let message = front.check_path(Path::new("a/b.spt")).unwrap_err().to_string();
        assert_eq!(
            message,
            "a/b.spt holds the case \"xon-xoff.tx.hold\"; \
             name the file xon-xoff/xon-xoff.tx.hold.spt or change the id"
        );
    }
}
