//! `shop.toml`: a shop as people write it down. Everything in it is taken as hostile.

use std::ops::Range;

use serde::Deserialize;
use toml::{Spanned, Value};

use crate::error::{Place, ShopError, Wrong};
use crate::shop::{
    Bus, DEFAULT_MARGIN, Machine, Shop, check_bus, check_machine, check_together, number,
};
use crate::span;

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
            let hint = hint(&message);
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
    let count = keys.count.as_ref().map(|value| whole("count", value)).transpose()?;
    let machine = Machine {
        name: keys.name.get_ref().clone(),
        rate: real("rate", &keys.rate)?,
        efficiency: real("efficiency", &keys.efficiency)?,
        consumes: real("consumes", &keys.consumes)?,
        buffer: whole("buffer", &keys.buffer)?,
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

fn whole(key: &'static str, value: &Spanned<Value>) -> Result<u64, Found> {
    let wrong = |shown: String| {
        (
            value.span(),
            Wrong::Value { key, value: shown, needs: "a whole number above 0".to_owned() },
        )
    };
    match value.get_ref() {
        Value::Integer(number) => u64::try_from(*number).map_err(|_| wrong(number.to_string())),
        Value::Float(float) => Err(wrong(number(*float))),
        other => Err(of_kind(key, value, other.type_str(), "a whole number above 0")),
    }
}

fn switch(value: &Spanned<Value>) -> Result<f64, Found> {
    let wrong = |shown: String| {
        (value.span(), Wrong::Value { key: "switch", value: shown, needs: span::FORM.to_owned() })
    };
    match value.get_ref() {
        Value::String(text) => span::seconds(text).ok_or_else(|| {
            let begin: String = text.chars().take(32).collect();
            wrong(format!("\"{}\"", begin.escape_debug()))
        }),
        Value::Integer(number) => Err(wrong(format!("{number} without a unit"))),
        other => Err(of_kind("switch", value, other.type_str(), span::FORM)),
    }
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
