//! What is configured of one link.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use softplug_abi::{LineParameters, Micros};
use softplug_catalogue::{Machine, Notations};
use softplug_live::endpoint::EndpointSetup;
use softplug_live::port::{line_mismatch, line_text, parse_line};
use softplug_live::units::{TlsKeys, UnitAddress};
use softplug_live::{Flow, PortSpec};

use super::finding::{ConfigFinding, Place};
use crate::programs::Quota;
use crate::view::ProbationOrder;

/// One link.
#[derive(Clone, Debug)]
pub struct LinkConfig {
    /// Its name, distinct from all others in whatever case.
    pub name: String,
    /// Where it stands, such as a hall or a cell: links of one group are shown together.
    pub group: Option<String>,
    /// Its port.
    pub port: PortConfig,
    /// The gateway's key and that of its unit, which is reached with TLS then.
    pub tls: Option<TlsKeys>,
    /// The bus that its unit hangs on.
    pub bus: Option<String>,
    /// The line. What is not written of it is the plug-in's, once that is known.
    pub line: LineParameters,
    /// Who reacts to XON and XOFF.
    pub flow: Flow,
    /// Keep other programs away from a terminal.
    pub exclusive: bool,
    /// How long connecting may take.
    pub connect: Duration,
    /// Opening again.
    pub reopen: Reopen,
    /// The plug-in: `name`, `name@version` or `name@sha256:…`.
    pub plugin: String,
    /// Its settings as text, as `--set` takes them.
    pub settings: BTreeMap<String, String>,
    /// Characters that may be in flight.
    pub depth: Option<u32>,
    /// Bytes that the transmit queue takes.
    pub transmit_room: u32,
    /// Bytes of deliveries that may wait.
    pub delivery_room: u32,
    /// Folders below the programs' folders in which requests from the panel find
    /// programs, in this order; empty: the programs' folders themselves.
    pub search: Vec<String>,
    /// How its programs say their names.
    pub names: Notations,
    /// What the catalogue says of its machine, if it names one.
    pub machine: Option<Arc<Machine>>,
    /// Folder of its receptions, below that of all.
    pub receive: String,
    /// What it may receive.
    pub quota: Quota,
    /// The buffer between server and machine.
    pub buffer: Buffer,
    /// The server endpoint.
    pub endpoint: Option<EndpointSetup>,
    /// The folder whose files become jobs.
    pub drop: Option<DropConfig>,
    /// When to bark.
    pub watchdogs: Watchdogs,
    /// What becomes of new versions in the library.
    pub swap: SwapPolicy,
    /// Probation of new plug-ins.
    pub probation: Probation,
    /// Bytes of the flight recorder.
    pub recorder: u32,
    /// The line as it is written.
    pub(crate) written_line: Option<String>,
    /// Where its parts are written.
    pub(crate) places: Places,
}

/// Where the parts of a link are written, for errors that only a plug-in shows.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    pub(crate) plugin: Place,
    pub(crate) line: Place,
    pub(crate) settings: BTreeMap<String, Place>,
}

/// What a link is connected to.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum PortConfig {
    /// A port.
    Port(PortSpec),
    /// A simulated machine of this process.
    Simulated(String),
    /// A link of a front-end unit: its port, its line and its plug-in are there.
    Unit(UnitAddress),
}

impl PortConfig {
    /// Whether it is a port of which this is true.
    pub(super) fn is(&self, fact: impl Fn(&PortSpec) -> bool) -> bool {
        match self {
            Self::Port(spec) => fact(spec),
            Self::Simulated(_) | Self::Unit(_) => false,
        }
    }
}

impl fmt::Display for PortConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port(spec) => spec.fmt(f),
            Self::Simulated(machine) => write!(f, "simulate:{machine}"),
            Self::Unit(address) => address.fmt(f),
        }
    }
}

/// Machines that can be simulated.
pub(crate) const MACHINES: [&str; 7] =
    ["xon-xoff", "r3964", "r3964-simplified", "fanuc-rs232", "kermit", "pulse-lathe", "xmodem"];

/// Opening a port again after it went.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Reopen {
    /// Time until the first try.
    pub first: Duration,
    /// It doubles up to this.
    pub longest: Duration,
}

/// The buffer between server and machine, in bytes.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Buffer {
    /// All of it.
    pub size: u32,
    /// Under this it asks for more.
    pub low: u32,
    /// Up to this it is filled.
    pub high: u32,
    /// How much is given to it at once.
    pub packet: u32,
}

/// A folder whose files become jobs of a link.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DropConfig {
    /// Where it is.
    pub folder: PathBuf,
    /// For so long a file must not have changed.
    pub settle: Duration,
    /// So often it is looked into.
    pub poll: Duration,
    /// Bytes of the largest file that is taken.
    pub largest: u64,
}

