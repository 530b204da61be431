//! The corpus that verbs work with: the one in the command, or a folder.

use std::path::PathBuf;

use clap::Args;
use softplug_conformance::Corpus;

use crate::failure::Failure;

/// Which corpus.
#[derive(Debug, Args)]
pub(crate) struct Source {
    /// Folder with requirements, traces and mutants, instead of the corpus in this command
    #[arg(long, value_name = "DIR")]
    corpus: Option<PathBuf>,
}

impl Source {
    pub(crate) fn load(&self) -> Result<Corpus, Failure> {
        match &self.corpus {
            Some(folder) => Corpus::read(folder).map_err(Failure::usage),
            None => Ok(Corpus::embedded()),
        }
    }
}
