//! `softplug unit`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use ed25519_dalek::pkcs8::DecodePrivateKey;
use ed25519_dalek::{Signer, SigningKey};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde::Serialize;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use softplug_host::{Digest, LoadError, lint, read_module};
use softplug_live::plain_text;
use softplug_live::units::{
    CanAddress, NoTlsKey, TlsKeys, TlsPrivateKey, UnitAddress, UnitClient, UnitClientError,
    UnitLinkSurvey, UnitPlace, UnitPlugin, UnitSlotSurvey, units_on_can,
};
use softplug_service::config::LogFormat;
use softplug_service::library::{Library, SIGNATURE_BYTES};
use softplug_service::{logs, systemd};
use softplug_unit::{Unit, UnitConfig, UnitError};
use softplug_unit_protocol::SlotState;
use softplug_unit_slots::{ToBeSigned, key_id};

use super::{Arguments, Configured, Flash, Key, Keys, List, Sign, Verb};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::global::Global;
use crate::numbers;
use crate::screen::{self, Screen};

/// How long a unit may take for an answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long units on a bus have to answer.
const FINDING: Duration = Duration::from_secs(3);

pub(crate) fn run(
    arguments: &Arguments,
    global: &Global,
    screen: &Screen,
) -> Result<Exit, Failure> {
    match &arguments.verb {
        Verb::Run(configured) => serve(configured, global, screen),
        Verb::Check(configured) => check(configured, screen),
        Verb::List(asked) => list(asked, screen),
        Verb::Flash(asked) => flash(asked, screen),
        Verb::Sign(asked) => sign(asked, screen),
        Verb::Key(asked) => key(asked, screen),
    }
}

/// The first line for machines.
#[derive(Serialize)]
struct Ready<'a> {
    event: &'static str,
    address: String,
    links: Vec<&'a str>,
}

#[derive(Serialize)]
struct Checked<'a> {
    result: &'static str,
    name: &'a str,
    serial: u64,
    links: Vec<&'a str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    remarks: Vec<String>,
}

#[derive(Serialize)]
struct Listed {
    units: Vec<ListedUnit>,
}

#[derive(Serialize)]
struct ListedUnit {
    address: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    serial: Option<String>,
    links: Vec<ListedLink>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

#[derive(Serialize)]
struct ListedLink {
    name: String,
    is_up: bool,
    has_job: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    runs: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    trouble: Option<String>,
    slots: Vec<ListedSlot>,
}

#[derive(Serialize)]
struct ListedSlot {
    slot: &'static str,
    state: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    length: u32,
    erased: u32,
    erasable: u32,
}

fn read_config(file: &Path) -> Result<UnitConfig, Failure> {
    UnitConfig::read(file).map_err(Failure::usage)
}

/// A file's name as it can be shown.
fn shown(file: &Path) -> String {
    plain_text(&file.display().to_string())
}

fn check(configured: &Configured, screen: &Screen) -> Result<Exit, Failure> {
    let config = read_config(&configured.file)?;
    config.look().map_err(|error| unit_failure(&error))?;
    let links: Vec<&str> = config.links.iter().map(|link| &*link.name).collect();
    let count = numbers::things(links.len() as u64, "link");
    screen.say(format_args!(
        "{} is right: the unit {}, {count}",
        shown(&configured.file),
        config.name
    ));
    let remarks = config.remarks();
    for remark in &remarks {
        screen.note(format_args!("note: {remark}"));
    }
    let (name, serial) = (&*config.name, config.serial);
    screen.document(&Checked { result: "right", name, serial, links, remarks });
    Ok(Exit::Done)
}

fn serve(configured: &Configured, global: &Global, screen: &Screen) -> Result<Exit, Failure> {
    let config = read_config(&configured.file)?;
    let format = if screen.is_json() { LogFormat::Json } else { LogFormat::Human };
    logs::start(format, &screen::log_filter(global, "info"), screen::log_colours(global));
    // Before the first thread: a signal that comes early is not lost.
    let mut signals = Signals::new([SIGTERM, SIGINT, SIGHUP]).map_err(|error| {
        Failure::internal(format_args!("failed to listen for signals: {error}"))
    })?;
    for remark in config.remarks() {
        tracing::warn!("{remark}");
    }
    let names: Vec<String> = config.links.iter().map(|link| link.name.clone()).collect();
    let unit = Unit::start(config, random()?).map_err(|error| unit_failure(&error))?;
    let (address, stop) = (unit.address().to_string(), unit.stop());
    thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for signal in signals.forever() {
                if signal == SIGHUP {
                    tracing::info!(
                        "SIGHUP is passed over: a unit reads its configuration at its start"
                    );
                } else {
                    stop.ask();
                }
            }
        })
        .map_err(|error| Failure::internal(format_args!("failed to start a thread: {error}")))?;
    let count = numbers::things(names.len() as u64, "link");
    screen.say(format_args!("{count}; gateways reach the unit at {address}"));
    let links = names.iter().map(String::as_str).collect();
    screen.json_line(&Ready { event: "ready", address, links });
    systemd::ready(&count);
    unit.run().map_err(|error| unit_failure(&error))?;
    screen.say("stopped");
    Ok(Exit::Done)
}

