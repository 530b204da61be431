//! `--score`: how many changes of the module its profiles notice.

use std::str::FromStr;
use std::sync::atomic::AtomicBool;

use softplug_conformance::Corpus;
use softplug_conformance::score::{ScoreError, ScoreOptions, score};
use softplug_report::{Report, Score, VerdictKind};

use super::bar;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;

/// How many changes are tried.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Sample {
    Of(u32),
    All,
}

impl Sample {
    pub(super) fn count(self) -> Option<u32> {
        match self {
            Self::Of(count) => Some(count),
            Self::All => None,
        }
    }
}

impl FromStr for Sample {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(count) if count > 0 => Ok(Self::Of(count)),
            _ if text == "all" => Ok(Self::All),
            _ => Err(format!("\"{text}\" is no number of changes such as 300, and not `all`")),
        }
    }
}

/// The score of a plug-in that is conformant; no other can have one, and none is there where it
/// was ended.
pub(in crate::commands) fn scored(
    report: &Report,
    module: &[u8],
    corpus: &Corpus,
    options: &ScoreOptions,
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<Option<Score>, Failure> {
    match report.verdict {
        VerdictKind::Conformant | VerdictKind::ConformantWithWarnings => {}
        VerdictKind::NotConformant | VerdictKind::NotJudged | VerdictKind::Partial => {
            screen.note("there is no score: only a conformant plug-in can have one");
            return Ok(None);
        }
    }
    let bar = bar("changes", screen);
    let progress = |done: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let scored = score(module, corpus, options, &progress, stop);
    bar.finish_and_clear();
    match scored {
        Ok(score) => Ok(Some(score)),
        Err(error @ ScoreError::Stopped) => {
            screen.note(format_args!("there is no score: {error}"));
            Ok(None)
        }
        Err(error) => Err(Failure::new(Exit::PlugIn, error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_all_are_read() {
        assert_eq!("300".parse(), Ok(Sample::Of(300)));
        assert_eq!("all".parse(), Ok(Sample::All));
        for wrong in ["", "0", "-1", "ALL", "5%"] {
            assert!(wrong.parse::<Sample>().unwrap_err().contains("no number of changes"));
        }
    }
}
