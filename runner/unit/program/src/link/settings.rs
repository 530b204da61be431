//! Settings of a link's plug-in: as they come, and as they are kept over a start.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use super::Link;

/// Name and value, as people write them.
pub(super) type Settings = BTreeMap<String, String>;

impl Link {
    pub(super) fn kept_settings(&self) -> Option<Settings> {
        let bytes = fs::read(&self.config.state).ok()?;
        let settings = pairs(&bytes);
        if settings.is_none() {
            let file = self.config.state.display();
            tracing::warn!("{file} does not hold settings; those of unit.toml are taken");
        }
        settings
    }

    /// What a server has set holds after the next start, too.
    pub(super) fn keep_settings(&self, settings: &Settings) {
        // Not at every start: memories wear.
        if self.kept_settings().as_ref() == Some(settings) {
            return;
        }
        let mut bytes = Vec::new();
        for (name, value) in settings {
            for text in [name, value] {
                bytes.extend_from_slice(text.as_bytes());
                bytes.push(0);
            }
        }
        if let Err(error) = replace(&self.config.state, &bytes) {
            let file = self.config.state.display();
            tracing::error!(%error, "{file} cannot be written: after a start the settings are old");
        }
    }
}

/// Writes a file in one step.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// Pairs of texts, each ended by a byte 00.
pub(super) fn pairs(bytes: &[u8]) -> Option<Settings> {
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