fn unit_failure(error: &UnitError) -> Failure {
    match error {
        UnitError::Memory { .. } | UnitError::State { .. } => Failure::usage(error),
        UnitError::Listen { .. } | UnitError::Port(_) => Failure::new(Exit::Port, error),
        UnitError::Host(_) => Failure::plug_in(error),
        UnitError::System { .. } => Failure::internal(error),
    }
}

/// A number that nobody else has.
fn random() -> Result<u64, Failure> {
    let mut bytes = [0; 8];
    fs::File::open("/dev/urandom")
        .and_then(|mut source| std::io::Read::read_exact(&mut source, &mut bytes))
        .map_err(|error| {
            Failure::internal(format_args!("no random number is to be had: {error}"))
        })?;
    Ok(u64::from_le_bytes(bytes))
}

fn list(asked: &List, screen: &Screen) -> Result<Exit, Failure> {
    let mut exit = Exit::Done;
    let mut units = Vec::new();
    let tls = tls(&asked.keys)?;
    for unit in places(&asked.units, screen)? {
        let tls = for_place(tls.as_ref(), &unit)?;
        let address = plain_text(&unit.to_string());
        let identity = random()?;
        let survey = UnitClient::connect(&unit, tls, identity, PATIENCE)
            .and_then(|mut client| client.survey());
        match survey {
            Ok(survey) => {
                screen.say(format_args!("{} at {address}", survey.name));
                for link in &survey.links {
                    screen.say(format_args!("  {}", link_line(link)));
                    for (name, slot) in ["A", "B"].into_iter().zip(&link.slots) {
                        screen.say(format_args!("    {name}  {}", slot_line(slot)));
                    }
                }
                units.push(ListedUnit {
                    address: address.clone(),
                    name: Some(survey.name),
                    serial: Some(format!("{:016x}", survey.serial)),
                    links: survey.links.iter().map(listed).collect(),
                    error: None,
                });
            }
            Err(error) => {
                exit = Exit::Port;
                screen.report_failure(&Failure::new(Exit::Port, &error));
                units.push(ListedUnit {
                    address: address.clone(),
                    name: None,
                    serial: None,
                    links: Vec::new(),
                    error: Some(error.to_string()),
                });
            }
        }
    }
    screen.document(&Listed { units });
    Ok(exit)
}

/// What a unit that wants TLS is shown, and what it must show.
fn tls(keys: &Keys) -> Result<Option<TlsKeys>, Failure> {
    let Some(file) = &keys.key else { return Ok(None) };
    let own = TlsPrivateKey::read(file).map_err(Failure::usage)?;
    let units = keys.unit_keys.iter().map(|text| {
        let wrong = format_args!("`--unit-key {}` is no public key", text.escape_debug());
        text.parse().map_err(|NoTlsKey| Failure::usage(wrong).hint(NoTlsKey::WRITE))
    });
    let units = units.collect::<Result<Vec<_>, _>>()?;
    Ok(Some(TlsKeys::of_gateway(&own, &units)))
}

fn for_place<'a>(
    tls: Option<&'a TlsKeys>,
    place: &UnitPlace,
) -> Result<Option<&'a TlsKeys>, Failure> {
    match place {
        UnitPlace::Can(address) if tls.is_some() => Err(Failure::usage(format_args!(
            "{address} is on a CAN bus, and TLS goes over TCP only"
        ))
        .hint("leave --key and --unit-key out")),
        _ => Ok(tls),
    }
}

