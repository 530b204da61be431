//! A module taken apart into its sections, which are not looked into.

/// The first bytes of a module, binary format version 1.
pub(super) const HEADER: &[u8] = b"\0asm\x01\0\0\0";

/// A section as it stands in the module.
pub(super) struct Section<'a> {
    /// The name of a custom section.
    pub(super) custom: Option<&'a [u8]>,
    /// With its head.
    pub(super) whole: &'a [u8],
}

/// The sections in their order; none if this is not a whole module.
pub(super) fn sections(module: &[u8]) -> Option<Vec<Section<'_>>> {
    let mut rest = module.strip_prefix(HEADER)?;
    let mut sections = Vec::new();
    while let Some((&id, after)) = rest.split_first() {
        let start = rest;
        rest = after;
        let mut content = counted(&mut rest)?;
        let custom = if id == 0 { Some(counted(&mut content)?) } else { None };
        sections.push(Section { custom, whole: &start[..start.len() - rest.len()] });
    }
    Some(sections)
}

/// Takes bytes that stand behind their count, a LEB128 number.
fn counted<'a>(from: &mut &'a [u8]) -> Option<&'a [u8]> {
    let mut count = 0_u64;
    for shift in (0..35).step_by(7) {
        let (&byte, rest) = from.split_first()?;
        *from = rest;
        count |= u64::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            let (bytes, rest) = from.split_at_checked(usize::try_from(count).ok()?)?;
            *from = rest;
            return Some(bytes);
        }
    }
    None
}

/// Appends a custom section.
pub(super) fn push_custom(module: &mut Vec<u8>, name: &str, content: &[u8]) {
    let mut body = Vec::with_capacity(content.len() + name.len() + 1);
    push_number(&mut body, name.len());
    body.extend(name.as_bytes());
    body.extend(content);
    module.push(0);
    push_number(module, body.len());
    module.extend(body);
}

fn push_number(to: &mut Vec<u8>, mut number: usize) {
    loop {
        let low = (number & 0x7F) as u8;
        number >>= 7;
        if number == 0 {
            return to.push(low);
        }
        to.push(low | 0x80);
    }
}

/// JSON without the spaces between its parts: those in strings stay.
pub(super) fn without_spaces(json: &str) -> String {
    let (mut in_string, mut escaped) = (false, false);
    let keep = |c: &char| {
        let stays = in_string || !matches!(c, ' ' | '\t' | '\n' | '\r');
        match c {
            '"' if !escaped => in_string = !in_string,
            _ => {}
        }
        escaped = in_string && *c == '\\' && !escaped;
        stays
    };
    json.chars().filter(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_found_and_put_back_as_they_were() {
        let mut module = HEADER.to_vec();
        module.extend([5, 4, 1, 1, 1, 1]);
        push_custom(&mut module, "long", &[7; 300]);
        let found = sections(&module).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].custom, None);
        assert_eq!(found[1].custom, Some(&b"long"[..]));
        let again: Vec<u8> = found.iter().flat_map(|section| section.whole).copied().collect();
        assert_eq!([HEADER, &again].concat(), module);
    }

    #[test]
    fn what_is_no_whole_module_has_no_sections() {
        let mut module = HEADER.to_vec();
        push_custom(&mut module, "name", &[7; 300]);
        for length in (0..module.len()).filter(|length| *length != HEADER.len()) {
            assert!(sections(&module[..length]).is_none(), "{length}");
        }
        assert!(sections(&[HEADER, &[0, 0x80, 0x80, 0x80, 0x80, 0x80]].concat()).is_none());
    }

    #[test]
    fn spaces_in_strings_stay() {
        let json = "{ \"a b\" :\n\t[ 1, \"c \\\" d \\\\\" , \" \" ] }\r\n";
        assert_eq!(without_spaces(json), "{\"a b\":[1,\"c \\\" d \\\\\",\" \"]}");
    }
}
