//! Settings as they come: pairs of texts, name and value, each ended by a byte 00.

use alloc::vec::Vec;

/// The pairs; none if it is not such a list.
pub(crate) fn pairs(bytes: &[u8]) -> Option<Vec<(&str, &str)>> {
    let mut rest = core::str::from_utf8(bytes).ok()?;
    let mut pairs = Vec::new();
    while !rest.is_empty() {
        let (name, after) = rest.split_once('\0')?;
        let (value, after) = after.split_once('\0')?;
        pairs.push((name, value));
        rest = after;
    }
    Some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_whole_or_none() {
        assert_eq!(pairs(b""), Some(vec![]));
        assert_eq!(pairs(b"leader\x005\0etx\0\0"), Some(vec![("leader", "5"), ("etx", "")]));
        assert_eq!(pairs(b"leader\x005"), None);
        assert_eq!(pairs(b"leader\0"), None);
        assert_eq!(pairs(b"\xff\0\0"), None);
    }
}
