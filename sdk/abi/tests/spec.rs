//! `docs/abi.md` says what the code does: names, numbers, texts, the manifest's
//! keys, the rules, the example plug-in.
#![cfg(feature = "manifest")]

use crate::common::{golden, read};
use softplug_abi::manifest::Manifest;
use softplug_abi::{
    EventKind, Failure, LineErrorKind, LinkDownReason, MANIFEST_SECTION, Mailbox, MarkState,
    NoteLevel, Refusal,
};
use std::collections::BTreeSet;
use wasmparser::{ExternalKind, Parser, Payload, Validator, WasmFeatures};

fn specification() -> String {
    read("docs/abi.md")
}

/// The part under a heading, up to the next heading of any level.
fn section<'a>(text: &'a str, heading: &str) -> &'a str {
    let start = text.find(&format!("\n{heading}\n"));
    let start = start.unwrap_or_else(|| panic!("no heading \"{heading}\"")) + heading.len() + 2;
    let rest = &text[start..];
    let end = rest.find("\n#").unwrap_or(rest.len());
    &rest[..end]
}

/// The rows of the tables in a section, cell by cell, without their heads.
fn rows(section: &str) -> Vec<Vec<String>> {
    section
        .lines()
        .filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |"))
        .map(|row| row.split(" | ").map(|cell| cell.trim().to_string()).collect())
        .collect()
}

/// The rows whose first cell is a number and whose second one a name in code.
fn codes(section: &str) -> Vec<(String, String, String)> {
    rows(section)
        .into_iter()
        .filter(|row| row[0].parse::<u16>().is_ok())
        .map(|row| (row[0].clone(), row[1].trim_matches('`').to_string(), row[2].clone()))
        .collect()
}

fn strings<'a>(code: impl Into<u32>, name: &'a str, text: &'a str) -> (String, String, String) {
    (code.into().to_string(), name.to_string(), text.to_string())
}

#[test]
fn tables_of_codes_agree() {
    let text = specification();
    let table = |heading: &str| codes(section(&text, heading));
    macro_rules! same {
        ($heading:literal, $codes:ty) => {
            let expected: Vec<_> = <$codes>::ALL
                .iter()
                .map(|code| strings(code.code(), code.name(), code.text()))
                .collect();
            assert_eq!(table($heading), expected, $heading);
        };
    }
    same!("## Events", EventKind);
    same!("### Failures", Failure);
    same!("### Refusals", Refusal);
    same!("### Line errors", LineErrorKind);
    same!("### Reasons of link-down", LinkDownReason);
    same!("### States of a mark", MarkState);
    same!("### Levels of a note", NoteLevel);
}

#[test]
fn the_table_of_actions_agrees() {
    let text = specification();
    let table: Vec<_> = codes(section(&text, "## Actions"))
        .into_iter()
        .map(|(code, name, _)| (code, name))
        .collect();
    let mut expected: Vec<_> = golden("actions.txt")
        .into_iter()
        .filter(|line| !line.name.contains('/'))
        .map(|line| (line.kind, line.name))
        .collect();
    expected.sort();
    let expected: Vec<_> =
        expected.into_iter().map(|(kind, name)| (kind.to_string(), name)).collect();
    assert_eq!(table, expected);
}

/// Checks that a payload's table begins at 0, has no gap, and fits the frozen
/// bytes: as long as they are, or open-ended and no longer than they are.
fn check_layout(text: &str, heading: &str, payloads: &[&[u8]]) {
    let mut end = 0;
    let mut open_ended = false;
    for row in rows(section(text, heading)) {
        let Ok(offset) = row[0].parse::<usize>() else { continue };
        assert_eq!(offset, end, "{heading}: {row:?}");
        assert!(!open_ended, "{heading}: nothing can follow an open end");
        match row[1].parse::<usize>() {
            Ok(size) => end += size,
            Err(_) => open_ended = true,
        }
    }
    for payload in payloads {
        let fits = if open_ended { payload.len() >= end } else { payload.len() == end };
        assert!(fits, "{heading}: {end} bytes in the table, {payload:02x?}");
    }
}

#[test]
fn layouts_of_events_agree_with_the_frozen_bytes() {
    let (text, file) = (specification(), golden("events.txt"));
    for kind in EventKind::ALL {
        let lines = file.iter().filter(|line| line.kind == kind.code());
        let payloads: Vec<_> = lines.map(|line| line.bytes.as_slice()).collect();
        let heading = format!("### Event {}: {}", kind.code(), kind.name());
        check_layout(&text, &heading, &payloads);
    }
}

#[test]
fn layouts_of_actions_agree_with_the_frozen_bytes() {
    let (text, file) = (specification(), golden("actions.txt"));
    for named in file.iter().filter(|line| !line.name.contains('/')) {
        let lines = file.iter().filter(|line| line.kind == named.kind);
        let payloads: Vec<_> = lines.map(|line| &line.bytes[4..]).collect();
        check_layout(&text, &format!("### Action {}: {}", named.kind, named.name), &payloads);
    }
}

/// The constants of `limits.rs`, read from its source so that none is forgotten.
fn limits() -> Vec<(String, String)> {
    let source = read("sdk/abi/src/limits.rs");
    let constants: Vec<_> = source
        .lines()
        .filter_map(|line| line.strip_prefix("pub const "))
        .map(|line| {
            let (name, rest) = line.split_once(':').expect("a constant has a type");
            let (_, value) = rest.split_once('=').expect("a constant has a value");
            (name.to_string(), number(value.trim().trim_end_matches(';')))
        })
        .collect();
    assert_eq!(constants.len(), 33);
    constants
}

