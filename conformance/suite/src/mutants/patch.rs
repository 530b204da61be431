//! Wakes one mutant of a module that holds several.

/// What stands before the number of the active mutant, in the data of a module
/// that was built with mutants.
///
/// The example of [`wake`] shows it.
pub const MARKER: [u8; 16] = *b"softplug-mutant:";

/// A module cannot be made wrong.
///
/// The example of [`wake`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PatchError {
    /// It has no marker.
    #[error("the module holds no mutants: build it with `cargo xtask mutants --build`")]
    NoMarker,
    /// It has more than one.
    #[error("the module holds {0} places for the active mutant, not one: build it anew")]
    Markers(usize),
    /// It ends behind the marker.
    #[error("the module ends in the middle: build it anew")]
    Truncated,
}

/// The number of a mutant's name: FNV-1a, 64 bits. 0 is no mutant.
///
/// ```
/// use softplug_conformance::mutants::id;
///
/// assert_eq!(id(""), 0xCBF2_9CE4_8422_2325);
/// assert_ne!(id("xon-xoff.tx.obey-xoff/ignored"), id("xon-xoff.tx.obey-xoff/late"));
/// ```
pub const fn id(name: &str) -> u64 {
    let bytes = name.as_bytes();
    let mut hash: u64 = 0xCBF2_9CE4_8422_2325;
    let mut at = 0;
    while at < bytes.len() {
        hash = (hash ^ bytes[at] as u64).wrapping_mul(0x0000_0100_0000_01B3);
        at += 1;
    }
    hash
}

/// The module with the mutant of this name active.
///
/// ```
/// use softplug_conformance::mutants::{MARKER, PatchError, id, wake};
///
/// // Where none is active, zero stands behind the marker.
/// let name = "xon-xoff.tx.obey-xoff/ignored";
/// let module = [&b"\0asm..."[..], &MARKER, &[0; 8]].concat();
/// let woken = wake(&module, name)?;
/// assert_eq!(woken[module.len() - 8..], id(name).to_le_bytes());
/// assert_eq!(wake(b"\0asm", name), Err(PatchError::NoMarker));
/// # Ok::<(), PatchError>(())
/// ```
///
/// # Errors
/// The module was not built with mutants.
pub fn wake(module: &[u8], name: &str) -> Result<Vec<u8>, PatchError> {
    let mut places = (0..module.len()).filter(|at| module[*at..].starts_with(&MARKER));
    let marker = places.next().ok_or(PatchError::NoMarker)?;
    let more = places.count();
    if more > 0 {
        return Err(PatchError::Markers(more + 1));
    }
    let mut module = module.to_vec();
    let cell = marker + MARKER.len();
    let cell = module.get_mut(cell..cell + 8).ok_or(PatchError::Truncated)?;
    cell.copy_from_slice(&id(name).to_le_bytes());
    Ok(module)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_stands_behind_the_marker_and_nothing_else_changes() {
        let module = [b"before", MARKER.as_slice(), &[0; 8], b"behind"].concat();
        let woken = wake(&module, "a.b/c").expect("it has one marker");
        let expected =
            [b"before", MARKER.as_slice(), &id("a.b/c").to_le_bytes(), b"behind"].concat();
        assert_eq!(woken, expected);
        assert_eq!(wake(&woken, "a.b/c").expect("it still has"), woken, "twice is once");
    }

    #[test]
    fn a_module_has_exactly_one_marker() {
        assert_eq!(wake(b"\0asm", "x"), Err(PatchError::NoMarker));
        let one = [MARKER.as_slice(), &[0; 8]].concat();
        assert_eq!(wake(&[one.clone(), one.clone()].concat(), "x"), Err(PatchError::Markers(2)));
        assert_eq!(wake(&one[..23], "x"), Err(PatchError::Truncated));
    }
}
