//! Settings that make no sense together: refused before the link opens.

use super::case::Script;
use super::context::ScriptContext;
use super::failure::{Outcome, diverged};
use super::setup::Setup;
use crate::run::class::Class;
use crate::run::fault::FaultClass;
use softplug_abi::{LineParameters, Micros};
use softplug_machines::script::Script as Machine;

type Settings = &'static [(&'static str, &'static str)];

/// Settings that must be refused, and such that differ from them in one place and must be taken.
type Pair = (Settings, Settings);

const XON_XOFF: &[Pair] = &[
    (&[("xon", "17"), ("xoff", "17")], &[("xon", "17"), ("xoff", "18")]),
    (
        &[("xon", "17"), ("xoff", "145"), ("parity_mask", "127")],
        &[("xon", "17"), ("xoff", "145"), ("parity_mask", "255")],
    ),
    (
        &[("transparent", "on"), ("parity_mask", "63")],
        &[("transparent", "on"), ("parity_mask", "127")],
    ),
    (&[("transparent", "on"), ("escape", "19")], &[("transparent", "off"), ("escape", "19")]),
    (&[("transparent", "on"), ("escape_xor", "2")], &[("transparent", "on"), ("escape_xor", "64")]),
];

const FANUC_RS232: &[Pair] = &[
    (&[("replace", "41")], &[("replace", "41 42")]),
    (&[("replace", "41 42 43")], &[("replace", "41 42 43 44")]),
    (&[("eia_codes", "5B")], &[("eia_codes", "5B 23")]),
    (&[("mode", "remote-a"), ("code", "eia")], &[("mode", "remote-a"), ("code", "iso")]),
    (
        &[("mode", "remote-a"), ("packet_end", "cr"), ("eob", "crlf")],
        &[("mode", "remote-a"), ("packet_end", "cr"), ("eob", "lf")],
    ),
    (&[("request_pattern", "O")], &[("request_pattern", "O*")]),
    (&[("request_pattern", "O**")], &[("request_pattern", "*")]),
];

pub(super) fn scripts() -> Vec<Script> {
    [
        ("xon-xoff", "xon-xoff.link.settings", XON_XOFF),
        ("fanuc-rs232", "fanuc-rs232.link.settings", FANUC_RS232),
    ]
    .map(|(profile, clause, pairs)| {
        let title = "Settings that make no sense together are refused, and others are not";
        let id = format!("{profile}.loop.settings");
        Script::new(profile, id, title, &[clause], move |context| {
            for (senseless, sound) in pairs {
                tried(context, senseless, "refused")?;
                tried(context, sound, "taken")?;
            }
            Ok(())
        })
    })
    .into()
}

/// Opens a link with these settings. Such as the plug-in does not have are passed over.
fn tried(context: &mut ScriptContext<'_>, settings: Settings, expected: &str) -> Outcome {
    let setup = Setup::new(LineParameters::new(9_600), settings);
    let words: Vec<_> = settings.iter().map(|(name, value)| format!("{name}={value}")).collect();
    let words = words.join(" ");
    if setup.options(context.manifest()).is_err() {
        context.log.push(format!("{words}: not there"));
        return Ok(());
    }
    let observed = match context.play(&setup, Machine::new(Vec::new(), Vec::new()), |_| Ok(())) {
        Ok(()) => "taken",
        Err(failure) if failure.class == Class::Fault(FaultClass::SettingsRefused) => "refused",
        Err(failure) => return Err(failure),
    };
    context.log.push(format!("{words}: {observed}"));
    if observed == expected {
        return Ok(());
    }
    Err(diverged(Micros::ZERO, format!("the settings {words}"), expected, observed))
}
