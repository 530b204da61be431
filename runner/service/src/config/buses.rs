//! The tables `[[bus]]`, read and checked.

use softplug_live::units::{BusRates, BusSetup};
use toml::{Spanned, Value};

use super::finding::ConfigFindings;
use super::link::is_name;
use super::written::{self, Text};

/// Most buses of one gateway.
const MOST: usize = 64;
/// Bits per second, data bits of all bits, and seconds that can be meant, as in `shop.toml`.
const RATES: std::ops::RangeInclusive<f64> = 1.0..=1e12;
const EFFICIENCIES: std::ops::RangeInclusive<f64> = 0.001..=1.0;
const SWITCHES: std::ops::RangeInclusive<f64> = 0.0..=60.0;

/// All buses. One with something wrong is kept as far as it has a name: links name it.
pub(super) fn all(
    written: &[Spanned<written::Bus>],
    problems: &mut ConfigFindings<'_>,
) -> Vec<BusSetup> {
    if let Some(bus) = written.get(MOST) {
        let message = format!("there are more than {MOST} buses");
        problems.add(bus.span(), message, "run a second gateway for the rest");
    }
    let mut buses: Vec<BusSetup> = Vec::new();
    for bus in written.iter().take(MOST) {
        let at = bus.span().start..bus.span().start;
        let written::Bus { name, rate, efficiency, switch } = bus.get_ref();
        let Some(name) = name else {
            problems.add(at, "this bus has no name", "add a line such as `name = \"can0\"`");
            continue;
        };
        let text = name.get_ref();
        if !is_name(text) {
            let message = format!("\"{}\" cannot name a bus", text.escape_debug());
            let hint = "use 1 to 64 letters, digits, dots, spaces, hyphens and underscores";
            problems.add(name.span(), message, hint);
        } else if buses.iter().any(|bus| bus.name == *text) {
            let message = format!("there are two buses \"{text}\"");
            problems.add(name.span(), message, "give each a name of its own");
        }
        let missing = |key: &str, example: &str, problems: &mut ConfigFindings<'_>| {
            let message = format!("the bus \"{}\" has no {key}", text.escape_debug());
            problems.add(at.clone(), message, format_args!("add a line such as `{example}`"));
            1.0
        };
        let rates = BusRates {
            rate: match rate {
                Some(rate) => number(rate, &RATES, "bits per second from 1 to 1e12", problems),
                None => missing("rate", "rate = 250_000", problems),
            },
            efficiency: match efficiency {
                Some(part) => {
                    let needs = "data bits of all bits, from 0.001 to 1";
                    number(part, &EFFICIENCIES, needs, problems)
                }
                None => missing("efficiency", "efficiency = 0.4", problems),
            },
            switch: match switch {
                Some(text) => span(text, problems),
                None => missing("switch", "switch = \"2ms\"", problems),
            },
        };
        buses.push(BusSetup { name: text.clone(), rates });
    }
    buses
}

fn number(
    value: &Spanned<Value>,
    range: &std::ops::RangeInclusive<f64>,
    needs: &str,
    problems: &mut ConfigFindings<'_>,
) -> f64 {
    let number = match value.get_ref() {
        Value::Integer(number) => Some(*number as f64),
        Value::Float(number) => Some(*number),
        _ => None,
    };
    number.filter(|number| range.contains(number)).unwrap_or_else(|| {
        let message = format!("{} does not do here", value.get_ref());
        problems.add(value.span(), message, format_args!("give {needs}"));
        1.0
    })
}

/// In seconds: a bus switches in less time than anything else here takes.
fn span(text: &Text, problems: &mut ConfigFindings<'_>) -> f64 {
    let given = text.get_ref();
    let split = given.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(given.len());
    let (number, unit) = given.split_at(split);
    let scale = match unit.trim_start() {
        "us" | "µs" => Some(1e6),
        "ms" => Some(1e3),
        "s" => Some(1.0),
        _ => None,
    };
    let seconds = number.parse::<f64>().ok().zip(scale).map(|(number, scale)| number / scale);
    seconds.filter(|seconds| SWITCHES.contains(seconds)).unwrap_or_else(|| {
        let message = format!("\"{}\" is no time to switch in", given.escape_debug());
        let hint =
            "give a number and a unit, such as \"250us\", \"2ms\" or \"0.5s\", at most \"60s\"";
        problems.add(text.span(), message, hint);
        0.0
    })
}
