//! What becomes of a record when it is all there: lines of characters at the line's rate are
//! joined, and with a plug-in it becomes a case where it can.

use std::path::{Path, PathBuf};

use softplug_trace::{HostRequest, Trace, limits};

use crate::commands::replay::judge_of;
use crate::failure::Failure;
use crate::files;
use crate::plugin::Chosen;
use crate::recorded::{Became, make};
use crate::screen::Screen;

/// The plug-in of the recorded side, and what it was asked for.
pub(super) struct Completion {
    pub(super) plugin: Option<Chosen>,
    pub(super) requests: Vec<HostRequest>,
}

impl Completion {
    /// Completes the files in place, each as a whole or not at all: whatever goes wrong here, the
    /// record stays as it was written.
    pub(super) fn complete(&self, files: &[PathBuf], screen: &Screen) -> Option<Became> {
        let mut became = None;
        for file in files {
            match self.complete_one(file, files.len() == 1) {
                Ok(one) => became = one,
                Err(failure) => screen.note(format_args!(
                    "note: {} stays as it was recorded: {}",
                    file.display(),
                    failure.message
                )),
            }
        }
        let is_known = self.plugin.is_some();
        if is_known && files.len() > 1 {
            let sentence = format!("it is in {} parts", files.len());
            became = Some(Became { is_case: false, sentence });
        }
        became
    }

    fn complete_one(&self, file: &Path, is_whole: bool) -> Result<Option<Became>, Failure> {
        let record = Trace::parse(&files::read_text(file)?).map_err(Failure::usage)?;
        let (trace, became) = match &self.plugin {
            Some(plugin) if is_whole => {
                let judge = judge_of(plugin);
                let (trace, became) = make(judge.as_ref(), file, record, &self.requests);
                (trace, Some(became))
            }
            _ => (record.at_line_rate(), None),
        };
        let text = trace.format();
        if text.len() > limits::FILE_BYTES {
            return Err(Failure::usage("with what the plug-in does it is too long for a trace"));
        }
        files::replace(file, text.as_bytes())?;
        Ok(became)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const HEAD: &str = "id: a.b\ntitle: T\nprofile: a\nclauses: a.c\nlevel: may\n\
                        line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n---\n";

    #[test]
    fn what_cannot_be_completed_stays_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.spt");
        let completion = Completion { plugin: None, requests: Vec::new() };
        assert!(completion.complete_one(&file, true).is_err());
        for text in
            ["", "no trace", &format!("{HEAD}< 0.0 4"), &format!("{HEAD}> 1.0 41\n> 0.0 42\n")]
        {
            fs::write(&file, text).unwrap();
            assert!(completion.complete_one(&file, true).is_err());
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
        }
    }

    #[test]
    fn without_a_plug_in_characters_are_joined() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("s.spt");
        let completion = Completion { plugin: None, requests: Vec::new() };
        fs::write(&file, format!("{HEAD}< 0.000000 02\n< 0.001050 41\n. 1.000000\n")).unwrap();
        assert!(completion.complete_one(&file, true).unwrap().is_none());
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains("<< 0.000000 02 41 "), "{text}");
    }
}
