//! The fields of jobs and requests as value records. The SDK reads and writes all
//! types of them, which costs a plug-in four times the code.
//!
//! A record: index u16, type u8, zero u8, length u16, payload. No field of RK512 is
//! longer than 128 bytes, and the host has checked what it gives.

use softplug_plugin::parts::Block;

// Types of values.
const INT: u8 = 2;
pub(super) const TEXT: u8 = 3;
pub(super) const BYTES: u8 = 4;

/// All fields of a request: 240 bytes at most.
pub(super) type Fields = Block<256>;

/// Takes the next field, as index and payload.
pub(super) fn take<'a>(rest: &mut &'a [u8]) -> Option<(u8, &'a [u8])> {
    let [index, 0, _, 0, length, 0, after @ ..] = *rest else { return None };
    let (payload, after) = after.split_at_checked(usize::from(*length))?;
    *rest = after;
    Some((*index, payload))
}

/// Appends a field.
#[inline(never)]
pub(super) fn put(fields: &mut Fields, index: u8, kind: u8, payload: &[u8]) {
    fields.extend(&[index, 0, kind, 0, payload.len() as u8, 0]);
    fields.extend(payload);
}

/// Appends a number, if it is not the one that means none.
#[inline(never)]
pub(super) fn put_number(fields: &mut Fields, index: u8, number: u32, none: u32) {
    if number != none {
        put(fields, index, INT, &i64::from(number).to_le_bytes());
    }
}
