//! The tables `[[link]]` and `[defaults]`, read and checked.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt;
use std::net::SocketAddr;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use softplug_abi::LineParameters;
use softplug_catalogue::{Catalogue, Notation, NotationError, Notations};
use softplug_live::endpoint::{EndpointKind, EndpointSetup, Framing, LineAnswer};
use softplug_live::port::parse_line;
use softplug_live::units::{BusSetup, TlsKeys, UnitAddress, UnitPlace};
use softplug_live::{BadSpec, Flow, PortSpec};
use toml::{Spanned, Value};

use super::finding::{ConfigFindings, Place};
use super::link::{
    Buffer, LinkConfig, MACHINES, Places, PortConfig, Probation, Reopen, SwapPolicy, Watchdogs,
    is_name, micros,
};
use super::service::{GatewayConfig, address, bytes, choice, optional_span, span};
use super::tls::GatewayKey;
use super::written::{self, Text};
use super::{MOST_LINKS, of_names};
use crate::programs::Quota;

/// What the rest of the file says to all links.
pub(super) struct Common<'a> {
    pub(super) defaults: &'a written::Link,
    pub(super) buses: &'a [BusSetup],
    pub(super) catalogue: &'a Catalogue,
    pub(super) key: &'a GatewayKey,
    pub(super) gateway: &'a GatewayConfig,
    /// What paths are relative to.
    pub(super) folder: &'a Path,
}

/// All links, each with what it does not say taken from the defaults.
pub(super) fn all(
    written: Vec<Spanned<written::Link>>,
    common: &Common<'_>,
    problems: &mut ConfigFindings<'_>,
) -> Vec<LinkConfig> {
    let Common { defaults, catalogue, .. } = *common;
    for (key, text) in [
        ("name", &defaults.name),
        ("port", &defaults.port),
        ("unit-key", &defaults.unit_key),
        ("receive", &defaults.receive),
    ] {
        if let Some(text) = text {
            let message = format!("{key} cannot be the same for all links");
            problems.add(text.span(), message, "move it to the links");
        }
    }
    if let Some(endpoint) = &defaults.endpoint {
        let message = "an endpoint cannot be the same for all links";
        problems.add(endpoint.span(), message, "move it to the links");
    }
    if let Some(written) = &defaults.drop {
        let message = "a drop folder cannot be the same for all links";
        problems.add(written.span(), message, "move it to the links");
    }
    if let Some(link) = written.get(MOST_LINKS) {
        let message = format!("there are more than {MOST_LINKS} links");
        problems.add(link.span(), message, "run a second gateway for the rest");
    }
    let mut links: Vec<LinkConfig> = Vec::new();
    let drops = super::drops::taken(common.gateway);
    let mut taken = Taken { drops, ..Taken::default() };
    for link in written.into_iter().take(MOST_LINKS) {
        let at = header(link.span());
        let link = link.into_inner().or_machine(defaults, catalogue, problems).or(defaults);
        if let Some(link) = one(link, at, common, &mut taken, problems) {
            links.push(link);
        }
    }
    links
}

/// The span of a whole table begins with its header.
fn header(span: Range<usize>) -> Range<usize> {
    span.start..span.start
}

/// What only one link may have.
#[derive(Default)]
struct Taken {
    names: HashSet<String>,
    ports: HashMap<String, String>,
    addresses: HashMap<SocketAddr, String>,
    folders: HashMap<String, String>,
    drops: HashMap<PathBuf, String>,
    /// Of each unit the link that named it first, and how it is reached.
    units: HashMap<UnitPlace, (String, Option<TlsKeys>)>,
}