/// When a link's watchdogs bark; never if `None`.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Watchdogs {
    /// Nothing came for so long.
    pub no_bytes: Option<Duration>,
    /// A job got no further for so long.
    pub no_progress: Option<Duration>,
    /// The machine has held the line for so long.
    pub stuck_held: Option<Duration>,
}

/// What becomes of a new version of the plug-in in the library.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum SwapPolicy {
    /// Nothing by itself.
    #[default]
    Manual,
    /// It is taken: at once if the state formats match, else when idle.
    Follow,
    /// It is taken when the link is idle.
    FollowWhenIdle,
}

/// How long a new plug-in is on probation.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Probation {
    /// Events that it must survive.
    pub events: u64,
    /// Time that it must survive.
    pub span: Duration,
}

impl From<ProbationOrder> for Probation {
    fn from(order: ProbationOrder) -> Self {
        Self { events: order.events, span: Duration::from_secs(order.seconds.into()) }
    }
}

/// Where something is written says nothing of what it is.
impl PartialEq for LinkConfig {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.changed_keys(other).is_empty()
    }
}

impl LinkConfig {
    /// The keys in which two configurations of a link differ.
    pub fn changed_keys(&self, other: &Self) -> Vec<&'static str> {
        let keys = [
            ("group", self.group == other.group),
            ("port", self.port == other.port),
            ("unit-key", self.tls == other.tls),
            ("bus", self.bus == other.bus),
            ("line", self.line == other.line),
            ("flow", self.flow == other.flow),
            ("exclusive", self.exclusive == other.exclusive),
            ("connect", self.connect == other.connect),
            ("reopen", self.reopen == other.reopen),
            ("plugin", self.plugin == other.plugin),
            ("settings", self.settings == other.settings),
            ("depth", self.depth == other.depth),
            ("transmit-room", self.transmit_room == other.transmit_room),
            ("delivery-room", self.delivery_room == other.delivery_room),
            ("search", self.search == other.search),
            ("names", self.names == other.names),
            ("machine", self.machine == other.machine),
            ("receive", self.receive == other.receive),
            ("quota", self.quota == other.quota),
            ("buffer", self.buffer == other.buffer),
            ("endpoint", self.endpoint == other.endpoint),
            ("drop", self.drop == other.drop),
            ("watchdog", self.watchdogs == other.watchdogs),
            ("swap", self.swap == other.swap),
            ("probation", self.probation == other.probation),
            ("recorder", self.recorder == other.recorder),
        ];
        keys.into_iter().filter(|(_, same)| !same).map(|(key, _)| key).collect()
    }

    /// Takes what is not written of the line from what the plug-in names.
    ///
    /// # Errors
    /// A serial port is left without a rate.
    pub(crate) fn complete_line(
        &mut self,
        named: Option<LineParameters>,
    ) -> Result<(), ConfigFinding> {
        let base = named.unwrap_or_else(|| LineParameters::new(0));
        let written = self.written_line.as_deref();
        // It was read before.
        self.line = written.and_then(|text| parse_line(text, base).ok()).unwrap_or(base);
        if self.line.baud != 0 || !self.port.is(PortSpec::needs_rate) {
            return Ok(());
        }
        let rate = LineParameters { baud: 9_600, ..self.line };
        Err(ConfigFinding {
            place: self.places.line.clone(),
            message: "a serial port needs a baud rate".to_owned(),
            hint: format!("add one: `line = \"{}\"`", line_text(&rate)),
        })
    }

    /// What its line does not do that the plug-in's would; nothing where no port is set.
    pub(crate) fn line_remark(&self, named: Option<LineParameters>) -> Option<ConfigFinding> {
        let named = named?;
        let is_set = self.port.is(PortSpec::sets_line);
        let lost = line_mismatch(self.line, named).filter(|_| is_set)?;
        let form = line_text(&LineParameters { baud: 0, ..named });
        Some(ConfigFinding {
            place: self.places.line.clone(),
            message: format!("the line is {}, the protocol's {form}: {lost}", self.line_text()),
            hint: format!("`line = \"{form}\"`, unless the machine is set otherwise"),
        })
    }

    /// The line as people write it.
    pub fn line_text(&self) -> String {
        line_text(&self.line)
    }
}

/// Names of links, and of folders: nothing that leads anywhere.
pub(crate) fn is_name(name: &str) -> bool {
    name.len() <= 64
        && name.starts_with(|c: char| c.is_ascii_alphanumeric())
        && !name.ends_with(['.', ' '])
        && name.chars().all(|c| c.is_ascii_alphanumeric() || "._ -".contains(c))
}

/// A span on a link's clock.
pub(crate) fn micros(span: Duration) -> Micros {
    Micros(i64::try_from(span.as_micros()).unwrap_or(i64::MAX))
}
