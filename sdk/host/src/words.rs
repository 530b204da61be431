//! Text out of a plug-in's memory: bounded, lossy and fit for a terminal.

use softplug_abi::Region;

/// What the region of last words holds: a length (u32), then text. `None` if
/// it is empty. A length past the region's end is cut to it.
pub(crate) fn read(memory: &[u8], region: Region) -> Option<String> {
    let start = region.address as usize;
    let words = memory.get(start..start + region.capacity as usize)?;
    let (length, text) = words.split_first_chunk::<4>()?;
    let length = u32::from_le_bytes(*length) as usize;
    let text = &text[..length.min(text.len())];
    if text.is_empty() { None } else { Some(printable(text)) }
}

/// Empties the region, so that the next words are not mistaken for these.
pub(crate) fn clear(memory: &mut [u8], region: Region) {
    let start = region.address as usize;
    if let Some(length) = memory.get_mut(start..start + 4) {
        length.fill(0);
    }
}

/// Text with what is not UTF-8, and control characters, replaced.
pub(crate) fn printable(bytes: &[u8]) -> String {
    let replace = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    String::from_utf8_lossy(&bytes[..bytes.len().min(1_024)]).chars().map(replace).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const REGION: Region = Region { address: 2, capacity: 8 };

    #[test]
    fn reads_what_is_there_and_no_further() {
        assert_eq!(read(&[9, 9, 0, 0, 0, 0, b'x', b'x', b'x', b'x'], REGION), None);
        assert_eq!(read(b"..\x02\0\0\0ab..", REGION).as_deref(), Some("ab"));
        assert_eq!(read(b"..\xff\xff\xff\xffabcdNOT", REGION).as_deref(), Some("abcd"));
        assert_eq!(read(b"..\x02\0\0\0ab", REGION), None);
    }

    #[test]
    fn nothing_reaches_the_terminal_that_moves_its_cursor() {
        assert_eq!(printable(b"a\x1b[2J\xff\n\xc2\x9b"), "a\u{fffd}[2J\u{fffd}\u{fffd}\u{fffd}");
    }

    #[test]
    fn cleared_words_are_gone() {
        let mut memory = *b"..\x02\0\0\0ab..";
        clear(&mut memory, REGION);
        assert_eq!(read(&memory, REGION), None);
    }
}
