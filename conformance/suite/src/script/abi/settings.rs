//! Settings as the manifest allows them, and as it does not; states that nobody saved.

use super::super::case::Script;
use super::super::context::ScriptContext;
use super::super::failure::{Outcome, diverged, not_applicable};
use crate::run::erased::{Boxed, Erased};
use crate::run::fault::WatchedFault;
use crate::run::fault::{Fault, FaultClass};
use crate::run::watched::{Meter, Watched};
use softplug_abi::limits::{INPUT_BYTES, OUTPUT_ROUNDS, VALUE_BYTES};
use softplug_abi::manifest::{Manifest, SettingValues, ValueType};
use softplug_abi::{Event, Instance, LineParameters, Micros, Refusal, Value, ValueWriter, Values};
use softplug_host::SessionFault;
use softplug_link::LinkFault;
use std::rc::Rc;

pub(super) fn scripts() -> Vec<Script> {
    let script = |slug: &str, title, clause, scenario: fn(&mut ScriptContext<'_>) -> Outcome| {
        Script::new("abi", format!("abi.settings.{slug}"), title, &[clause], scenario)
    };
    vec![
        script(
            "defaults-and-presets",
            "The defaults and every preset are taken, and the link opens and closes with them",
            "abi.settings.accepted",
            defaults_and_presets,
        ),
        script(
            "ends-of-ranges",
            "Each setting at both ends of its range: taken or refused",
            "abi.settings.in-range",
            ends_of_ranges,
        ),
        script(
            "malformed",
            "Values out of range, of another type, unknown, missing or twice: no trap",
            "abi.settings.malformed",
            malformed,
        ),
        Script::new(
            "abi",
            "abi.state.garbage",
            "States that nobody saved: refused or taken, no trap",
            &["abi.state.refused"],
            garbage_states,
        ),
    ]
}

type Player<'a> = Watched<Erased<'a>>;

fn start<'a>(context: &ScriptContext<'a>) -> Outcome<Player<'a>> {
    let started = Watched::start(&context.subject, Rc::new(Meter::default()));
    Ok(started.map_err(|error| Fault::new(FaultClass::NotStarted, Micros::ZERO, &error))?)
}

/// Gives one event with all its output; whether it was taken or refused. All else
/// fails the script.
fn give(player: &mut Player<'_>, event: &Event<'_>) -> Outcome<Result<(), Refusal>> {
    gather(player, event, &mut Vec::new())
}

/// As [`give`]; the encoded actions are added to those before.
fn gather(
    player: &mut Player<'_>,
    event: &Event<'_>,
    actions: &mut Vec<u8>,
) -> Outcome<Result<(), Refusal>> {
    let mut asked = event;
    for _ in 0..=OUTPUT_ROUNDS {
        let stepped = player.step(asked, Micros::ZERO).map(|output| {
            actions.extend_from_slice(output.actions);
            output.more
        });
        match stepped {
            Ok(true) => asked = &Event::Continue,
            Ok(false) => return Ok(Ok(())),
            Err(fault) => {
                if let Some(refusal) = refusal(&fault) {
                    return Ok(Err(refusal));
                }
                let fault = LinkFault::Instance { event: event.kind(), source: fault };
                return Err(Fault::of_link(Micros::ZERO, &fault).into());
            }
        }
    }
    Err(diverged(Micros::ZERO, format!("its answer to {} has no end", event.kind()), "", ""))
}

/// Native code says it in its own words: whatever is no panic is a refusal there.
fn refusal(fault: &WatchedFault<Boxed>) -> Option<Refusal> {
    let WatchedFault::Instance(Boxed(fault)) = fault else { return None };
    match fault.downcast_ref::<SessionFault>() {
        Some(fault) => fault.refusal(),
        None => Some(Refusal::Settings),
    }
}

