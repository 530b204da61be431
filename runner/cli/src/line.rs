//! Options that describe a link: the line, the plug-in and its settings.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use softplug_abi::manifest::{Manifest, Preset, SettingValues};
use softplug_abi::{LineParameters, Parity};
use softplug_live::port::{line_mismatch, line_text, parse_line};
use softplug_live::{Flow, PortOptions, PortSpec};

use crate::assignment::Assignment;
use crate::failure::Failure;
use crate::machine::MachineArguments;
use crate::plugin::{Chosen, Library};
use softplug_catalogue::{Machine, Notations};

/// How to speak on a line, apart from its port.
#[derive(Debug, Args)]
pub(crate) struct LinkArguments {
    #[command(flatten)]
    pub(crate) machine: MachineArguments,
    /// The line: baud rate and form of a character, such as "4800 7E2" [default: the plug-in's, or
    /// 9600 8N1]
    #[arg(long, value_name = "LINE")]
    pub(crate) line: Option<AskedLine>,
    /// What the port does by itself
    #[arg(long, value_enum, default_value_t, value_name = "WHO")]
    pub(crate) flow: FlowBy,
    /// The plug-in: a .wasm file, a name to look up, or native:NAME
    #[arg(long, short = 'x', value_name = "PLUGIN", required_unless_present = "machine")]
    pub(crate) plugin: Option<String>,
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
    /// How programs of the machine say their names.
    pub(crate) fn notations(&self) -> Result<Notations, Failure> {
        Ok(self.machine.find()?.map_or_else(Notations::known, |machine| machine.notations()))
    }

    /// Loads the plug-in and finds its settings. What the machine's entry in the catalogue says is
    /// taken where nothing else was asked for.
    pub(crate) fn load(&mut self) -> Result<(Chosen, SettingValues), Failure> {
        let machine = self.machine.find()?;
        let of_machine = machine.as_ref().map(|machine| &machine.plugin);
        let Some(plugin) = self.plugin.as_ref().or(of_machine) else {
            return Err(Failure::internal("neither a plug-in nor a machine was demanded"));
        };
        let plugin = self.library.load(plugin)?;
        if let Some(machine) = machine {
            self.take(machine, plugin.manifest())?;
        }
        let settings = plugin.settings(&self.settings)?;
        Ok((plugin, settings))
    }

    fn take(&mut self, machine: Machine, manifest: &Manifest) -> Result<(), Failure> {
        let Machine { name, plugin, line, settings, .. } = machine;
        if plugin != manifest.name {
            return Err(Failure::usage(format_args!(
                "the machine {name} is spoken to with {plugin}, and --plugin is {}",
                manifest.name
            ))
            .hint("leave out --plugin, or --machine"));
        }
        let broken = |error: String| {
            Failure::usage(format_args!("the line of the machine {name} is none: {error}"))
        };
        if self.line.is_none() {
            self.line = line.map(|line| line.parse().map_err(broken)).transpose()?;
        }
        // What a preset sets that was asked for stands above the machine's settings.
        let asked = std::mem::take(&mut self.settings);
        let is_asked = |preset: &&Preset| {
            asked.iter().any(|asked| asked.name == PRESET && asked.value == preset.name)
        };
        let presets: Vec<_> = manifest.presets.iter().filter(is_asked).collect();
        let is_set =
            |setting: &str| presets.iter().any(|preset| preset.values.contains_key(setting));
        let own = settings.into_iter().filter(|(name, _)| !is_set(name));
        let own = own.map(|(name, value)| Assignment { name, value });
        self.settings = own.chain(asked.iter().cloned()).collect();
        Ok(())
    }

    /// The line to speak on with this plug-in.
    pub(crate) fn line(&self, manifest: &Manifest, values: &SettingValues) -> ChosenLine {
        ChosenLine::of(self.line.as_ref(), manifest, &self.settings, values)
    }

    /// How to open the port.
    pub(crate) fn port_options(&self, line: LineParameters) -> PortOptions {
        let flow = self.flow.flow();
        PortOptions { flow, ..PortOptions::new(line) }
    }
}

