//! Settings of a link's plug-in: as they come, and as they are kept over a start.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use softplug_unit_protocol::KEPT_SETTINGS;
use thiserror::Error;

use super::Link;

/// Name and value, as people write them.
pub(super) type Settings = BTreeMap<String, String>;

/// The largest file of settings that is read, in bytes: they came in one message.
const LARGEST: u64 = 64 << 10;

/// Settings, and whose they are.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Given {
    pub(super) settings: Settings,
    /// They are those of `unit.toml`, which hold until a server sends others.
    pub(super) is_own: bool,
}

/// Settings that cannot be kept.
#[derive(Debug, Error)]
#[error("its settings cannot be kept in {}: {source}", file.display())]
pub(super) struct NotKept {
    file: PathBuf,
    source: io::Error,
}

impl Link {
    /// Those that hold: what a server has set last, else what `unit.toml` says.
    pub(super) fn settings(&self) -> Given {
        match self.kept_settings() {
            Some(settings) => Given { settings, is_own: false },
            None => Given { settings: self.config.settings.clone(), is_own: true },
        }
    }

    /// Those that a message has; `None` if it has none.
    pub(super) fn settings_of(&self, bytes: &[u8]) -> Option<Given> {
        if bytes == KEPT_SETTINGS {
            return Some(self.settings());
        }
        pairs(bytes).map(|settings| Given { settings, is_own: false })
    }

    fn kept_settings(&self) -> Option<Settings> {
        let file = self.config.state.display();
        let bytes = match read(&self.config.state) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => return None,
            Err(error) => {
                tracing::warn!(%error, "{file} cannot be read; settings of unit.toml are taken");
                return None;
            }
        };
        let settings = pairs(&bytes);
        if settings.is_none() {
            tracing::warn!("{file} does not hold settings; those of unit.toml are taken");
        }
        settings
    }

    /// What a server has set holds after the next start, too.
    pub(super) fn keep_settings(&self, given: &Given) -> Result<(), NotKept> {
        // Not at every start: memories wear.
        let done = match (given.is_own, self.kept_settings()) {
            (true, None) => Ok(()),
            (true, Some(_)) => fs::remove_file(&self.config.state),
            (false, Some(kept)) if kept == given.settings => Ok(()),
            (false, _) => replace(&self.config.state, &written(&given.settings)),
        };
        done.map_err(|source| NotKept { file: self.config.state.clone(), source })
    }
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(LARGEST).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Writes a file in one step.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

fn written(settings: &Settings) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in settings.iter().flat_map(|(name, value)| [name, value]) {
        bytes.extend_from_slice(text.as_bytes());
        bytes.push(0);
    }
    bytes
}

/// Pairs of texts, each ended by a byte 00.
fn pairs(bytes: &[u8]) -> Option<Settings> {
    let text = std::str::from_utf8(bytes).ok()?;
    let mut settings = Settings::new();
    let mut rest = text;
    while !rest.is_empty() {
        let (name, after) = rest.split_once('\0')?;
        let (value, after) = after.split_once('\0')?;
        settings.insert(name.to_owned(), value.to_owned());
        rest = after;
    }
    Some(settings)
}