fn one(
    link: written::Link,
    at: Range<usize>,
    common: &Common<'_>,
    taken: &mut Taken,
    problems: &mut ConfigFindings<'_>,
) -> Option<LinkConfig> {
    let name = name(link.name.as_ref(), &at, taken, problems)?;
    let port = port(link.port.as_ref(), &name, &at, taken, problems);
    let bus = bus(link.bus.as_ref(), &name, port.as_ref(), common.buses, problems);
    let tls = common.key.with(link.unit_key.as_ref(), &name, port.as_ref(), problems);
    same_unit_same_key(port.as_ref(), tls.as_ref(), &name, &at, taken, problems);
    let line_place = problems.place(link.line.as_ref().map_or_else(|| at.clone(), Spanned::span));
    let line = line(link.line.as_ref(), problems);
    let plugin = match (&link.plugin, &link.machine) {
        // Of its machine it was said that there is none.
        (None, Some(_)) => None,
        (written, _) => plugin(written.as_ref(), &name, &at, problems),
    };
    let (settings, setting_places) = settings(link.settings.unwrap_or_default(), problems);
    let plugin_place = problems.place(link.plugin.as_ref().map_or(at, Spanned::span));
    let group = plain_name(link.group.as_ref(), "group", problems);
    let receive =
        plain_name(link.receive.as_ref(), "folder", problems).unwrap_or_else(|| name.clone());
    if let Some(other) = taken.folders.insert(receive.to_lowercase(), name.clone()) {
        let span = link.receive.as_ref().or(link.name.as_ref()).map_or(0..0, Spanned::span);
        let message = format!("the link \"{other}\" receives into the same folder \"{receive}\"");
        problems.add(span, message, "give each link a folder of its own with `receive`");
    }
    let search = link.search.map(Spanned::into_inner).unwrap_or_default();
    let search =
        search.iter().filter_map(|text| plain_name(Some(text), "folder", problems)).collect();
    let names = names(link.names, problems);
    let machine = link.machine.and_then(|text| common.catalogue.find(text.get_ref()).cloned());
    let mut room = |value: Option<&Spanned<Value>>, default: u32| {
        value
            .map_or(default, |value| bytes(value, 64, 1 << 24, problems).unwrap_or_default() as u32)
    };
    let transmit_room = room(link.transmit_room.as_ref(), 4_096);
    let delivery_room = room(link.delivery_room.as_ref(), 16_384);
    let recorder = link
        .recorder
        .as_ref()
        .map_or(8_192, |value| bytes(value, 0, 1 << 24, problems).unwrap_or_default() as u32);
    let depth = link.depth.map(|depth| {
        if !(1..=4_096).contains(depth.get_ref()) {
            let hint = "give 1 to 4096 characters, or leave it out: it follows the baud rate";
            problems.add(depth.span(), "so many characters cannot be in flight", hint);
        }
        *depth.get_ref()
    });
    let reopen = link.reopen.unwrap_or_default();
    let reopen = Reopen {
        first: span(reopen.first.as_ref(), 250, problems),
        longest: span(reopen.longest.as_ref(), 10_000, problems),
    };
    let watchdog = link.watchdog.unwrap_or_default();
    let watchdogs = Watchdogs {
        no_bytes: optional_span(watchdog.no_bytes.as_ref(), problems),
        no_progress: optional_span(watchdog.no_progress.as_ref(), problems),
        stuck_held: optional_span(watchdog.stuck_held.as_ref(), problems),
    };
    let probation = link.probation.unwrap_or_default();
    let probation = Probation {
        events: probation.events.map_or(0, Spanned::into_inner),
        span: span(probation.span.as_ref(), 60_000, problems),
    };
    let quota = quota(link.quota, problems);
    let buffer = buffer(link.buffer, problems);
    if let (Some(written), Some(PortConfig::Unit(_))) = (&link.endpoint, &port) {
        let message = format!("the link \"{name}\" is a unit's, which has no endpoint");
        problems.add(
            written.span(),
            message,
            "take it away, or give the link a port of this computer",
        );
    }
    let endpoint = link.endpoint.and_then(|written| endpoint(&written, &name, taken, problems));
    let drop = link.drop.and_then(|written| {
        super::drops::one(&written, &name, common.folder, &mut taken.drops, problems)
    });
    let flows = Flow::ALL.map(|flow| (flow.name(), flow));
    let flow = choice(link.flow.as_ref(), &flows, problems);
    let misfit = match &port {
        Some(PortConfig::Port(spec)) => flow.check(spec).err(),
        _ => None,
    };
    if let (Some(error), Some(text)) = (misfit, &link.flow) {
        let (message, hint) = split(&error);
        problems.add(text.span(), message, hint);
    }
    let policies = [
        ("manual", SwapPolicy::Manual),
        ("follow", SwapPolicy::Follow),
        ("follow-when-idle", SwapPolicy::FollowWhenIdle),
    ];
    Some(LinkConfig {
        flow,
        exclusive: link.exclusive.unwrap_or(true),
        connect: span(link.connect.as_ref(), 5_000, problems),
        swap: choice(link.swap.as_ref(), &policies, problems),
        name,
        machine: machine.map(Arc::new),
        group,
        bus,
        port: port?,
        tls,
        line,
        reopen,
        plugin: plugin?,
        settings,
        depth,
        transmit_room,
        delivery_room,
        search,
        names,
        receive,
        quota,
        buffer,
        endpoint,
        drop,
        watchdogs,
        probation,
        recorder,
        written_line: link.line.map(Spanned::into_inner),
        places: Places { plugin: plugin_place, line: line_place, settings: setting_places },
    })
}

