//! Which mutant of a plug-in is on.
//!
//! `cargo xtask mutants` makes a copy of the plug-ins' sources in which each place that a
//! catalogue of `fixtures/mutants` changes asks [`is_on`]. One module so holds every mutant
//! of a plug-in, and behaves as the real one until somebody writes the [`id`] of one of them
//! behind [`MARKER`] into its bytes. No plug-in that is released depends on this.
//!
//! ```
//! let is_held = |byte: u8| {
//!     if softplug_mutant::is_on(const { softplug_mutant::id("xon-xoff.tx.obey-xoff/ignored") }) {
//!         false
//!     } else {
//!         byte == 0x13
//!     }
//! };
//! assert!(is_held(0x13));
//! ```
#![no_std]

use core::hint::black_box;
use core::sync::atomic::{AtomicU32, Ordering};

/// What stands before the eight bytes of the [`id`] that is on, little-endian.
pub const MARKER: [u8; 16] = *b"softplug-mutant:";

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

/// Whether the mutant of this [`id`] is on.
#[inline(never)]
pub fn is_on(id: u64) -> bool {
    // Read as if it could change: the compiler must not know what stands there.
    u64::from_le_bytes(black_box(&CELL).on) == id
}

/// Keeps a number for the mutant that is on, as long as the module is loaded; returns the one
/// before, at first 0.
///
/// ```
/// assert_eq!(softplug_mutant::remember(7), 0);
/// assert_eq!(softplug_mutant::remembered(), 7);
/// ```
pub fn remember(number: u32) -> u32 {
    let before = remembered();
    MEMORY.store(number, Ordering::Relaxed);
    before
}

/// The number that was kept last, at first 0.
pub fn remembered() -> u32 {
    MEMORY.load(Ordering::Relaxed)
}

/// What is looked for in the module's bytes, and what is written behind it.
#[repr(C)]
struct Cell {
    marker: [u8; 16],
    on: [u8; 8],
}

static CELL: Cell = Cell { marker: MARKER, on: [0; 8] };

/// Only one mutant is on, so that one number is enough.
static MEMORY: AtomicU32 = AtomicU32::new(0);
