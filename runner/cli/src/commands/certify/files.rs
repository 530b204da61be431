//! The folder that reports are written into.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use softplug_conformance::certify::ObservedRun;
use softplug_report::{Report, badge, html, json, junit};

use crate::failure::Failure;
use crate::files::unwritable;

/// The report itself: its presence says that the folder is one of ours.
pub(crate) const REPORT: &str = "conformance.json";
/// The signed statement beside it.
pub(crate) const ATTESTATION: &str = "attestation.json";
const JUNIT: &str = "junit.xml";
const PAGE: &str = "report.html";
const BADGE: &str = "badge.json";
/// Observed courses of failed runs.
const FAILURES: &str = "failures";

/// A folder of reports.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Makes it if it is missing, and finds out whether it can be written to.
    pub(super) fn make(path: &Path) -> Result<Self, Failure> {
        fs::create_dir_all(path)
            .and_then(|()| tempfile::NamedTempFile::new_in(path).map(drop))
            .map_err(|error| unwritable(path, &error))?;
        Ok(Self { path: path.to_owned() })
    }

    /// Writes every form of the report.
    pub(super) fn write(
        &self,
        report: &Report,
        observed: &[ObservedRun],
        attestation: Option<&str>,
    ) -> Result<(), Failure> {
        self.put(JUNIT, &junit::write(report))?;
        self.put(PAGE, &html::write(report))?;
        self.put(BADGE, &badge::write(report))?;
        for run in observed {
            self.put(&failure_file(&run.run), &run.text)?;
        }
        if let Some(attestation) = attestation {
            self.put(ATTESTATION, attestation)?;
        }
        // The last one: where it is, the others are.
        self.put(REPORT, &json::write(report))
    }

    /// A file in it, as it is shown.
    pub(super) fn file(&self, name: &str) -> String {
        self.path.join(name).display().to_string()
    }

    /// Takes away what an earlier run left: whatever happens now, it would speak of another
    /// result.
    pub(super) fn clear(&self) -> Result<(), Failure> {
        if !self.path.join(REPORT).is_file() {
            return Ok(());
        }
        for name in [BADGE, ATTESTATION, JUNIT, PAGE, REPORT] {
            let path = self.path.join(name);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    return Err(unwritable(&path, &error));
                }
                _ => {}
            }
        }
        let failures = self.path.join(FAILURES);
        let Ok(entries) = fs::read_dir(&failures) else { return Ok(()) };
        for path in entries.flatten().map(|entry| entry.path()) {
            if path.extension().is_some_and(|extension| extension == "spt") {
                fs::remove_file(&path).map_err(|error| unwritable(&path, &error))?;
            }
        }
        Ok(())
    }

    /// A reader sees the old file or the new one, never a part.
    fn put(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.path.join(name);
        let written = (|| {
            let folder = path.parent().unwrap_or(&self.path);
            fs::create_dir_all(folder)?;
            let mut file = tempfile::NamedTempFile::new_in(folder)?;
            file.write_all(text.as_bytes())?;
            readable(file.as_file())?;
            file.persist(&path).map_err(|error| error.error)
        })();
        written.map(drop).map_err(|error| unwritable(&path, &error))
    }
}

/// Reports are for everyone, other than temporary files.
fn readable(file: &fs::File) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    let _ = file;
    Ok(())
}

/// `failures/xon-xoff.tx.hold,cut:1.spt`, without characters that some systems refuse in names.
pub(super) fn failure_file(run: &str) -> String {
    let name: String = run
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || ".-_".contains(c) { c } else { '-' })
        .collect();
    format!("{FAILURES}/{name}.spt")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_failures_stay_in_their_folder() {
        assert_eq!(failure_file("a.b/cut:1"), "failures/a.b-cut-1.spt");
        assert_eq!(failure_file("../../etc/x"), "failures/..-..-etc-x.spt");
    }
}
