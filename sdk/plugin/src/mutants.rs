//! One-rule mutants: plug-ins that are wrong on purpose, to prove that the
//! conformance suite notices.
//!
//! A build with the feature `mutants` holds every mutant of a plug-in and behaves
//! as the real one. A cell in its data names the mutant that is active, by
//! [`id`]; who tests the suite writes the id behind [`MARKER`] into the
//! module's bytes. Without the feature nothing of this is left in the code.
//!
//! ```
//! use softplug_plugin::mutant;
//!
//! fn is_held(byte: u8) -> bool {
//!     byte == 0x13 && !mutant!("xon-xoff.tx.obey-xoff/ignored")
//! }
//! assert!(is_held(0x13));
//! ```

/// What stands before the eight bytes of the active mutant's [`id`], little-endian.
pub const MARKER: [u8; 16] = *b"softplug-mutant:";

/// Whether the mutant of this name is active; never without the feature `mutants`.
// The bare word: a call, even of what is constant, can move the code around it. The
// name beside it, so that no two conditions read the same.
#[cfg(not(feature = "mutants"))]
#[macro_export]
macro_rules! mutant {
    ($name:literal) => {{
        const _: &str = $name;
        false
    }};
}

/// Whether the mutant of this name is active; never without the feature `mutants`.
#[cfg(feature = "mutants")]
#[macro_export]
macro_rules! mutant {
    ($name:literal) => {{
        const ID: u64 = $crate::mutants::id($name);
        $crate::mutants::is_active(ID)
    }};
}

/// The number of a mutant's name: FNV-1a, 64 bits. 0 is no mutant.
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

/// For [`mutant!`](crate::mutant!).
#[doc(hidden)]
#[cfg(feature = "mutants")]
#[inline(never)]
pub fn is_active(id: u64) -> bool {
    // Read as if it could change: the compiler must not know what stands there.
    u64::from_le_bytes(core::hint::black_box(&CELL).active) == id
}

/// What is looked for in the module's bytes, and what is written behind it.
#[cfg(feature = "mutants")]
#[repr(C)]
struct Cell {
    marker: [u8; 16],
    active: [u8; 8],
}

#[cfg(feature = "mutants")]
static CELL: Cell = Cell { marker: MARKER, active: [0; 8] };
