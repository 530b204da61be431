//! A folder with programs that machines may ask for by name.

use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// Ends that a program's file may have beyond the name asked for, the most
/// likely first.
const EXTENSIONS: [&str; 12] =
    ["nc", "txt", "cnc", "tap", "min", "mpf", "eia", "iso", "din", "prg", "ptp", "ncp"];

/// Files that are opened for their text at one request.
const OPENED: usize = 2_000;

/// Finds programs by the names that machines ask for.
///
/// A name is compared with the names of the files in the folder, and never joined to a path: no
/// name leads out of it.
#[derive(Clone, Debug)]
pub struct Shelf {
    folder: PathBuf,
}

impl Shelf {
    /// Programs are taken from `folder`, which must be there.
    ///
    /// # Errors
    /// It is no folder.
    pub fn new(folder: &Path) -> io::Result<Self> {
        let folder = folder.canonicalize()?;
        if !fs::metadata(&folder)?.is_dir() {
            return Err(io::ErrorKind::NotADirectory.into());
        }
        Ok(Self { folder })
    }

    /// The file of this name: exactly, or with one of the usual extensions in upper or lower
    /// case. A name of digits alone finds `O1234` too, as controls call their programs.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn find(&self, name: &str) -> io::Result<Option<PathBuf>> {
        let mut best: Option<(usize, PathBuf)> = None;
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let file_name = entry.file_name();
            let Some(rank) = file_name.to_str().and_then(|file| rank(name, file)) else {
                continue;
            };
            let is_better = best.as_ref().is_none_or(|(than, _)| rank < *than);
            if is_better && self.is_program(&entry.path()) {
                best = Some((rank, entry.path()));
            }
        }
        Ok(best.map(|(_, path)| path))
    }

    /// Files whose beginning is such as `is_it` wants, by name: at most two, as more than one says
    /// enough. No more than 2,000 files are opened, those that come first by name.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn find_by_text(
        &self,
        head: usize,
        is_it: &mut dyn FnMut(&[u8]) -> bool,
    ) -> io::Result<Vec<PathBuf>> {
        let entries = fs::read_dir(&self.folder)?;
        let names = entries.map(|entry| Ok(entry?.file_name()));
        let mut names = names.collect::<io::Result<Vec<_>>>()?;
        names.retain(|name| name.to_str().is_some_and(|name| !name.starts_with('.')));
        names.sort_unstable();
        let (mut found, mut bytes) = (Vec::new(), Vec::new());
        for path in names.into_iter().take(OPENED).map(|name| self.folder.join(name)) {
            if !self.is_program(&path) {
                continue;
            }
            let Ok(file) = fs::File::open(&path) else { continue };
            bytes.clear();
            let is_read = file.take(head as u64).read_to_end(&mut bytes).is_ok();
            if is_read && is_it(&bytes) {
                found.push(path);
            }
            if found.len() == 2 {
                break;
            }
        }
        Ok(found)
    }

    /// A file with something in it; a link only if it stays in the folder.
    fn is_program(&self, path: &Path) -> bool {
        let Ok(real) = path.canonicalize() else { return false };
        real.parent() == Some(&self.folder)
            && fs::metadata(&real).is_ok_and(|metadata| metadata.is_file() && metadata.len() > 0)
    }
}