fn give_all(player: &mut Player<'_>, values: &SettingValues) -> Outcome<Result<(), Refusal>> {
    let capacity = player.input_capacity();
    let mut fault = None;
    let given = values.pieces(capacity, |event| match give(player, event) {
        Ok(answer) => answer.map_err(Some),
        Err(failure) => {
            fault = Some(failure);
            Err(None)
        }
    });
    match (fault, given) {
        (Some(failure), _) => Err(failure),
        (None, given) => Ok(given.map_err(|refusal| refusal.unwrap_or(Refusal::Settings))),
    }
}

/// Each value in an event of its own, as a host may: all pieces are of whole records.
fn give_singly(player: &mut Player<'_>, values: &SettingValues) -> Outcome<Result<(), Refusal>> {
    let all = values.as_slice();
    let Some(last) = all.len().checked_sub(1) else { return give_all(player, values) };
    for (at, value) in all.iter().enumerate() {
        let mut buffer = [0; *INPUT_BYTES.start() as usize];
        let mut writer = ValueWriter::new(&mut buffer);
        if writer.push(at as u16, value.as_value()).is_err() {
            return Err(not_applicable(&"a value is larger than any event"));
        }
        let (first, last) = (at == 0, at == last);
        let event = Event::Settings { first, last, values: Values::new(writer.written()) };
        if let Err(refusal) = give(player, &event)? {
            return Ok(Err(refusal));
        }
    }
    Ok(Ok(()))
}

/// Opens and closes with what was given.
fn open_and_close(player: &mut Player<'_>) -> Outcome {
    open_save_and_close(player, false).map(drop)
}

/// Opens, saves if it is asked for, and closes: all actions of that, encoded.
fn open_save_and_close(player: &mut Player<'_>, saves: bool) -> Outcome<Vec<u8>> {
    let line = LineParameters::new(9_600);
    let (transmit_room, delivery_room) = (4_096, 4_096);
    let open = Event::Open { resumed: false, line, transmit_room, delivery_room };
    let mut actions = Vec::new();
    for event in [open, Event::Save, Event::Close] {
        if event == Event::Save && !saves {
            continue;
        }
        if let Err(refusal) = gather(player, &event, &mut actions)? {
            let message = format!("{} must be taken", event.kind());
            return Err(diverged(Micros::ZERO, message, "taken", refusal.text()));
        }
    }
    Ok(actions)
}

fn defaults_and_presets(context: &mut ScriptContext<'_>) -> Outcome {
    let manifest = context.manifest();
    let presets = manifest.presets.iter().map(|preset| Some(preset.name.as_str()));
    for preset in std::iter::once(None).chain(presets) {
        let asked = preset.map(|name| ("preset", name));
        let values = manifest.resolve_settings(asked).map_err(|error| not_applicable(&error))?;
        let mut player = start(context)?;
        let words = preset.map_or("the defaults".to_owned(), |name| format!("the preset {name}"));
        if let Err(refusal) = give_all(&mut player, &values)? {
            let message = format!("{words} must be taken");
            return Err(diverged(Micros::ZERO, message, "taken", refusal.text()));
        }
        let saves = manifest.state.saves.is_some();
        let whole = open_save_and_close(&mut player, saves)?;
        let mut player = start(context)?;
        if let Err(refusal) = give_singly(&mut player, &values)? {
            let message = format!("{words}, each value in an event of its own, must be taken");
            return Err(diverged(Micros::ZERO, message, "taken", refusal.text()));
        }
        if open_save_and_close(&mut player, saves)? != whole {
            let message = format!("{words}, each value in an event of its own");
            return Err(diverged(Micros::ZERO, message, "as with all in one", "otherwise"));
        }
        context.log.push(format!("{words}: taken"));
    }
    Ok(())
}

