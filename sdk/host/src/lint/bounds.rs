//! How much of everything a module may declare: counted before anything is built from it.

use super::LintError;
use softplug_abi::limits::{ELEMENTS, EXPORTS, FUNCTIONS, GLOBALS, PARAMETERS, SEGMENTS, TYPES};
use wasmparser::{CompositeInnerType, ElementItems, Parser, Payload, WasmFeatures};

/// Counts what the sections declare. Function bodies are not looked into: [`super::weight`] does.
///
/// What cannot be read is left to the validator, which stops at the same place or before.
pub(super) fn check(wasm: &[u8]) -> Result<(), LintError> {
    let mut parser = Parser::new(0);
    parser.set_features(WasmFeatures::all());
    for payload in parser.parse_all(wasm) {
        let Ok(payload) = payload else { return Ok(()) };
        match count(&payload) {
            Ok(Some((what, count, most))) => at_most(what, count, most)?,
            Ok(None) => {}
            Err(_) => return Ok(()),
        }
    }
    Ok(())
}

pub(super) fn at_most(what: &'static str, count: u64, most: u64) -> Result<(), LintError> {
    if count > most { Err(LintError::TooMany { what, count, most }) } else { Ok(()) }
}

type Counted = Option<(&'static str, u64, u64)>;

fn count(payload: &Payload<'_>) -> wasmparser::Result<Counted> {
    Ok(match payload {
        Payload::TypeSection(section) => {
            if u64::from(section.count()) > TYPES {
                return Ok(Some(("types", u64::from(section.count()), TYPES)));
            }
            let (mut types, mut widest) = (0, 0);
            for group in section.clone() {
                for ty in group?.into_types() {
                    types += 1;
                    if let CompositeInnerType::Func(signature) = ty.composite_type.inner {
                        widest =
                            widest.max(signature.params().len()).max(signature.results().len());
                    }
                }
            }
            if types > TYPES {
                Some(("types", types, TYPES))
            } else {
                Some(("parameters of a function", widest as u64, PARAMETERS))
            }
        }
        Payload::FunctionSection(section) => {
            Some(("functions", u64::from(section.count()), FUNCTIONS))
        }
        Payload::TableSection(section) => {
            let mut elements = 0;
            for table in section.clone() {
                elements = elements.max(table?.ty.initial);
            }
            Some(("table elements", elements, ELEMENTS))
        }
        Payload::GlobalSection(section) => Some(("globals", u64::from(section.count()), GLOBALS)),
        Payload::ExportSection(section) => Some(("exports", u64::from(section.count()), EXPORTS)),
        Payload::ElementSection(section) => {
            if u64::from(section.count()) > SEGMENTS {
                return Ok(Some(("element segments", u64::from(section.count()), SEGMENTS)));
            }
            let mut items = 0;
            for element in section.clone() {
                items += match element?.items {
                    ElementItems::Functions(items) => u64::from(items.count()),
                    ElementItems::Expressions(_, items) => u64::from(items.count()),
                };
            }
            Some(("table elements", items, ELEMENTS))
        }
        Payload::DataSection(section) => {
            Some(("data segments", u64::from(section.count()), SEGMENTS))
        }
        _ => None,
    })
}