/// How well a file fits what was asked for: 0 is best.
fn rank(asked: &str, file: &str) -> Option<usize> {
    if asked.is_empty() || file.starts_with('.') {
        return None;
    }
    let is_number = asked.len() <= 8 && asked.bytes().all(|byte| byte.is_ascii_digit());
    let spoken = [
        Some(asked.to_owned()),
        is_number.then(|| format!("O{asked}")),
        is_number.then(|| format!("O{:0>4}", asked.trim_start_matches('0'))),
    ];
    for (place, name) in spoken.into_iter().flatten().enumerate() {
        let rest = file.strip_prefix(&name);
        let end = match rest {
            None => continue,
            Some("") => Some(0),
            Some(rest) => rest.strip_prefix('.').and_then(|rest| {
                EXTENSIONS.iter().position(|end| end.eq_ignore_ascii_case(rest)).map(|at| at + 1)
            }),
        };
        if let Some(end) = end {
            return Some(place * (EXTENSIONS.len() + 1) + end);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shelf(files: &[&str]) -> (tempfile::TempDir, Shelf) {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            fs::write(folder.path().join(file), "%\nM30\n%\n").unwrap();
        }
        let shelf = Shelf::new(folder.path()).unwrap();
        (folder, shelf)
    }

    fn found(shelf: &Shelf, name: &str) -> Option<String> {
        let path = shelf.find(name).unwrap()?;
        Some(path.file_name().unwrap().to_str().unwrap().to_owned())
    }

    #[test]
    fn a_program_is_found_by_its_name_the_exact_one_first() {
        let (_folder, shelf) = shelf(&["O1234", "O1234.nc", "PART.TXT", "PART.nc", "O0007.nc"]);
        assert_eq!(found(&shelf, "O1234").as_deref(), Some("O1234"));
        assert_eq!(found(&shelf, "1234").as_deref(), Some("O1234"));
        assert_eq!(found(&shelf, "7").as_deref(), Some("O0007.nc"));
        assert_eq!(found(&shelf, "PART").as_deref(), Some("PART.nc"));
        assert_eq!(found(&shelf, "PART.TXT").as_deref(), Some("PART.TXT"));
        for name in ["part", "O123", "PART.doc", "", "O1234.", "99999999999999999999"] {
            assert_eq!(found(&shelf, name), None, "{name:?}");
        }
    }

    #[test]
    fn a_program_is_found_by_its_text_and_two_are_enough_to_know_better() {
        let (folder, shelf) = shelf(&["a.nc", "b.nc", "c.nc", "d.nc"]);
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("b.nc", "O12\n");
        write("empty.nc", "");
        write(".hidden", "O12\n");
        fs::create_dir(folder.path().join("sub")).unwrap();
        let find = |text: &[u8]| {
            let found = shelf.find_by_text(4, &mut |head| head == text).unwrap();
            let names = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap());
            names.map(ToOwned::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(find(b"O12\n"), ["b.nc"]);
        assert_eq!(find(b"%\nM3"), ["a.nc", "c.nc"]);
        assert_eq!(find(b"O13\n"), [""; 0]);
    }

    #[test]
    fn no_name_leads_out_of_the_folder() {
        let (folder, _) = shelf(&["secret.nc"]);
        let inside = folder.path().join("programs");
        fs::create_dir_all(inside.join("sub")).unwrap();
        fs::write(inside.join("sub/O1"), "x").unwrap();
        fs::write(inside.join(".hidden"), "x").unwrap();
        fs::write(inside.join("empty"), "").unwrap();
        let shelf = Shelf::new(&inside).unwrap();
        let absolute = folder.path().join("secret.nc");
        for name in [
            "../secret",
            "../secret.nc",
            "..",
            ".",
            "sub/O1",
            "sub\\O1",
            "sub",
            ".hidden",
            "empty",
            "*",
            "O1\0",
            absolute.to_str().unwrap(),
        ] {
            assert_eq!(found(&shelf, name), None, "{name:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_no_programs() {
        let (folder, _) = shelf(&["secret.nc"]);
        let inside = folder.path().join("programs");
        fs::create_dir(&inside).unwrap();
        fs::write(inside.join("O1.nc"), "x").unwrap();
        std::os::unix::fs::symlink("O1.nc", inside.join("O2.nc")).unwrap();
        std::os::unix::fs::symlink("../secret.nc", inside.join("O3.nc")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", inside.join("O4.nc")).unwrap();
        let shelf = Shelf::new(&inside).unwrap();
        assert_eq!(found(&shelf, "O2").as_deref(), Some("O2.nc"));
        assert_eq!(found(&shelf, "O3"), None);
        assert_eq!(found(&shelf, "O4"), None);
    }
}