fn name(
    text: Option<&Text>,
    at: &Range<usize>,
    taken: &mut Taken,
    problems: &mut ConfigFindings<'_>,
) -> Option<String> {
    let Some(text) = text else {
        let hint = "add a line such as `name = \"lathe-1\"`";
        problems.add(at.clone(), "this link has no name", hint);
        return None;
    };
    let name = text.get_ref();
    if !is_name(name) {
        problems.add(
            text.span(),
            format_args!("\"{}\" cannot name a link", name.escape_debug()),
            NAME_HINT,
        );
        return None;
    }
    if !taken.names.insert(name.to_lowercase()) {
        let message = format!("there are two links \"{name}\"");
        problems.add(text.span(), message, "give each a name of its own; case does not count");
        return None;
    }
    Some(name.clone())
}

const NAME_HINT: &str =
    "use 1 to 64 letters, digits, dots, spaces, hyphens and underscores, a letter or digit first";

fn plain_name(
    text: Option<&Text>,
    what: &str,
    problems: &mut ConfigFindings<'_>,
) -> Option<String> {
    let text = text?;
    if is_name(text.get_ref()) {
        return Some(text.get_ref().clone());
    }
    let given = text.get_ref().escape_debug();
    problems.add(text.span(), format_args!("\"{given}\" cannot name a {what}"), NAME_HINT);
    None
}

fn port(
    text: Option<&Text>,
    name: &str,
    at: &Range<usize>,
    taken: &mut Taken,
    problems: &mut ConfigFindings<'_>,
) -> Option<PortConfig> {
    let Some(text) = text else {
        let hint = "add a line such as `port = \"/dev/ttyUSB0\"`";
        problems.add(at.clone(), format_args!("the link \"{name}\" has no port"), hint);
        return None;
    };
    let port = match text.get_ref().strip_prefix("simulate:") {
        Some(machine) if MACHINES.contains(&machine) => PortConfig::Simulated(machine.to_owned()),
        Some(machine) => {
            problems.add(
                text.span(),
                format_args!("\"{}\" is no machine to simulate", machine.escape_debug()),
                of_names("there are", machine, MACHINES),
            );
            return None;
        }
        None => match parse_port(text.get_ref()) {
            Ok(port) => port,
            Err(error) => {
                let (message, hint) = split(&error);
                problems.add(text.span(), message, hint);
                return None;
            }
        },
    };
    if (port.is(PortSpec::is_exclusive) || matches!(port, PortConfig::Unit(_)))
        && let Some(other) = taken.ports.insert(port.to_string(), name.to_owned())
    {
        let message = format!("the link \"{other}\" has the same port {port}");
        problems.add(text.span(), message, "a port belongs to one link");
    }
    Some(port)
}

/// A unit has one key, and one connection for all its links.
fn same_unit_same_key(
    port: Option<&PortConfig>,
    tls: Option<&TlsKeys>,
    name: &str,
    at: &Range<usize>,
    taken: &mut Taken,
    problems: &mut ConfigFindings<'_>,
) {
    let Some(PortConfig::Unit(address)) = port else { return };
    let known = taken.units.entry(address.unit.clone());
    let (other, others) = known.or_insert_with(|| (name.to_owned(), tls.cloned()));
    if others.as_ref() != tls {
        let message = format!(
            "the links \"{other}\" and \"{name}\" are of the unit {}, and have not the same unit-key",
            address.unit
        );
        problems.add(at.clone(), message, "give both the same, or none");
    }
}

