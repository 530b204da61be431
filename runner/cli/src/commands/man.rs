//! `softplug man`: the manual pages.

use std::fs;
use std::path::PathBuf;

use clap::{Args, Command};

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::unwritable;
use crate::screen::Screen;

/// Prints the manual page, or writes a page for every verb.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug man | man -l -
  softplug man --out ~/.local/share/man/man1")]
pub(crate) struct Arguments {
    /// Folder for softplug.1, softplug-send.1 and so on; made if it is missing
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// `whole`: the command with all its verbs.
pub(crate) fn run(arguments: &Arguments, whole: Command) -> Result<Exit, Failure> {
    if let Some(folder) = &arguments.out {
        fs::create_dir_all(folder)
            .and_then(|()| clap_mangen::generate_to(whole, folder))
            .map_err(|error| unwritable(folder, &error))?;
        return Ok(Exit::Done);
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(whole)
        .render(&mut page)
        .map_err(|error| Failure::internal(format_args!("failed to make the page: {error}")))?;
    Screen::raw(&page);
    Ok(Exit::Done)
}
