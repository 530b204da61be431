//! Takes a module apart into its sections, and reads the memory it declares.

/// Pages of 64 KiB: at the start, and at most where the module says so.
///
/// The example of [`memory`] shows them.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Pages {
    /// At the start.
    pub least: u64,
    /// At most; none where it may grow without end.
    pub most: Option<u64>,
}

/// A section of a module.
///
/// The example of [`sections`] shows two.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Section<'a> {
    /// What it holds.
    pub kind: Kind<'a>,
    /// What stands in it; without the name of a custom section.
    pub content: &'a [u8],
    /// With its head, as it stands in the module.
    pub whole: &'a [u8],
}

/// What a section holds, as far as anyone here wants to know.
///
/// The example of [`sections`] shows two.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Kind<'a> {
    /// Whatever a tool put there under this name.
    Custom(&'a str),
    /// The memory.
    Memory,
    /// The functions.
    Code,
    /// What memory holds at the start.
    Data,
    /// One of the others.
    Other,
}

/// The first bytes of a module, binary format version 1.
pub(crate) const HEADER: &[u8] = b"\0asm\x01\0\0\0";

/// The sections in their order; none where it is not a whole module.
///
/// ```
/// use softplug_build::{Kind, Section, sections};
///
/// let module = wat::parse_str(r#"(module (memory 1 1) (@custom "x" (after last) "abc"))"#)?;
/// let sections = sections(&module).expect("it is a whole module");
/// let [Section { kind: Kind::Memory, .. }, Section { kind, content, whole }] = sections[..] else {
///     panic!("{sections:?}")
/// };
/// assert_eq!((kind, content), (Kind::Custom("x"), &b"abc"[..]));
/// assert!(module.ends_with(whole));
/// # Ok::<(), wat::Error>(())
/// ```
pub fn sections(module: &[u8]) -> Option<Vec<Section<'_>>> {
    let mut rest = module.strip_prefix(HEADER)?;
    let mut sections = Vec::new();
    while let Some((&id, after)) = rest.split_first() {
        let start = rest;
        rest = after;
        let mut content = bytes(&mut rest)?;
        let kind = match id {
            0 => Kind::Custom(std::str::from_utf8(bytes(&mut content)?).ok()?),
            5 => Kind::Memory,
            10 => Kind::Code,
            11 => Kind::Data,
            _ => Kind::Other,
        };
        sections.push(Section { kind, content, whole: &start[..start.len() - rest.len()] });
    }
    Some(sections)
}

/// The memory that a module defines; none where it defines none or is not a
/// module at all.
///
/// ```
/// use softplug_build::{Pages, memory};
///
/// let grows = wat::parse_str("(module (memory 17))")?;
/// assert_eq!(memory(&grows), Some(Pages { least: 17, most: None }));
/// assert_eq!(memory(b"no module"), None);
/// # Ok::<(), wat::Error>(())
/// ```
pub fn memory(module: &[u8]) -> Option<Pages> {
    let sections = sections(module)?;
    let mut section = sections.iter().find(|section| section.kind == Kind::Memory)?.content;
    number(&mut section)?;
    let flags = number(&mut section)?;
    let least = number(&mut section)?;
    let most = if flags & 1 == 1 { Some(number(&mut section)?) } else { None };
    Some(Pages { least, most })
}

/// Takes bytes that stand behind their count.
pub(crate) fn bytes<'a>(from: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = usize::try_from(number(from)?).ok()?;
    let (bytes, rest) = from.split_at_checked(length)?;
    *from = rest;
    Some(bytes)
}

/// Takes an unsigned LEB128 number.
pub(crate) fn number(from: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..63).step_by(7) {
        let (&byte, rest) = from.split_first()?;
        *from = rest;
        value |= u64::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// Appends an unsigned LEB128 number.
pub(crate) fn push_number(to: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        to.push(value as u8 | 0x80);
        value >>= 7;
    }
    to.push(value as u8);
}

/// Appends bytes behind their count.
pub(crate) fn push_bytes(to: &mut Vec<u8>, bytes: &[u8]) {
    push_number(to, bytes.len() as u64);
    to.extend(bytes);
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

    #[test]
    fn sections_give_the_module_back() {
        let module = module(&[0, 4, 2, b'a', b'b', 7, 10, 1, 0, 11, 2, 8, 9]);
        let sections = sections(&module).unwrap();
        assert_eq!(
            sections[0],
            Section { kind: Kind::Custom("ab"), content: &[7], whole: &[0, 4, 2, b'a', b'b', 7] }
        );
        let kinds: Vec<_> = sections.iter().map(|section| section.kind).collect();
        assert_eq!(kinds, [Kind::Custom("ab"), Kind::Code, Kind::Data]);
        let wholes: Vec<_> = sections.iter().flat_map(|section| section.whole).copied().collect();
        assert_eq!([HEADER, &wholes].concat(), module);
    }

    #[test]
    fn numbers_are_read_as_they_were_written() {
        for value in [0, 1, 127, 128, 16_383, 16_384, 1 << 32] {
            let mut written = Vec::new();
            push_number(&mut written, value);
            assert_eq!(number(&mut &written[..]), Some(value));
        }
    }
}