/// Units as they were asked for; of a CAN interface, all that answer.
fn places(asked: &[String], screen: &Screen) -> Result<Vec<UnitPlace>, Failure> {
    let mut places = Vec::new();
    for text in asked {
        if let Ok(place) = text.parse() {
            places.push(place);
        } else if text.contains([':', '/']) || CanAddress::new(text, 1).is_err() {
            let what = format_args!("`{}` is no unit and no bus", text.escape_debug());
            return Err(Failure::usage(what).hint("write it as 10.0.0.17:7640, can0/17 or can0"));
        } else if !Path::new("/sys/class/net").join(text).exists() {
            let what = format_args!("this computer has no network interface {text}");
            return Err(Failure::usage(what).hint("write it as 10.0.0.17:7640, can0/17 or can0"));
        } else {
            let found = units_on_can(text, random()?, FINDING)
                .map_err(|error| Failure::new(Exit::Port, format_args!("{text}: {error}")))?;
            if found.is_empty() {
                screen.say(format_args!("no unit answers on {text}"));
            }
            places.extend(found.into_iter().map(UnitPlace::Can));
        }
    }
    Ok(places)
}

fn link_line(link: &UnitLinkSurvey) -> String {
    let UnitLinkSurvey { name, is_up, runs, has_job, trouble, .. } = link;
    let mut line = format!("{name}: {}", if *is_up { "up" } else { "down" });
    match runs {
        Some(digest) => {
            let _ = write!(line, ", runs {:.12}", hex(digest));
        }
        None => line.push_str(", runs nothing"),
    }
    if *has_job {
        line.push_str(", a job is under way");
    }
    if let Some(trouble) = trouble {
        let _ = write!(line, ": {trouble}");
    }
    line
}

fn slot_line(slot: &UnitSlotSurvey) -> String {
    let UnitSlotSurvey { state, length, digest, erased, erasable } = *slot;
    let wear = format!("erased {erased} of {erasable} times");
    match state {
        SlotState::Empty => format!("{}; {wear}", state_name(state)),
        _ => format!("{} {:.12}, {length} bytes; {wear}", state_name(state), hex(&digest)),
    }
}

fn listed(link: &UnitLinkSurvey) -> ListedLink {
    let slots = ["A", "B"].into_iter().zip(&link.slots).map(|(name, slot)| ListedSlot {
        slot: name,
        state: state_name(slot.state),
        sha256: (slot.state != SlotState::Empty).then(|| hex(&slot.digest)),
        length: slot.length,
        erased: slot.erased,
        erasable: slot.erasable,
    });
    ListedLink {
        name: link.name.clone(),
        is_up: link.is_up,
        has_job: link.has_job,
        runs: link.runs.as_ref().map(hex),
        trouble: link.trouble.clone(),
        slots: slots.collect(),
    }
}

fn state_name(state: SlotState) -> &'static str {
    match state {
        SlotState::Empty => "empty",
        SlotState::Writing => "writing",
        SlotState::Written => "written",
        SlotState::OnTrial => "on trial",
        SlotState::Confirmed => "confirmed",
        SlotState::Failed => "failed",
    }
}

fn hex(bytes: &[u8; 32]) -> String {
    Digest::from_bytes(*bytes).to_string()
}

