//! Whether a plug-in has been made of what is there now: making it smaller takes seconds.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use softplug_build::Optimizer;

/// What a plug-in was made of, written down beside the compiler's module.
pub(super) struct Made {
    note: PathBuf,
    /// What is compared, but for the plug-in itself.
    sources: String,
    out: PathBuf,
}

impl Made {
    /// Of the compiler's module, by this program and the optimiser, into `out`.
    pub(super) fn of(built: &Path, out: &Path, optimizer: Option<&Optimizer>) -> io::Result<Self> {
        let program = time(&std::env::current_exe()?)?;
        let sources = format!("{} {program} {optimizer:?}", time(built)?);
        Ok(Self { note: built.with_extension("made"), sources, out: out.to_owned() })
    }

    /// Whether it was, and nobody has changed it since.
    pub(super) fn is_current(&self) -> bool {
        let now = self.text();
        now.is_ok_and(|now| fs::read_to_string(&self.note).is_ok_and(|note| note == now))
    }

    /// It is now.
    pub(super) fn note(&self) -> io::Result<()> {
        fs::write(&self.note, self.text()?)
    }

    fn text(&self) -> io::Result<String> {
        Ok(format!("{} {}", self.sources, time(&self.out)?))
    }
}

/// When a file was changed, in nanoseconds, and its length.
fn time(file: &Path) -> io::Result<String> {
    let metadata = fs::metadata(file)?;
    let since = metadata.modified()?.duration_since(UNIX_EPOCH).map_err(io::Error::other)?;
    Ok(format!("{}/{}", since.as_nanos(), metadata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, SystemTime};

    #[test]
    fn what_was_changed_on_either_side_is_made_anew() {
        let folder = std::env::temp_dir().join(format!("softplug-made-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (built, out) = (folder.join("a.wasm"), folder.join("b.wasm"));
        fs::write(&built, "built").unwrap();
        let made = || Made::of(&built, &out, None).unwrap();
        assert!(!made().is_current(), "it is not there");
        fs::write(&out, "out").unwrap();
        assert!(!made().is_current(), "nobody has said what it was made of");
        made().note().unwrap();
        assert!(made().is_current());
        let later = SystemTime::now() + Duration::from_secs(5);
        for file in [&built, &out] {
            let changed = fs::OpenOptions::new().write(true).open(file).unwrap();
            changed.set_modified(later).unwrap();
            assert!(!made().is_current(), "{} was changed", file.display());
            made().note().unwrap();
            assert!(made().is_current());
        }
        fs::remove_dir_all(&folder).unwrap();
    }
}