/// What takes a preset of the plug-in.
const PRESET: &str = "preset";

/// The line where nobody names one.
pub(crate) const USUAL_LINE: LineParameters = LineParameters::new(9_600);

/// A line as it was asked for; what it leaves out is the plug-in's.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct AskedLine(String);

impl FromStr for AskedLine {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = parse_line(text, USUAL_LINE).map_err(|error| error.to_string());
        read.map(|_| Self(text.to_owned()))
    }
}

impl AskedLine {
    /// With what it leaves out as in `base`.
    pub(crate) fn or(&self, base: LineParameters) -> LineParameters {
        parse_line(&self.0, base).expect("it was read before")
    }
}

/// What carries a line.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Carrier {
    /// A port that is set from here.
    Port,
    /// A pty, which has neither rate nor parity.
    Pty,
    /// A raw connection to a device server, which is set there.
    Raw,
}

/// The line that is taken, and what it is to the protocol.
#[derive(Copy, Clone, Debug)]
pub(crate) struct ChosenLine {
    pub(crate) line: LineParameters,
    /// As the plug-in's manifest names it; with the usual rate where it leaves that open.
    named: Option<LineParameters>,
    is_asked: bool,
}

impl ChosenLine {
    /// The line that was asked for, else the plug-in's with these settings, else the usual one.
    pub(crate) fn of(
        asked: Option<&AskedLine>,
        manifest: &Manifest,
        settings: &[Assignment],
        values: &SettingValues,
    ) -> Self {
        let named = manifest.line_for(settings.iter().map(Assignment::as_pair), values);
        let named = named.map(|named| match named.parameters {
            LineParameters { baud: 0, .. } => {
                LineParameters { baud: USUAL_LINE.baud, ..named.parameters }
            }
            parameters => parameters,
        });
        let base = named.unwrap_or(USUAL_LINE);
        let line = asked.map_or(base, |asked| asked.or(base));
        Self { line, named, is_asked: asked.is_some() }
    }

    /// What is to be said of it on such a port, in one line.
    pub(crate) fn remark(&self, carrier: Carrier) -> Option<String> {
        let line = line_text(&self.line);
        let is_plain = self.line.parity == Parity::None && self.line.data_bits == 8;
        let carried = match carrier {
            Carrier::Pty if !is_plain => {
                "; a pty carries 8 data bits and no parity: it is neither made nor looked at"
            }
            Carrier::Raw => "; a raw connection has what is set at the server",
            Carrier::Port | Carrier::Pty => "",
        };
        match (self.named, carrier) {
            (Some(_), _) if !self.is_asked => {
                Some(format!("the line is {line}, as the plug-in names it{carried}"))
            }
            (None, Carrier::Port) if !self.is_asked => Some(format!(
                "the line is {line}, as nobody named one: no parity is looked at; --line names another"
            )),
            (Some(named), Carrier::Port) => {
                let form = line_text(&LineParameters { baud: 0, ..named });
                let lost = line_mismatch(self.line, named)?;
                Some(format!("the line is {line}, the protocol's {form}: {lost}"))
            }
            (_, Carrier::Pty) if self.is_asked && !is_plain => {
                Some(format!("the line is {line}{carried}"))
            }
            _ => None,
        }
    }
}

/// What the port does by itself.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
pub(crate) enum FlowBy {
    /// Nothing: the plug-in reacts to XON and XOFF
    #[default]
    Host,
    /// Driver, adapter or device server react to XON and XOFF
    Device,
    /// The machine stops the port with CTS, the port the machine with RTS
    RtsCts,
    /// As RTS/CTS, by DSR and DTR; only of a device server
    DsrDtr,
    /// The driver turns a half-duplex line around with RTS
    #[value(name = "rs-485")]
    Rs485,
}

impl FlowBy {
    /// As ports know it.
    pub(crate) fn flow(self) -> Flow {
        match self {
            Self::Host => Flow::Host,
            Self::Device => Flow::Device,
            Self::RtsCts => Flow::RtsCts,
            Self::DsrDtr => Flow::DsrDtr,
            Self::Rs485 => Flow::Rs485,
        }
    }
}

