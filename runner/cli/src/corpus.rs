//! The corpus that verbs work with: the one in the command, or a folder.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use clap::Args;
use softplug_conformance::{Corpus, CorpusError};

use crate::failure::Failure;
use crate::screen::Screen;

/// Where a project has the ledger of a profile.
pub(crate) const REQUIREMENTS: &str = "requirements";

/// Which corpus.
#[derive(Debug, Args)]
pub(crate) struct Source {
    /// Folder with requirements, traces and mutants, instead of the corpus in this command
    /// [default: the working folder, for a profile that only its requirements have]
    #[arg(long, value_name = "DIR")]
    corpus: Option<PathBuf>,
}

impl Source {
    /// The corpus that was named, else the one in the command; for what writes cases: there may be
    /// none yet.
    pub(crate) fn load_begun(&self) -> Result<Corpus, Failure> {
        self.read_by(Corpus::begun)
    }

    /// The folder that was named.
    pub(crate) fn named(&self) -> Option<Cow<'_, str>> {
        self.corpus.as_ref().map(|folder| folder.to_string_lossy())
    }

    /// The folder that was named, or the working folder if that is a corpus.
    pub(crate) fn own_folder(&self) -> Option<&Path> {
        let here = Path::new(".");
        self.corpus.as_deref().or_else(|| here.join(REQUIREMENTS).is_dir().then_some(here))
    }

    /// The corpus that was named, else the one in the command, or that of the working folder if
    /// only it has the profile.
    pub(crate) fn load_for(&self, profile: &str, screen: &Screen) -> Result<Corpus, Failure> {
        self.read_for(profile, screen, Corpus::read)
    }

    /// As [`load_for`](Self::load_for), for what writes cases: there may be none yet.
    pub(crate) fn load_begun_for(&self, profile: &str, screen: &Screen) -> Result<Corpus, Failure> {
        self.read_for(profile, screen, Corpus::begun)
    }

    fn read_by(&self, read: Read) -> Result<Corpus, Failure> {
        match &self.corpus {
            Some(folder) => read(folder).map_err(Failure::usage),
            None => Ok(Corpus::embedded()),
        }
    }

    fn read_for(&self, profile: &str, screen: &Screen, read: Read) -> Result<Corpus, Failure> {
        let corpus = self.read_by(read)?;
        if self.corpus.is_some() || corpus.ledger(profile).is_some() || !is_here(profile) {
            return Ok(corpus);
        }
        screen.note("note: the corpus is this folder; --corpus names another one");
        read(Path::new(".")).map_err(Failure::usage)
    }
}

/// How a folder is read.
type Read = fn(&Path) -> Result<Corpus, CorpusError>;

/// Whether the working folder has a ledger of this profile.
fn is_here(profile: &str) -> bool {
    let is_name = profile.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    is_name && Path::new(REQUIREMENTS).join(format!("{profile}.toml")).is_file()
}
