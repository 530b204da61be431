//! `softplug record`: what passes between two partners, as a trace.

mod run;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use softplug_abi::LineParameters;
use softplug_abi::manifest::SettingValues;
use softplug_live::PortSpec;
use softplug_trace::is_slug;

use crate::assignment::Assignment;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Partial;
use crate::line::{AskedLine, ChosenLine, USUAL_LINE, port};
use crate::plugin::{Chosen, Library};
use crate::recorded::Requests;
use crate::screen::Screen;

/// Sits between two partners, passes everything on and records what passes.
///
/// Connect the existing software to one port and the machine to the other. Bytes pass both ways at
/// once and unaltered, modem lines cross as in a null-modem cable, and breaks and line errors pass
/// as far as the ports can make them. The record is a trace as one side saw it: --as a takes the
/// partner on port a for the plug-in's place.
///
/// It goes on until Ctrl-C, --duration or --idle; what was read by then is passed on and written.
/// The trace is written to FILE.partial, which gets its name at the end; a port that is unplugged
/// ends the recording, and the trace stays. What is longer than a trace may be goes on in FILE-2.
///
/// With --plugin the record becomes a case where the plug-in sends what was recorded: settings,
/// requests (--send, --ask) and what it does then stand in it. Else it says where it does not.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug record --a pty: --b /dev/ttyUSB0 --line \"4800 7E2\" --out session.spt
  softplug record --a /dev/ttyUSB0 --b tcp://10.0.0.7:4001 --redact --idle 60 --out session.spt
  softplug record --a /dev/ttyUSB0 --b /dev/ttyUSB1 --plugin r3964 --set priority=low \\
      --id r3964.rx.press-line --out r3964.rx.press-line.spt
  softplug record --a pty: --b /dev/ttyUSB0 --plugin r3964 --send telegram.bin --out session.spt
  softplug record --a pty: --b /dev/ttyUSB0 --plugin r3964 --set layer=rk512 \\
      --ask \"job 1 read area=DB block=5 offset=10 count=7\" --out session.spt")]
pub(crate) struct Arguments {
    /// The port to one partner: /dev/ttyUSB0, tcp://HOST:PORT, rfc2217://HOST:PORT or pty:
    #[arg(long, value_name = "PORT", value_parser = port)]
    pub(crate) a: PortSpec,
    /// The port to the other partner
    #[arg(long, value_name = "PORT", value_parser = port)]
    pub(crate) b: PortSpec,
    /// The line: baud rate and form of a character, such as "4800 7E2" [default: the plug-in's, or
    /// 9600 8N1; between two ptys, the rate that a program sets there]
    #[arg(long, value_name = "LINE")]
    pub(crate) line: Option<AskedLine>,
    /// The trace to write
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Overwrite FILE; what a killed recording left is kept as FILE.failed
    #[arg(long, short)]
    pub(crate) force: bool,
    /// The partner in the plug-in's place: what reaches it is "<", what it sends is ">"
    #[arg(long = "as", value_enum, default_value_t, value_name = "SIDE")]
    pub(crate) side: SideName,
    /// The plug-in of that place, or one that might take it: a .wasm file, a name, or native:NAME.
    /// The trace says what it would have done
    #[arg(long, short = 'x', value_name = "PLUGIN")]
    pub(crate) plugin: Option<String>,
    #[command(flatten)]
    pub(crate) library: Library,
    /// A setting of the plug-in; preset=NAME takes a preset; may be repeated
    #[arg(long = "set", short = 's', value_name = "NAME=VALUE", requires = "plugin")]
    pub(crate) settings: Vec<Assignment>,
    #[command(flatten)]
    pub(crate) requests: Requests,
    /// Write other letters and digits than those that passed; lengths, controls and parity stay
    #[arg(long, conflicts_with_all = ["send", "ask"])]
    pub(crate) redact: bool,
    /// The trace's id [default: from the plug-in's profile and FILE]
    #[arg(long, value_name = "ID", value_parser = id)]
    pub(crate) id: Option<String>,
    /// The trace's title
    #[arg(long, value_name = "TEXT", value_parser = title)]
    pub(crate) title: Option<String>,
    /// What the partner on the other side is [default: its port]
    #[arg(long, value_name = "TEXT", value_parser = device)]
    pub(crate) device: Option<String>,
    /// End after so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=604_800))]
    pub(crate) duration: Option<u32>,
    /// End when nothing has passed for so many seconds, once something has
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=604_800))]
    pub(crate) idle: Option<u32>,
}

/// A side as it is asked for.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
pub(crate) enum SideName {
    #[default]
    A,
    B,
}

/// The plug-in to compare with.
pub(crate) struct Prepared {
    pub(crate) plugin: Chosen,
    pub(crate) settings: SettingValues,
}

impl Arguments {
    /// The line that the ports are set to: as asked for, else the plug-in's, else the usual one.
    pub(crate) fn line(&self, prepared: Option<&Prepared>) -> LineParameters {
        let asked = self.line.as_ref();
        match prepared {
            Some(Prepared { plugin, settings }) => {
                ChosenLine::of(asked, plugin.manifest(), &self.settings, settings).line
            }
            None => asked.map_or(USUAL_LINE, |asked| asked.or(USUAL_LINE)),
        }
    }
}

/// What machines get.
#[derive(Serialize)]
pub(crate) struct Document<'a> {
    /// Why it ended: stopped, duration, idle or port-lost.
    pub(crate) result: &'a str,
    pub(crate) seconds: f64,
    pub(crate) a_to_b: u64,
    pub(crate) b_to_a: u64,
    /// Characters that came damaged, breaks and overruns.
    pub(crate) line_errors: u64,
    /// Bytes that were read and could not be passed on.
    pub(crate) not_passed: usize,
    pub(crate) files: Vec<String>,
    /// Whether the record is a case of the plug-in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) case: Option<bool>,
    /// Why it is one, or where it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) standing: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) message: Option<String>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    if arguments.a == arguments.b && arguments.a != PortSpec::Pty {
        return Err(Failure::usage("both sides name the same port")
            .hint("give the port to one partner with --a and the port to the other with --b"));
    }
    let prepared = arguments.plugin.as_ref().map(|name| {
        let plugin = arguments.library.load(name)?;
        let settings = plugin.settings(&arguments.settings)?;
        Ok::<_, Failure>(Prepared { plugin, settings })
    });
    let prepared = prepared.transpose()?;
    Partial::check(&arguments.out, arguments.force)?;
    let requests = arguments.requests.of(&arguments.out)?;
    run::record(arguments, prepared, requests, screen)
}

fn id(text: &str) -> Result<String, String> {
    if is_slug(text) && text.contains('.') {
        return Ok(text.to_owned());
    }
    Err("an id is lower-case letters, digits and inner hyphens in parts joined by dots, such as \
         xon-xoff.tx.my-lathe"
        .to_owned())
}

fn title(text: &str) -> Result<String, String> {
    let is_plain = !text.trim().is_empty() && !text.chars().any(char::is_control);
    // What recording adds has to fit as well.
    if is_plain && text.chars().count() <= 90 {
        return Ok(text.trim().to_owned());
    }
    Err("a title is one line of at most 90 characters".to_owned())
}

fn device(text: &str) -> Result<String, String> {
    let is_plain = |c: char| !c.is_control() && !matches!(c, ',' | '(' | ')');
    if !text.trim().is_empty() && text.len() <= 100 && text.chars().all(is_plain) {
        return Ok(text.trim().to_owned());
    }
    Err("a device is named in at most 100 bytes, without commas and parentheses".to_owned())
}