/// A port as people write it.
pub(crate) fn port(text: &str) -> Result<PortSpec, String> {
    text.parse::<PortSpec>().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plug-in that names this line, or none.
    fn manifest(line: Option<&str>) -> Manifest {
        let line = line.map_or(String::new(), |line| format!(r#","line":"{line}""#));
        let text = format!(
            r#"{{"abi":"1.1","name":"x","version":"1","licence":"MIT","protocol":"x","description":"x"{line}}}"#
        );
        Manifest::parse(text.as_bytes()).unwrap()
    }

    fn chosen(asked: Option<&str>, named: Option<&str>) -> ChosenLine {
        let asked = asked.map(|asked| asked.parse::<AskedLine>().unwrap());
        ChosenLine::of(asked.as_ref(), &manifest(named), &[], &SettingValues::default())
    }

    #[test]
    fn what_is_not_asked_for_is_the_plug_ins() {
        let text = |asked, named| line_text(&chosen(asked, named).line);
        assert_eq!(text(None, None), "9600 8N1");
        assert_eq!(text(None, Some("4800 7E2")), "4800 7E2");
        assert_eq!(text(None, Some("8E1")), "9600 8E1");
        assert_eq!(text(Some("19200"), Some("4800 7E2")), "19200 7E2");
        assert_eq!(text(Some("8N1"), Some("4800 7E2")), "4800 8N1");
        assert_eq!(text(Some("8N1"), None), "9600 8N1");
        assert!("8X1".parse::<AskedLine>().is_err());
    }

    #[test]
    fn a_line_that_is_not_the_protocols_is_told() {
        let remark = |asked, named| chosen(asked, named).remark(Carrier::Port);
        assert_eq!(
            remark(None, Some("4800 7E2")).as_deref(),
            Some("the line is 4800 7E2, as the plug-in names it")
        );
        assert_eq!(
            remark(Some("9600 8N1"), Some("4800 7E2")).as_deref(),
            Some("the line is 9600 8N1, the protocol's 7E2: a wrong parity bit is not looked at")
        );
        let told = |asked, named| remark(Some(asked), Some(named)).unwrap();
        assert!(
            told("8E1", "8N1")
                .ends_with(": a parity bit is expected that the protocol does not have")
        );
        assert!(
            told("7O2", "7E2")
                .ends_with(": a parity bit is expected that the protocol has otherwise")
        );
        assert!(told("8E2", "7E2").ends_with(": characters have another number of bits"));
        assert!(told("7E1", "7E2").ends_with(": only the stop bits differ"));
        // Another rate is nobody's mistake.
        assert_eq!(remark(Some("19200"), Some("4800 7E2")), None);
        assert_eq!(remark(Some("8N1"), None), None);
        assert_eq!(
            remark(None, None).as_deref(),
            Some(
                "the line is 9600 8N1, as nobody named one: no parity is looked at; --line names another"
            )
        );
    }

    #[test]
    fn of_a_pty_only_the_missing_parity_is_told() {
        let remark = |asked, named| chosen(asked, named).remark(Carrier::Pty);
        let carried = "; a pty carries 8 data bits and no parity: it is neither made nor looked at";
        assert_eq!(remark(Some("4800 7E2"), None), Some(format!("the line is 4800 7E2{carried}")));
        assert_eq!(
            remark(None, Some("4800 7E2")),
            Some(format!("the line is 4800 7E2, as the plug-in names it{carried}"))
        );
        assert_eq!(remark(Some("9600 8N1"), Some("4800 7E2")), None);
        assert_eq!(remark(None, None), None);
        let remark = |asked, named| chosen(asked, named).remark(Carrier::Raw);
        assert_eq!(
            remark(None, Some("8E1")).as_deref(),
            Some(
                "the line is 9600 8E1, as the plug-in names it; a raw connection has what is set at \
                 the server"
            )
        );
        assert_eq!((remark(Some("8N1"), Some("8E1")), remark(None, None)), (None, None));
    }
}
