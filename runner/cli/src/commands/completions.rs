//! `softplug completions`: what a shell needs to complete the command.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::arguments::CommandLine;
use crate::exit::Exit;
use crate::screen::Screen;

/// Prints completions for a shell.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug completions bash > ~/.local/share/bash-completion/completions/softplug
  softplug completions zsh > ~/.zfunc/_softplug
  softplug completions fish > ~/.config/fish/completions/softplug.fish")]
pub(crate) struct Arguments {
    /// The shell
    shell: Shell,
}

pub(crate) fn run(arguments: &Arguments) -> Exit {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut CommandLine::command(), "softplug", &mut script);
    Screen::raw(&script);
    Exit::Done
}
