//! Reads how much memory a module declares.

/// Pages of 64 KiB: at the start, and at most where the module says so.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Pages {
    pub(crate) least: u64,
    pub(crate) most: Option<u64>,
}

const HEADER: &[u8] = b"\0asm\x01\0\0\0";
const MEMORY_SECTION: u8 = 5;

/// The memory that a module defines; none where it defines none or is not a
/// module at all.
pub(crate) fn memory(module: &[u8]) -> Option<Pages> {
    let mut rest = module.strip_prefix(HEADER)?;
    loop {
        let (&id, after) = rest.split_first()?;
        rest = after;
        let length = usize::try_from(number(&mut rest)?).ok()?;
        let (mut section, after) = rest.split_at_checked(length)?;
        rest = after;
        if id != MEMORY_SECTION {
            continue;
        }
        number(&mut section)?;
        let flags = number(&mut section)?;
        let least = number(&mut section)?;
        let most = if flags & 1 == 1 { Some(number(&mut section)?) } else { None };
        return Some(Pages { least, most });
    }
}

/// An unsigned LEB128 number.
fn number(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..63).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn module(sections: &[u8]) -> Vec<u8> {
        [HEADER, sections].concat()
    }

    #[test]
    fn the_memory_section_is_found_behind_others() {
        let with_maximum = module(&[1, 1, 0, 5, 5, 1, 1, 0x81, 0x01, 4]);
        assert_eq!(memory(&with_maximum), Some(Pages { least: 129, most: Some(4) }));
        let without = module(&[5, 3, 1, 0, 17]);
        assert_eq!(memory(&without), Some(Pages { least: 17, most: None }));
    }

    #[test]
    fn what_is_no_module_or_cut_off_has_no_memory() {
        assert_eq!(memory(b"MZ"), None);
        assert_eq!(memory(&module(&[])), None);
        let whole = module(&[5, 4, 1, 1, 1, 1]);
        assert!(memory(&whole).is_some());
        for length in 0..whole.len() {
            assert_eq!(memory(&whole[..length]), None, "{length} bytes");
        }
        assert_eq!(
            memory(&module(&[5, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF])),
            None
        );
    }
}
