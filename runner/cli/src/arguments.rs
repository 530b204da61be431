//! The command line.

use std::ffi::OsString;

use clap::error::ErrorKind;
use clap::{ColorChoice, CommandFactory, FromArgMatches, Parser};

use crate::commands::Command;
use crate::exit::{self, Exit};
use crate::failure::Failure;
use crate::global::Global;
use crate::screen::Screen;

/// Help is as wide as this at most.
const WIDTH: usize = 100;

/// Transfers programs over serial lines through sandboxed protocol plug-ins.
#[derive(Debug, Parser)]
#[command(
    name = "softplug",
    version,
    max_term_width = WIDTH,
    disable_help_subcommand = true,
    after_help = exit::table()
)]
pub(crate) struct CommandLine {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What the command line asks for.
pub(crate) enum Start {
    Run(Box<CommandLine>),
    /// Help, the version or a usage error was printed.
    End(Exit),
}

/// Reads the process's arguments.
pub(crate) fn read() -> Start {
    let words: Vec<OsString> = std::env::args_os().collect();
    let command = CommandLine::command().color(color(&words));
    let parsed = command
        .try_get_matches_from(&words)
        .and_then(|matches| CommandLine::from_arg_matches(&matches));
    match parsed {
        Ok(command_line) => Start::Run(Box::new(command_line)),
        Err(error) => Start::End(end(&error, &words)),
    }
}

fn end(error: &clap::Error, words: &[OsString]) -> Exit {
    let exit = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => Exit::Done,
        _ => Exit::Usage,
    };
    if exit == Exit::Usage && before_dashes(words).any(|word| word == "--json") {
        let json = in_json(&error.render().to_string()) + "\n";
        Screen::early(json, false, anstream::ColorChoice::Never);
        return exit;
    }
    let colours = match color(words) {
        ColorChoice::Always => anstream::ColorChoice::Always,
        ColorChoice::Never => anstream::ColorChoice::Never,
        ColorChoice::Auto => anstream::ColorChoice::Auto,
    };
    Screen::early(error.render().ansi(), error.use_stderr(), colours);
    exit
}

/// The text's first paragraph is the error, a tip the hint.
fn in_json(text: &str) -> String {
    let first = text.split("\n\n").next().unwrap_or_default();
    let words: Vec<_> = first.split_whitespace().collect();
    let message = words.join(" ");
    let failure = Failure::usage(message.strip_prefix("error: ").unwrap_or(&message));
    match text.lines().find_map(|line| line.trim_start().strip_prefix("tip: ")) {
        Some(tip) => failure.hint(tip).json(),
        None => failure.json(),
    }
}

/// Usage errors are printed before the command line is known as a whole, so
/// what concerns printing is looked for by hand.
fn color(words: &[OsString]) -> ColorChoice {
    let mut words = before_dashes(words);
    while let Some(word) = words.next() {
        let value = match word.to_str() {
            Some("--color") => words.next().and_then(|value| value.to_str()),
            Some(word) => word.strip_prefix("--color="),
            None => None,
        };
        match value {
            Some("always") => return ColorChoice::Always,
            Some("never") => return ColorChoice::Never,
            _ => {}
        }
    }
    ColorChoice::Auto
}

fn before_dashes(words: &[OsString]) -> impl Iterator<Item = &OsString> {
    words.iter().skip(1).take_while(|word| *word != "--")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn usage_errors_are_one_sentence_for_machines() {
        let text = "error: these were not provided:\n  --port <PORT>\n  <FILE>\n\nUsage: x\n";
        assert_eq!(
            in_json(text),
            r#"{"error":{"code":2,"message":"these were not provided: --port <PORT> <FILE>"}}"#
        );
        let text = "error: unknown 'a'\n\n  tip: say 'b'\n\nUsage: x\n";
        assert_eq!(
            in_json(text),
            r#"{"error":{"code":2,"message":"unknown 'a'","hint":"say 'b'"}}"#
        );
    }

    #[test]
    fn colours_are_known_before_the_rest() {
        let words = |text: &str| text.split(' ').map(OsString::from).collect::<Vec<_>>();
        assert_eq!(color(&words("softplug send --color never")), ColorChoice::Never);
        assert_eq!(color(&words("softplug --color=always x")), ColorChoice::Always);
        assert_eq!(color(&words("softplug -- --color=always")), ColorChoice::Auto);
        assert_eq!(color(&words("softplug ports")), ColorChoice::Auto);
    }
}
