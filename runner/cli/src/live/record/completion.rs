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
