//! Options that describe a link: the line, the plug-in and its settings.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use softplug_abi::LineParameters;
use softplug_gateway::port::parse_line;
use softplug_gateway::{Flow, PortOptions, PortSpec};

use crate::plugin::Library;

/// How to speak on a line, apart from its port.
#[derive(Debug, Args)]
pub(crate) struct LinkArguments {
    /// The line: baud rate and form of a character, such as "4800 7E2"
    #[arg(long, value_name = "LINE", default_value = "9600 8N1", value_parser = line)]
    pub(crate) line: LineParameters,
    /// Who reacts to XON and XOFF: the plug-in (host) or the port's driver (device)
    #[arg(long, value_enum, default_value_t, value_name = "WHO")]
    pub(crate) flow: FlowBy,
    /// The plug-in: a .wasm file, a name to look up, or native:NAME
    #[arg(long, short = 'x', value_name = "PLUGIN")]
    pub(crate) plugin: String,
    #[command(flatten)]
    pub(crate) library: Library,
    /// A setting of the plug-in; preset=NAME takes a preset; may be repeated
    #[arg(long = "set", short = 's', value_name = "NAME=VALUE")]
    pub(crate) settings: Vec<Assignment>,
    /// Characters in flight at most; more reach the other side after its XOFF [default: by baud rate]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) depth: Option<u32>,
}

impl LinkArguments {
    /// How to open the port.
    pub(crate) fn port_options(&self) -> PortOptions {
        let flow = match self.flow {
            FlowBy::Host => Flow::Host,
            FlowBy::Device => Flow::Device,
        };
        PortOptions { flow, ..PortOptions::new(self.line) }
    }
}

/// Who reacts to XON and XOFF.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
pub(crate) enum FlowBy {
    #[default]
    Host,
    Device,
}

/// A setting as it was asked for.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Assignment {
    pub(crate) name: String,
    pub(crate) value: String,
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::parse(text).ok_or_else(|| "a setting is written NAME=VALUE".to_owned())
    }
}

impl Assignment {
    fn parse(text: &str) -> Option<Self> {
        let (name, value) = text.split_once('=').filter(|(name, _)| !name.trim().is_empty())?;
        Some(Self { name: name.trim().to_owned(), value: value.to_owned() })
    }

    pub(crate) fn as_pair(&self) -> (&str, &str) {
        (&self.name, &self.value)
    }
}

/// A field of a job as it was asked for.
pub(crate) fn field(text: &str) -> Result<Assignment, String> {
    Assignment::parse(text).ok_or_else(|| "a field is written NAME=VALUE".to_owned())
}

/// A port as people write it.
pub(crate) fn port(text: &str) -> Result<PortSpec, String> {
    text.parse::<PortSpec>().map_err(|error| error.to_string())
}

pub(crate) fn line(text: &str) -> Result<LineParameters, String> {
    parse_line(text, LineParameters::new(9_600)).map_err(|error| error.to_string())
}
