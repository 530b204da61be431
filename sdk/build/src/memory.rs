//! Puts a small `memcpy` and `memset` in the place of the compiler's.

use crate::names;
use crate::sections::{HEADER, Kind, Section, bytes, number, push_bytes, push_number, sections};

/// Both functions: `memory.wat`, translated.
const OWN: &[u8] = include_bytes!("memory.wasm");

/// The module with the bodies of [`OWN`] where it has functions of these names; none
/// where it is damaged. It imports nothing, so the first function is number 0.
pub(crate) fn make_small(module: &[u8]) -> Option<Vec<u8>> {
    let own = sections(OWN)?;
    let own: Vec<_> = functions(&own)?.into_iter().zip(bodies(&own)?).collect();
    let sections = sections(module)?;
    let functions = functions(&sections)?;
    let mut out = HEADER.to_vec();
    for section in &sections {
        if section.kind != Kind::Code {
            out.extend(section.whole);
            continue;
        }
        let bodies = bodies(&sections)?;
        let mut content = Vec::new();
        push_number(&mut content, bodies.len() as u64);
        for (at, body) in bodies.into_iter().enumerate() {
            let name = functions.iter().find(|(index, _)| *index == at as u64);
            let small = own.iter().find(|((_, own), _)| name.is_some_and(|(_, name)| name == own));
            push_bytes(&mut content, small.map_or(body, |(_, body)| body));
        }
        out.push(CODE);
        push_bytes(&mut out, &content);
    }
    Some(out)
}

/// The id of the section with the functions' bodies.
const CODE: u8 = 10;

/// Number and name of each function that has one.
fn functions<'a>(sections: &[Section<'a>]) -> Option<Vec<(u64, &'a str)>> {
    match sections.iter().find(|section| section.kind == Kind::Custom("name")) {
        Some(section) => names::functions(section.content),
        None => Some(Vec::new()),
    }
}

fn bodies<'a>(sections: &[Section<'a>]) -> Option<Vec<&'a [u8]>> {
    let Some(section) = sections.iter().find(|section| section.kind == Kind::Code) else {
        return Some(Vec::new());
    };
    let mut content = section.content;
    let count = number(&mut content)?;
    (0..count).map(|_| bytes(&mut content)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasmparser::Validator;

    const MODULE: &str = r"(module
        (memory 1 1)
        (func $other (result i32) i32.const 7)
        (func $memset (param i32 i32 i32) (result i32) unreachable)
        (func $memcpy (param i32 i32 i32) (result i32) unreachable))";

    #[test]
    fn what_is_translated_is_the_text() {
        let translated = wat::parse_str(include_str!("memory.wat")).unwrap();
        assert_eq!(OWN, translated, "write the right-hand side to memory.wasm");
    }

    #[test]
    fn both_are_replaced_wherever_they_stand_and_nothing_else() {
        let module = wat::parse_str(MODULE).unwrap();
        let small = make_small(&module).unwrap();
        Validator::new().validate_all(&small).unwrap();
        let own = sections(OWN).unwrap();
        let own = bodies(&own).unwrap();
        let before = sections(&module).unwrap();
        let after = sections(&small).unwrap();
        assert_eq!(bodies(&after).unwrap(), [bodies(&before).unwrap()[0], own[1], own[0]]);
        assert_eq!(before.len(), after.len());
        assert_eq!(make_small(&small), Some(small));
    }

    #[test]
    fn without_names_nothing_changes_and_what_is_cut_off_is_refused() {
        let module = wat::parse_str("(module (func unreachable))").unwrap();
        assert_eq!(make_small(&module), Some(module.clone()));
        assert_eq!(make_small(&module[..module.len() - 1]), None);
    }
}
