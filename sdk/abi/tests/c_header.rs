//! The constants of `sdk/c/softplug.h` and `sdk/assemblyscript/softplug.ts` are those of this
//! crate: none differs, none is missing, none is too many.

use std::collections::BTreeMap;

use crate::common::{Golden, golden, read};
use softplug_abi::{
    EventKind, Failure, LineErrorKind, LinkDownReason, MORE_OUTPUT, MarkState, ModemLines,
    NoteLevel, Refusal, Value, ValueWriter,
};

/// Constants by name, names as on the wire (`transmit-urgent`).
type Constants = BTreeMap<String, i64>;

/// Every set of codes, by the prefix of its constants in C and its enum in AssemblyScript.
fn sets() -> Vec<(&'static str, &'static str, Constants)> {
    macro_rules! codes {
        ($codes:ty) => {
            <$codes>::ALL
                .iter()
                .map(|code| (code.name().to_owned(), i64::from(code.code())))
                .collect()
        };
    }
    vec![
        ("SP_EVENT_", "Event", codes!(EventKind)),
        ("SP_ACTION_", "Action", actions()),
        ("SP_FAILURE_", "Failure", codes!(Failure)),
        ("SP_REFUSE_", "Refusal", refusals()),
        ("SP_LINE_ERROR_", "LineError", codes!(LineErrorKind)),
        ("SP_LINK_DOWN_", "", codes!(LinkDownReason)),
        ("SP_MARK_", "Mark", codes!(MarkState)),
        ("SP_NOTE_", "Level", codes!(NoteLevel)),
        ("SP_LINE_", "", modem_lines()),
        ("SP_VALUE_", "Value", value_types()),
        ("SP_LIMIT_", "", limits()),
    ]
}

/// The actions have no enum of their kinds; their frozen encodings have.
fn actions() -> Constants {
    let lines = golden("actions.txt").into_iter().filter(|line| !line.name.contains('/'));
    let kind = |line: Golden| {
        assert_eq!(line.bytes[..2], line.kind.to_le_bytes(), "{}", line.name);
        (line.name, i64::from(line.kind))
    };
    lines.map(kind).collect()
}

/// As a step returns them.
fn refusals() -> Constants {
    let code = |refusal: &Refusal| (refusal.name().to_owned(), -i64::from(refusal.code()));
    Refusal::ALL.iter().map(code).collect()
}

fn modem_lines() -> Constants {
    [
        ("cts", ModemLines::CTS),
        ("dsr", ModemLines::DSR),
        ("dcd", ModemLines::DCD),
        ("ri", ModemLines::RI),
        ("rts", ModemLines::RTS),
        ("dtr", ModemLines::DTR),
    ]
    .map(|(name, line)| (name.to_owned(), i64::from(line.0)))
    .into()
}

/// As they stand in records.
fn value_types() -> Constants {
    [
        ("bool", Value::Bool(true)),
        ("int", Value::Int(0)),
        ("text", Value::Text("")),
        ("bytes", Value::Bytes(&[])),
        ("choice", Value::Choice(0)),
    ]
    .map(|(name, value)| {
        let mut record = [0; 16];
        let mut writer = ValueWriter::new(&mut record);
        writer.push(0, value).expect("a short value fits");
        (name.to_owned(), i64::from(record[2]))
    })
    .into()
}

/// From the table in the specification, which another test holds against `limits.rs`.
fn limits() -> Constants {
    let text = read("docs/abi.md");
    let (_, table) = text.split_once("\n## Limits\n").expect("there is a section of limits");
    let number = |cell: &str| cell.replace(',', "").parse::<i64>().expect("a number");
    let mut limits = Constants::new();
    for line in table.lines().take_while(|line| !line.starts_with("## ")) {
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        let Some(name) = cells.get(1).and_then(|cell| cell.strip_prefix('`')) else { continue };
        let name = name.trim_end_matches('`').to_lowercase().replace('_', "-");
        match cells[2].split_once(" to ") {
            Some((least, most)) => {
                limits.insert(format!("{name}-least"), number(least));
                limits.insert(format!("{name}-most"), number(most));
            }
            None => drop(limits.insert(name, number(cells[2]))),
        }
    }
    assert!(limits.len() > 20, "{limits:?}");
    limits
}

/// The `NAME = number,` of enums.
fn assignments(source: &str) -> impl Iterator<Item = (&str, i64)> {
    source.lines().filter_map(|line| {
        let (name, value) = line.trim().trim_end_matches(" };").split_once(" = ")?;
        let name = name.trim_start_matches("enum { ");
        let value = value.trim_end_matches(',');
        let number = match value.strip_prefix("0x") {
            Some(digits) => i64::from_str_radix(digits, 16),
            None => value.parse(),
        };
        Some((name, number.ok()?))
    })
}

#[test]
fn the_header_has_every_constant() {
    let source = read("sdk/c/softplug.h");
    let found: BTreeMap<_, _> = assignments(&source)
        .filter(|(name, _)| name.starts_with("SP_"))
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    let mut expected: BTreeMap<_, _> = sets()
        .iter()
        .flat_map(|(prefix, _, codes)| {
            codes.iter().map(move |(name, code)| {
                (format!("{prefix}{}", name.to_uppercase().replace('-', "_")), *code)
            })
        })
        .collect();
    expected.insert("SP_MORE_OUTPUT".into(), i64::from(MORE_OUTPUT));
    assert_eq!(found, expected);
}

#[test]
fn the_assemblyscript_module_has_every_code() {
    let source = read("sdk/assemblyscript/softplug.ts");
    for (_, name, codes) in sets().iter().filter(|(_, name, _)| !name.is_empty()) {
        let head = format!("export const enum {name} {{\n");
        let (_, rest) = source.split_once(&head).unwrap_or_else(|| panic!("no enum {name}"));
        let (body, _) = rest.split_once("\n}").expect("an enum ends");
        let found: BTreeMap<_, _> = assignments(body)
            .filter(|(_, value)| *value != 0)
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        let expected: BTreeMap<_, _> =
            codes.iter().map(|(name, code)| (pascal_case(name), *code)).collect();
        assert_eq!(found, expected, "{name}");
    }
}

/// `transmit-urgent` as `TransmitUrgent`.
fn pascal_case(name: &str) -> String {
    name.split('-').map(|word| word[..1].to_uppercase() + &word[1..]).collect()
}
