//! `softplug completions`: what a shell needs to complete the command.

use clap::{Args, Command};
use clap_complete::Shell;

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

/// `whole`: the command with all its verbs.
pub(crate) fn run(arguments: &Arguments, mut whole: Command) -> Exit {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut whole, "softplug", &mut script);
    Screen::raw(&script);
    Exit::Done
}