/// The bus that a link names, or that of its unit's CAN interface.
fn bus(
    text: Option<&Text>,
    name: &str,
    port: Option<&PortConfig>,
    buses: &[BusSetup],
    problems: &mut ConfigFindings<'_>,
) -> Option<String> {
    let is_known = |bus: &str| buses.iter().any(|known| known.name == bus);
    let unit = match port? {
        PortConfig::Unit(address) => &address.unit,
        PortConfig::Port(_) | PortConfig::Simulated(_) => {
            if let Some(text) = text {
                let message = format!("the link \"{name}\" is no unit's, and on no bus");
                problems.add(text.span(), message, "take `bus` away, or give it a port unit://…");
            }
            return None;
        }
    };
    let Some(text) = text else {
        let UnitPlace::Can(address) = unit else { return None };
        return Some(address.interface().to_owned()).filter(|bus| is_known(bus));
    };
    let bus = text.get_ref();
    if !is_known(bus) {
        let message = format!("there is no bus \"{}\"", bus.escape_debug());
        let names = buses.iter().map(|known| known.name.as_str());
        let hint = if buses.is_empty() {
            format!("add one: [[bus]] with name = \"{}\"", bus.escape_debug())
        } else {
            of_names("there are", bus, names)
        };
        problems.add(text.span(), message, hint);
    }
    Some(bus.clone())
}

fn parse_port(text: &str) -> Result<PortConfig, BadSpec> {
    if text.starts_with(UnitAddress::SCHEME) {
        return text.parse().map(PortConfig::Unit);
    }
    text.parse().map(PortConfig::Port)
}

/// As far as it is written; the rest is the plug-in's.
fn line(text: Option<&Text>, problems: &mut ConfigFindings<'_>) -> LineParameters {
    let base = LineParameters::new(0);
    let Some(text) = text else { return base };
    parse_line(text.get_ref(), base).unwrap_or_else(|error| {
        let (message, hint) = split(&error);
        problems.add(text.span(), message, hint);
        base
    })
}

/// Errors of ports are "what; what to do".
fn split(error: &dyn fmt::Display) -> (String, String) {
    let text = error.to_string();
    match text.split_once("; ") {
        Some((message, hint)) => (message.to_owned(), hint.to_owned()),
        None => (text, "see docs/gateway/config.md".to_owned()),
    }
}

fn plugin(
    text: Option<&Text>,
    name: &str,
    at: &Range<usize>,
    problems: &mut ConfigFindings<'_>,
) -> Option<String> {
    match text {
        Some(text) if !text.get_ref().trim().is_empty() => Some(text.get_ref().clone()),
        _ => {
            let span = text.map_or(at.clone(), Spanned::span);
            let hint = "add a line such as `plugin = \"xon-xoff\"`";
            problems.add(span, format_args!("the link \"{name}\" has no plug-in"), hint);
            None
        }
    }
}

/// How programs say their names: so first, then as is known.
fn names(written: Option<Spanned<Vec<Text>>>, problems: &mut ConfigFindings<'_>) -> Notations {
    let mut notations: Vec<Notation> = Vec::new();
    for form in written.map(Spanned::into_inner).unwrap_or_default() {
        match form.get_ref().parse() {
            Ok(notation) => notations.push(notation),
            Err(error) => {
                let text = NotationError::to_string(&error);
                let (message, hint) = text.rsplit_once(": ").unwrap_or((&text, ""));
                problems.add(form.span(), message, hint);
            }
        }
    }
    Notations::before_known(notations)
}