fn flash(asked: &Flash, screen: &Screen) -> Result<Exit, Failure> {
    let address: UnitAddress = asked.unit.parse().map_err(|_| {
        Failure::usage(format_args!("`{}` is no link of a unit", asked.unit.escape_debug()))
            .hint("write it as unit://10.0.0.17:7640/mill-7 or unit://can0/17/mill-7")
    })?;
    let tls = tls(&asked.keys)?;
    let tls = for_place(tls.as_ref(), &address.unit)?;
    let module = read_plugin(&asked.plugin)?;
    let signature = asked.signature.as_deref().map(read_signature).transpose()?;
    let settings = asked.settings.iter().map(|text| {
        let (name, value) = text.split_once('=').ok_or_else(|| {
            Failure::usage(format_args!("`{}` is no setting", text.escape_debug()))
                .hint("write it as name=value")
        })?;
        Ok((name.to_owned(), value.to_owned()))
    });
    let settings = settings.collect::<Result<Vec<_>, Failure>>()?;
    let digest = *Digest::of(&module).as_bytes();
    let length = module.len() as u64;
    let plugin = UnitPlugin { module: module.into(), digest, signature, settings };
    let bar = if screen.shows_progress() {
        ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr())
    } else {
        ProgressBar::hidden()
    };
    let link = address.link.as_deref();
    let name = link.map_or_else(|| plain_text(&address.to_string()), str::to_owned);
    let connected = UnitClient::connect(&address.unit, tls, random()?, PATIENCE);
    let flashed = connected.and_then(|mut client| {
        client.flash(link, &plugin, |until| bar.set_position(u64::from(until)))
    });
    bar.finish_and_clear();
    let was_downloaded = flashed.map_err(|error| match error {
        UnitClientError::NotTaken { .. } => Failure::plug_in(&error),
        UnitClientError::NotRun { .. } => Failure::new(Exit::Failed, &error),
        UnitClientError::NoLink { .. } | UnitClientError::WhichLink { .. } => {
            Failure::usage(&error)
        }
        _ => Failure::new(Exit::Port, &error),
    })?;
    let what = if was_downloaded { "downloaded" } else { "was there" };
    screen.say(format_args!("{name} runs {:.12}: {what}", hex(&digest)));
    screen.document(&Flashed { link: &name, sha256: hex(&digest), downloaded: was_downloaded });
    Ok(Exit::Done)
}

#[derive(Serialize)]
struct Flashed<'a> {
    link: &'a str,
    sha256: String,
    downloaded: bool,
}

#[derive(Serialize)]
struct Signed {
    sha256: String,
    key: String,
}

fn read_plugin(file: &Path) -> Result<Vec<u8>, Failure> {
    let module = read_module(file).map_err(|error| match error {
        LoadError::TooLarge { .. } => Failure::plug_in(error),
        _ => Failure::usage(error),
    })?;
    lint(&module).map_err(|error| Failure::plug_in(format_args!("{}: {error}", shown(file))))?;
    Ok(module)
}

fn read_signature(file: &Path) -> Result<Box<[u8]>, Failure> {
    let bytes = files::read(file)?;
    if bytes.len() != SIGNATURE_BYTES {
        let (shown, count) = (shown(file), bytes.len());
        let text =
            format_args!("{shown} is no signature: it has {count} bytes, not {SIGNATURE_BYTES}");
        return Err(Failure::usage(text).hint("make one with `softplug unit sign`"));
    }
    Ok(bytes.into())
}

fn sign(asked: &Sign, screen: &Screen) -> Result<Exit, Failure> {
    let module = read_plugin(&asked.plugin)?;
    let pem = files::read_text(&asked.key)?;
    let key = SigningKey::from_pkcs8_pem(&pem).map_err(|error| {
        Failure::usage(format_args!("{} is no private Ed25519 key: {error}", shown(&asked.key)))
            .hint("make one with `openssl genpkey -algorithm ed25519`")
    })?;
    let digest = Digest::of(&module);
    let to_be_signed = ToBeSigned::new(module.len() as u32, digest.as_bytes());
    let id = key_id(&key.verifying_key().to_bytes());
    let mut signature = id.to_vec();
    signature.extend_from_slice(&key.sign(to_be_signed.as_bytes()).to_bytes());
    if let Some(output) = &asked.output {
        fs::write(output, &signature).map_err(|error| files::unwritable(output, &error))?;
        screen.say(format_args!("{} signs {digest:.12}", shown(output)));
    }
    if let Some(folder) = &asked.library {
        Library::existing(folder)
            .and_then(|library| library.keep_signature(digest, &signature))
            .map_err(Failure::usage)?;
        screen.say(format_args!("the library {} has the signature", shown(folder)));
    }
    screen.document(&Signed { sha256: digest.to_string(), key: hex(&id) });
    Ok(Exit::Done)
}

#[derive(Serialize)]
struct Shown<'a> {
    file: String,
    public: &'a str,
}

fn key(asked: &Key, screen: &Screen) -> Result<Exit, Failure> {
    let file = &asked.file;
    let key = if asked.show { TlsPrivateKey::read(file) } else { TlsPrivateKey::make(file) };
    let public = key.map_err(Failure::usage)?.public().to_string();
    screen.say(&public);
    screen.document(&Shown { file: file.display().to_string(), public: &public });
    Ok(Exit::Done)
}