fn ends_of_ranges(context: &mut ScriptContext<'_>) -> Outcome {
    let manifest = context.manifest();
    for setting in &manifest.settings {
        let (min, max) = (setting.min, setting.max);
        let texts: Vec<String> = match setting.kind {
            ValueType::Bool => vec!["on".to_owned(), "off".to_owned()],
            ValueType::Int => [min.or(Some(i64::MIN)), max.or(Some(i64::MAX))]
                .into_iter()
                .flatten()
                .map(|end| end.to_string())
                .collect(),
            ValueType::Choice => setting.choices.clone(),
            ValueType::Text | ValueType::Bytes => {
                let byte = if setting.kind == ValueType::Text { "x" } else { "5A" };
                let lengths = [min.unwrap_or(0), max.unwrap_or(VALUE_BYTES as i64)];
                lengths.map(|length| byte.repeat(usize::try_from(length).unwrap_or(0))).to_vec()
            }
        };
        for text in texts {
            let asked = [(setting.name.as_str(), text.as_str())];
            let values =
                manifest.resolve_settings(asked).map_err(|error| not_applicable(&error))?;
            let mut player = start(context)?;
            let answer = give_all(&mut player, &values)?;
            if answer.is_ok() {
                open_and_close(&mut player)?;
            }
            let words = if answer.is_ok() { "taken" } else { "refused" };
            context.log.push(format!("{} at an end of its range: {words}", setting.name));
        }
    }
    Ok(())
}

fn malformed(context: &mut ScriptContext<'_>) -> Outcome {
    for (words, records) in wrong_records(context.manifest()) {
        let mut player = start(context)?;
        let event = Event::Settings { first: true, last: true, values: Values::new(&records) };
        let answer = give(&mut player, &event)?;
        let answer = if answer.is_ok() { "passed over" } else { "refused" };
        context.log.push(format!("{words}: {answer}"));
    }
    Ok(())
}

/// Records that no manifest of these settings allows.
fn wrong_records(manifest: &Manifest) -> Vec<(String, Vec<u8>)> {
    let mut all = vec![
        ("no values at all".to_owned(), Vec::new()),
        ("half a record".to_owned(), vec![0, 0, 2]),
        ("a record longer than what follows".to_owned(), vec![0, 0, 2, 0, 8, 0, 1]),
    ];
    let mut add = |words: String, values: &[(u16, Value<'_>)]| {
        let mut buffer = [0; 2_048];
        let mut writer = ValueWriter::new(&mut buffer);
        if values.iter().all(|(index, value)| writer.push(*index, *value).is_ok()) {
            all.push((words, writer.written().to_vec()));
        }
    };
    add("a setting that there is not".to_owned(), &[(999, Value::Int(1))]);
    for (place, setting) in manifest.settings.iter().enumerate() {
        let place = place as u16;
        let name = &setting.name;
        for number in [i64::MIN, -1, 0, i64::MAX] {
            add(format!("{name} as the number {number}"), &[(place, Value::Int(number))]);
        }
        add(format!("{name} as choice 65535"), &[(place, Value::Choice(u16::MAX))]);
        let long = "x".repeat(VALUE_BYTES);
        add(format!("{name} as a long text"), &[(place, Value::Text(&long))]);
        add(format!("{name} as no bytes"), &[(place, Value::Bytes(&[]))]);
        add(format!("{name} twice"), &[(place, Value::Int(1)), (place, Value::Int(1))]);
    }
    all
}

fn garbage_states(context: &mut ScriptContext<'_>) -> Outcome {
    let manifest = context.manifest();
    let values = manifest.resolve_settings([]).map_err(|error| not_applicable(&error))?;
    for &format in &manifest.state.accepts {
        for length in [0, 1, 7, 64, 200, 500] {
            for fill in [0x00, 0x01, 0x7F, 0xFF] {
                let bytes = vec![fill; length];
                let mut player = start(context)?;
                if give_all(&mut player, &values)?.is_err() {
                    return Ok(());
                }
                let total = length as u32;
                let event = Event::Restore { format, offset: 0, total, bytes: &bytes };
                let answer = give(&mut player, &event)?;
                let words = if answer.is_ok() { "taken" } else { "refused" };
                context.log.push(format!("{length} bytes {fill:02X} of format {format}: {words}"));
            }
        }
    }
    Ok(())
}