/// A constant's expression as the specification writes it.
fn number(expression: &str) -> String {
    if let Some((low, high)) = expression.split_once("..=") {
        return format!("{} to {}", number(low), number(high));
    }
    if expression == "u16::MAX as usize" {
        return grouped(u64::from(u16::MAX));
    }
    let factors = expression.split('*').map(|factor| {
        let digits = factor.trim().replace('_', "");
        digits.parse::<u64>().unwrap_or_else(|_| panic!("not a number: {expression}"))
    });
    grouped(factors.product())
}

fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[test]
fn the_table_of_limits_agrees() {
    let text = specification();
    let table: Vec<_> = rows(section(&text, "## Limits"))
        .into_iter()
        .filter(|row| row[0].starts_with('`'))
        .map(|row| (row[0].trim_matches('`').to_string(), row[1].clone()))
        .collect();
    assert_eq!(table, limits());
}

#[test]
fn exports_and_the_mailbox_are_specified() {
    let text = specification();
    let module = section(&text, "## Module");
    for name in
        [softplug_abi::EXPORT_MEMORY, softplug_abi::EXPORT_MAILBOX, softplug_abi::EXPORT_STEP]
    {
        assert!(rows(module).iter().any(|row| row[0] == format!("`{name}`")), "{name}");
    }
    assert!(module.contains(MANIFEST_SECTION));
    let bytes: usize = rows(section(&text, "## Mailbox"))
        .iter()
        .filter(|row| row[0].parse::<usize>().is_ok())
        .map(|row| row[1].parse::<usize>().expect("a field has a size"))
        .sum();
    assert_eq!(bytes, Mailbox::BYTES);
    let more = format!("0x{:08x}", softplug_abi::MORE_OUTPUT);
    assert!(section(&text, "## Calls").contains(&more));
}

/// The block of code in a language that comes first in a section.
fn block<'a>(section: &'a str, language: &str) -> &'a str {
    let (_, rest) = section.split_once(&format!("```{language}\n")).expect("there is a block");
    rest.split_once("```").expect("the block ends").0
}

#[test]
fn the_manifest_in_the_specification_is_good_and_every_key_is_described() {
    let text = specification();
    let chapter = section(&text, "## Manifest");
    let manifest = Manifest::parse(block(chapter, "json").as_bytes());
    let json = serde_json::to_value(manifest.expect("the example is good"));
    let mut keys = BTreeSet::new();
    collect_keys(&json.expect("a manifest can be written"), &mut keys);
    for key in keys {
        assert!(chapter.contains(&format!("`{key}`")), "`{key}` is not described");
    }
}

/// Every key of the manifest itself; those of a preset's values are settings.
fn collect_keys(json: &serde_json::Value, keys: &mut BTreeSet<String>) {
    if let Some(object) = json.as_object() {
        for (key, value) in object {
            keys.insert(key.clone());
            if key != "values" {
                collect_keys(value, keys);
            }
        }
    }
    for entry in json.as_array().into_iter().flatten() {
        collect_keys(entry, keys);
    }
}

#[test]
fn every_rule_stands_in_the_specification_and_names_its_test() {
    let text = specification();
    let (_, rules) = text.split_once("\n## Rules\n").expect("there is a chapter of rules");
    let (rules, _) = rules.split_once("\n## ").expect("a chapter follows");
    let list = read("fixtures/abi/rules.txt");
    let mut ids = Vec::new();
    for line in list.lines().filter(|line| !line.starts_with('#')) {
        let (id, sentence) = line.split_once('\t').expect("a line is id, tab, sentence");
        assert!(rules.contains(&format!("**`{id}`** {sentence}")), "{id} is not specified");
        let test = id.trim_start_matches("abi.").replace(['.', '-'], "_");
        assert!(rules.contains(&format!("::{test}`.")), "{id} names no test");
        ids.push(id);
    }
    assert_eq!(rules.matches("**`abi.").count(), ids.len(), "a rule is missing in rules.txt");
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len(), "an id stands twice");
    for mention in text.split('`').filter(|word| word.starts_with("abi.")) {
        assert!(ids.contains(&mention), "{mention} is no rule");
    }
}

#[test]
fn the_example_plug_in_follows_the_specification() {
    let source = read("fixtures/abi/echo.wat");
    assert!(source.lines().count() < 60);
    let text = specification();
    assert_eq!(block(section(&text, "### A plug-in"), "wat"), source);

    let module = wat::parse_str(&source).expect("the example assembles");
    Validator::new_with_features(WasmFeatures::WASM1)
        .validate_all(&module)
        .expect("the example needs no later feature");
    let mut exports = Vec::new();
    let mut manifests = Vec::new();
    for payload in Parser::new(0).parse_all(&module) {
        match payload.expect("the module is valid") {
            Payload::ImportSection(_) | Payload::StartSection { .. } => panic!("not allowed"),
            Payload::MemorySection(memories) => {
                for memory in memories {
                    let memory = memory.expect("the memory is valid");
                    assert_eq!((memory.initial, memory.maximum), (1, Some(1)));
                }
            }
            Payload::ExportSection(section) => {
                for export in section {
                    let export = export.expect("the export is valid");
                    exports.push((export.name, export.kind));
                }
            }
            Payload::CustomSection(custom) if custom.name() == MANIFEST_SECTION => {
                manifests.push(Manifest::parse(custom.data()).expect("the manifest is good"));
            }
            _ => {}
        }
    }
    let expected = [
        (softplug_abi::EXPORT_MEMORY, ExternalKind::Memory),
        (softplug_abi::EXPORT_MAILBOX, ExternalKind::Func),
        (softplug_abi::EXPORT_STEP, ExternalKind::Func),
    ];
    assert_eq!(exports, expected);
    let names: Vec<_> = manifests.iter().map(|manifest| manifest.name.as_str()).collect();
    assert_eq!(names, ["echo"]);
}
