//! Whether two programs are the same.

use std::io::{self, BufRead, BufReader, Read};

/// The first byte at which they differ, counted from 0; the length of the shorter one if
/// that is all; `None` if they are the same.
///
/// # Errors
/// One of them cannot be read.
pub fn first_difference(one: impl Read, other: impl Read) -> io::Result<Option<u64>> {
    let (mut one, mut other) = (BufReader::new(one), BufReader::new(other));
    let mut at = 0;
    loop {
        let (left, right) = (one.fill_buf()?, other.fill_buf()?);
        let most = left.len().min(right.len());
        if let Some(place) = left.iter().zip(right).position(|(left, right)| left != right) {
            return Ok(Some(at + place as u64));
        }
        if most == 0 {
            return Ok((left.len() != right.len()).then_some(at));
        }
        at += most as u64;
        one.consume(most);
        other.consume(most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_first_byte_that_differs_is_told() {
        let compare = |one: &[u8], other: &[u8]| first_difference(one, other).unwrap();
        assert_eq!(compare(b"G1 X1", b"G1 X1"), None);
        assert_eq!(compare(b"G1 X1", b"G1 Y1"), Some(3));
        assert_eq!(compare(b"G1", b"G1 X1"), Some(2));
        assert_eq!(compare(b"", b"G"), Some(0));
    }

    proptest! {
        #[test]
        fn wherever_it_is(length in 1..20_000_usize, at in 0..20_000_usize) {
            let one = vec![b'X'; length];
            let mut other = one.clone();
            let at = at % length;
            other[at] = b'Y';
            prop_assert_eq!(first_difference(&one[..], &other[..]).unwrap(), Some(at as u64));
            prop_assert_eq!(first_difference(&one[..], &one[..at]).unwrap(), Some(at as u64));
        }
    }
}
