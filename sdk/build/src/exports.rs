//! Leaves out the exports that the ABI does not know: the linker's addresses.

use crate::sections::{HEADER, bytes, number, push_bytes, push_number, sections};

/// The id of the section of exports.
const EXPORT: u8 = 7;

/// The module with no exports but `memory` and those of the ABI; none where it is
/// damaged.
pub(crate) fn strip(module: &[u8]) -> Option<Vec<u8>> {
    let mut out = HEADER.to_vec();
    for section in sections(module)? {
        if section.whole.first() == Some(&EXPORT) {
            out.push(EXPORT);
            push_bytes(&mut out, &known(section.content)?);
        } else {
            out.extend(section.whole);
        }
    }
    Some(out)
}

fn known(mut section: &[u8]) -> Option<Vec<u8>> {
    let (mut count, mut known) = (0, Vec::new());
    for _ in 0..number(&mut section)? {
        let name = bytes(&mut section)?;
        let (&kind, rest) = section.split_first()?;
        section = rest;
        let index = number(&mut section)?;
        if name == b"memory" || name.starts_with(b"softplug_") {
            count += 1;
            push_bytes(&mut known, name);
            known.push(kind);
            push_number(&mut known, index);
        }
    }
    let mut out = Vec::new();
    push_number(&mut out, count);
    out.extend(known);
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_abi_knows_is_left() {
        let module = |more: &str| {
            wat::parse_str(format!(
                r#"(module
                    (memory (export "memory") 1 1)
                    (global (export "softplug_x") i32 (i32.const 1))
                    (global {more} i32 (i32.const 2)))"#
            ))
            .unwrap()
        };
        let stripped = strip(&module(r#"(export "__heap_base")"#)).unwrap();
        assert_eq!(stripped, module(""));
        assert_eq!(strip(&stripped), Some(stripped));
        assert_eq!(strip(b"MZ"), None);
    }
}