/// Settings as text, as people give them to the command.
fn settings(
    written: BTreeMap<Text, Spanned<Value>>,
    problems: &mut ConfigFindings<'_>,
) -> (BTreeMap<String, String>, BTreeMap<String, Place>) {
    let (mut settings, mut places) = (BTreeMap::new(), BTreeMap::new());
    for (name, value) in written {
        let text = match value.get_ref() {
            Value::String(text) => text.clone(),
            Value::Integer(number) => number.to_string(),
            Value::Boolean(true) => "on".to_owned(),
            Value::Boolean(false) => "off".to_owned(),
            _ => {
                let message = format!("the setting \"{}\" has no such value", name.get_ref());
                let hint = "give true or false, a whole number or a text";
                problems.add(value.span(), message, hint);
                continue;
            }
        };
        // A setting is written with - or _ between its words.
        let name = name.into_inner().replace('-', "_");
        places.insert(name.clone(), problems.place(value.span()));
        if settings.insert(name.clone(), text).is_some() {
            let message = format!("the setting \"{name}\" is given twice");
            problems.add(value.span(), message, "keep one of the two");
        }
    }
    (settings, places)
}

fn quota(written: Option<Spanned<written::Quota>>, problems: &mut ConfigFindings<'_>) -> Quota {
    let written = written.map(Spanned::into_inner).unwrap_or_default();
    let default = Quota::default();
    let mut of = |value: Option<&Spanned<Value>>, default: u64| {
        value.map_or(default, |value| bytes(value, 1, 1 << 50, problems).unwrap_or(default))
    };
    let (reception, day) = (
        of(written.reception.as_ref(), default.reception),
        of(written.bytes.as_ref(), default.bytes),
    );
    let receptions = written.receptions.map_or(default.receptions, |count| {
        if *count.get_ref() == 0 {
            problems.add(count.span(), "receptions is 0", "give at least 1, or leave it out");
        }
        *count.get_ref()
    });
    Quota { reception, receptions, bytes: day }
}

fn buffer(written: Option<Spanned<written::Buffer>>, problems: &mut ConfigFindings<'_>) -> Buffer {
    let at = written.as_ref().map_or(0..0, Spanned::span);
    let written = written.map(Spanned::into_inner).unwrap_or_default();
    let mut given = |value: Option<&Spanned<Value>>, default: u64| match value {
        None => default as u32,
        Some(value) => bytes(value, 1, 1 << 24, problems).unwrap_or(default) as u32,
    };
    let size = given(written.size.as_ref(), 16_384);
    let low = given(written.low.as_ref(), u64::from(size / 4));
    let high = given(written.high.as_ref(), u64::from(size / 4 * 3));
    let room = high.saturating_sub(low).max(1);
    let packet = given(written.packet.as_ref(), u64::from((size / 16).clamp(1, room)));
    let buffer = Buffer { size, low, high, packet };
    if !(low < high && high <= size) {
        let message = format!("the marks do not fit: size {size}, low {low}, high {high}");
        problems.add(at, message, "low must be under high, and high at most the size");
    } else if packet > high - low {
        let message = format!("a packet of {packet} bytes does not fit between the marks");
        problems.add(at, message, format_args!("make it at most {}", high - low));
    }
    buffer
}

fn endpoint(
    written: &Spanned<written::Endpoint>,
    name: &str,
    taken: &mut Taken,
    problems: &mut ConfigFindings<'_>,
) -> Option<EndpointSetup> {
    let (at, written) = (written.span(), written.get_ref());
    let Some(text) = &written.listen else {
        let hint = "add listen = \"127.0.0.1:4001\"";
        problems.add(at, "the endpoint has no address", hint);
        return None;
    };
    let listen = address(text, problems)?;
    if listen.port() != 0
        && let Some(other) = taken.addresses.insert(listen, name.to_owned())
    {
        let message = format!("the endpoint of \"{other}\" listens on {listen} too");
        problems.add(text.span(), message, "give each endpoint a port of its own");
    }
    let kinds = [("raw", EndpointKind::Raw), ("rfc2217", EndpointKind::Rfc2217)];
    let answers = [("own", LineAnswer::Own), ("as-asked", LineAnswer::AsAsked)];
    let gap = optional_span(written.gap.as_ref(), problems);
    Some(EndpointSetup {
        listen,
        kind: choice(written.kind.as_ref(), &kinds, problems),
        gather: micros(optional_span(written.gather.as_ref(), problems).unwrap_or_default()),
        framing: gap.map_or(Framing::Stream, |gap| Framing::Gap(micros(gap))),
        line: choice(written.line.as_ref(), &answers, problems),
    })
}
