//! Figures to be read from outside, as words in the last 64 bytes of RAM: a debugger, or QEMU's monitor, finds them
//! at 2001FFC0.
//!
//! The unsafe code here writes to these bytes, which the linker gives to nothing else (memory.x), and paints
//! the stack that is not in use yet.
#![allow(unsafe_code)]

use core::arch::asm;
use core::ptr;

const PLACE: usize = 0x2001_FFC0;
/// So that a reader knows what it sees.
const MAGIC: u32 = 0x5350_4655;
/// What unused stack is filled with.
const PAINT: u32 = 0xA5A5_A5A5;

/// A figure, by its place.
#[derive(Copy, Clone)]
pub(crate) enum Figure {
    Magic,
    /// Bytes of data that the program has from the start.
    Static,
    /// The most bytes of heap, to the end of the highest block there ever was.
    Heap,
    /// Where the stack may reach to, and where it begins.
    StackLimit,
    StackStart,
    /// Clocks in which the processor worked, of all clocks; 64 bits each, the lower half first.
    Worked,
    WorkedHigh,
    Clocks,
    ClocksHigh,
    /// Rounds.
    Turns,
}

pub(crate) fn set(figure: Figure, value: u32) {
    let place = (PLACE + 4 * figure as usize) as *mut u32;
    // SAFETY: these bytes of RAM are the figures' own; there are fewer than 16.
    unsafe { ptr::write_volatile(place, value) }
}

pub(crate) fn set_long(low: Figure, high: Figure, value: u64) {
    set(low, value as u32);
    set(high, (value >> 32) as u32);
}

/// Paints the stack from its limit to where it is now.
pub(crate) fn begin(static_bytes: usize, stack_limit: usize) {
    let stack: usize;
    // SAFETY: it only reads the stack pointer.
    unsafe { asm!("mov {}, sp", out(reg) stack, options(nomem, nostack, preserves_flags)) }
    for place in (stack_limit..stack - 256).step_by(4) {
        // SAFETY: below what is in use, with room for what this function itself needs; above the heap.
        unsafe { ptr::write_volatile(place as *mut u32, PAINT) }
    }
    set(Figure::Static, static_bytes as u32);
    set(Figure::StackLimit, stack_limit as u32);
    set(Figure::StackStart, PLACE as u32);
    set(Figure::Magic, MAGIC);
}
