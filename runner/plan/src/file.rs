//! `shop.toml`: a shop as people write it down. Everything in it is taken as hostile.

use std::ops::Range;

use serde::Deserialize;
use toml::{Spanned, Value};

use crate::error::{Place, ShopError, Wrong};
use crate::limits::{DEFAULT_MARGIN, MOST_SWITCH};
use crate::shop::{
    BUFFER, Bus, COUNT, Machine, SWITCH_NEEDS, Shop, WholeRange, check_bus, check_machine,
    check_together, number,
};
use crate::span::{self, NoSpan};

/// Most bytes of a file that are read. Longer ones are refused before they are parsed.
pub const MOST_FILE_BYTES: usize = 256 << 10;

impl Shop {
    /// Reads a `shop.toml`.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong, with its place: no TOML, a key that is not known, a number
    /// that cannot be meant, a name that cannot be shown or is there twice, no machine or too many,
    /// more than [`MOST_FILE_BYTES`].
    pub fn parse(text: &str) -> Result<Self, ShopError> {
        if text.len() > MOST_FILE_BYTES {
            let wrong = Wrong::TooLong { bytes: text.len(), most: MOST_FILE_BYTES };
            return Err(ShopError { place: None, wrong });
        }
        let at =
            |span: Range<usize>, wrong| ShopError { place: Some(place(text, span.start)), wrong };
        let file: File = toml::from_str(text).map_err(|error| {
            let message = one_line(error.message());
            let (message, hint) = too_large(&message).unwrap_or_else(|| {
                let hint = hint(&message);
                (message, hint)
            });
            at(error.span().unwrap_or_default(), Wrong::Form { message, hint })
        })?;
        let bus = bus(&file.bus).map_err(|(span, wrong)| at(span, wrong))?;
        let mut machines = Vec::with_capacity(file.machine.len());
        for written in &file.machine {
            machines.push(machine(written).map_err(|(span, wrong)| at(span, wrong))?);
        }
        check_together(&machines).map_err(|(index, wrong)| {
            at(file.machine.get(index).map_or(0..0, |written| written.get_ref().name.span()), wrong)
        })?;
        Self::new(bus, machines)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    bus: Spanned<BusKeys>,
    #[serde(default)]
    machine: Vec<Spanned<MachineKeys>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BusKeys {
    rate: Spanned<Value>,
    efficiency: Spanned<Value>,
    switch: Spanned<Value>,
    margin: Option<Spanned<Value>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MachineKeys {
    name: Spanned<String>,
    rate: Spanned<Value>,
    efficiency: Spanned<Value>,
    consumes: Spanned<Value>,
    buffer: Spanned<Value>,
    count: Option<Spanned<Value>>,
}

/// What is wrong, and where it stands.
type Found = (Range<usize>, Wrong);

fn bus(written: &Spanned<BusKeys>) -> Result<Bus, Found> {
    let keys = written.get_ref();
    let margin = keys.margin.as_ref().map(|value| real("margin", value)).transpose()?;
    let bus = Bus {
        rate: real("rate", &keys.rate)?,
        efficiency: real("efficiency", &keys.efficiency)?,
        switch: switch(&keys.switch)?,
        margin: margin.unwrap_or(DEFAULT_MARGIN),
    };
    let span = |key: &str| match key {
        "rate" => keys.rate.span(),
        "efficiency" => keys.efficiency.span(),
        "switch" => keys.switch.span(),
        _ => keys.margin.as_ref().map_or(written.span(), Spanned::span),
    };
    check_bus(&bus).map_err(|wrong| (wrong.key().map_or(written.span(), span), wrong))?;
    Ok(bus)
}

fn machine(written: &Spanned<MachineKeys>) -> Result<Machine, Found> {
    let keys = written.get_ref();
    let count = keys.count.as_ref().map(|value| whole("count", value, &COUNT)).transpose()?;
    let machine = Machine {
        name: keys.name.get_ref().clone(),
        rate: real("rate", &keys.rate)?,
        efficiency: real("efficiency", &keys.efficiency)?,
        consumes: real("consumes", &keys.consumes)?,
        buffer: whole("buffer", &keys.buffer, &BUFFER)?,
        count: count.unwrap_or(1),
    };
    let span = |key: &str| match key {
        "rate" => keys.rate.span(),
        "efficiency" => keys.efficiency.span(),
        "consumes" => keys.consumes.span(),
        "buffer" => keys.buffer.span(),
        _ => keys.count.as_ref().map_or(written.span(), Spanned::span),
    };
    check_machine(&machine)
        .map_err(|wrong| (wrong.key().map_or_else(|| keys.name.span(), span), wrong))?;
    Ok(machine)
}

impl Wrong {
    /// The key whose value is wrong.
    fn key(&self) -> Option<&'static str> {
        match self {
            Self::Value { key, .. } => Some(key),
            _ => None,
        }
    }
}

fn real(key: &'static str, value: &Spanned<Value>) -> Result<f64, Found> {
    match value.get_ref() {
        Value::Integer(number) => Ok(*number as f64),
        Value::Float(number) => Ok(*number),
        other => Err(of_kind(key, value, other.type_str(), "a number")),
    }
}

fn whole(key: &'static str, value: &Spanned<Value>, range: &WholeRange) -> Result<u64, Found> {
    let wrong = |value_shown: String, needs: String| {
        (value.span(), Wrong::Value { key, value: value_shown, needs })
    };
    let needs = || range.needs.to_owned();
    match value.get_ref() {
        Value::Integer(number) => {
            u64::try_from(*number).map_err(|_| wrong(number.to_string(), needs()))
        }
        // The whole number that is meant, in another form.
        Value::Float(float)
            if float.fract() == 0.0 && (1.0..=range.most as f64).contains(float) =>
        {
            let needs = format!("{float}, without decimal point and exponent");
            Err(wrong(format!("{float:?}"), needs))
        }
        Value::Float(float) => Err(wrong(number(*float), needs())),
        other => Err(of_kind(key, value, other.type_str(), range.needs)),
    }
}

fn switch(value: &Spanned<Value>) -> Result<f64, Found> {
    let wrong = |shown: String, needs: &str| {
        (value.span(), Wrong::Value { key: "switch", value: shown, needs: needs.to_owned() })
    };
    match value.get_ref() {
        Value::String(text) => match span::seconds(text) {
            Ok(seconds) if seconds <= MOST_SWITCH => Ok(seconds),
            Ok(_) | Err(NoSpan::Large) => Err(wrong(quoted(text), SWITCH_NEEDS)),
            Err(NoSpan::Form) => Err(wrong(quoted(text), span::FORM)),
        },
        Value::Integer(number) => Err(wrong(format!("{number} without a unit"), span::FORM)),
        other => Err(of_kind("switch", value, other.type_str(), span::FORM)),
    }
}

/// The beginning of a text, in quotes and escaped.
fn quoted(text: &str) -> String {
    const MOST: usize = 32;
    let begin: String = text.chars().take(MOST).collect();
    let more = if begin.len() < text.len() { "…" } else { "" };
    format!("\"{}{more}\"", begin.escape_debug())
}

fn of_kind(key: &'static str, value: &Spanned<Value>, kind: &str, needs: &str) -> Found {
    let article = if kind.starts_with(['a', 'i']) { "an" } else { "a" };
    let needs = needs.to_owned();
    (value.span(), Wrong::Value { key, value: format!("{article} {kind}"), needs })
}

/// The parser's message, on one line and not longer than a line can be.
fn one_line(message: &str) -> String {
    const MOST: usize = 300;
    let plain = message.trim().chars().map(|c| if c.is_control() { ' ' } else { c });
    plain.take(MOST).collect()
}

/// What is said instead where the parser says that a whole number has more than the 64 bits of
/// TOML, or more than itself can hold.
fn too_large(message: &str) -> Option<(String, String)> {
    const MOST: usize = 32;
    let hint = "docs/plan.md says from what to what each number may be".to_owned();
    if message == "integer number overflowed" {
        return Some(("the number is too large".to_owned(), hint));
    }
    if !message.ends_with("expected any valid TOML value") {
        return None;
    }
    let number = message.strip_prefix("invalid type: integer `")?.split('`').next()?;
    let begin: String = number.chars().take(MOST).collect();
    let more = if begin.len() < number.len() { "…" } else { "" };
    let how = if number.starts_with('-') { "is too far below 0" } else { "is too large" };
    Some((format!("the number {begin}{more} {how}"), hint))
}

/// What to do about what the parser says.
fn hint(message: &str) -> String {
    let mut names = message.split('`').skip(1).step_by(2);
    if message.starts_with("unknown field") {
        let name = names.next().unwrap_or_default().to_lowercase();
        let known: Vec<_> = names.collect();
        let likeness = |known: &&&str| strsim::jaro_winkler(&name, known);
        let best = known.iter().max_by(|one, other| likeness(one).total_cmp(&likeness(other)));
        return match best.filter(|known| likeness(known) > 0.8) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("known here: {}", known.join(", ")),
        };
    }
    if message.starts_with("missing field") {
        return match names.next().unwrap_or_default() {
            "bus" => "add a table [bus]".to_owned(),
            name => format!("add a line `{name} = …` to this table"),
        };
    }
    if message.starts_with("duplicate key") {
        return "keep one of the two".to_owned();
    }
    if message.contains("expected a sequence") {
        return "write [[machine]], with two brackets on each side".to_owned();
    }
    if let Some((_, expected)) =
        message.rsplit_once("expected ").filter(|(_, it)| it.starts_with('a'))
    {
        return format!("write {expected} here");
    }
    "docs/plan.md says what may stand here".to_owned()
}

fn place(text: &str, at: usize) -> Place {
    // Errors at the very end may point one past it.
    let before = text.get(..at).unwrap_or(text);
    let begin = before.rfind('\n').map_or(0, |newline| newline + 1);
    Place { line: before.matches('\n').count() + 1, column: before[begin..].chars().count() + 1 }
}
