//! A saved state on its way into a plug-in, in pieces.

use crate::Event;

/// Bytes of a restore event beside the piece itself: format, zero, offset, total.
const HEAD: usize = 12;

/// Calls `give` with restore events of at most `capacity` bytes each, at least one,
/// in the order of the state, and stops at its first error. A `capacity` too small
/// for any piece (the ABI allows none so small) counts as one byte more than the head.
///
/// ```
/// use softplug_abi::{Event, restore_pieces};
///
/// let mut pieces = Vec::new();
/// let given: Result<(), ()> = restore_pieces(1, b"state", 12 + 3, |event| {
///     if let Event::Restore { offset, total, bytes, .. } = event {
///         pieces.push((*offset, *total, bytes.to_vec()));
///     }
///     Ok(())
/// });
/// assert_eq!(given, Ok(()));
/// assert_eq!(pieces, [(0, 5, b"sta".to_vec()), (3, 5, b"te".to_vec())]);
/// ```
///
/// # Errors
/// The first that `give` returns.
pub fn restore_pieces<E>(
    format: u16,
    state: &[u8],
    capacity: usize,
    mut give: impl FnMut(&Event<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let total = state.len() as u32;
    let (mut offset, mut rest) = (0, state);
    loop {
        let (bytes, after) = rest.split_at(rest.len().min(capacity.saturating_sub(HEAD).max(1)));
        give(&Event::Restore { format, offset, total, bytes })?;
        if after.is_empty() {
            return Ok(());
        }
        offset += bytes.len() as u32;
        rest = after;
    }
}
