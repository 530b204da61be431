//! The two exported functions, the mailbox, and a panic's last words.
//!
//! This is the crate's only unsafe code. It is sound because a plug-in has one
//! thread (its module has no shared memory and no threads feature), its host
//! calls one export at a time, and none of these functions calls back out: so
//! nothing else can hold a reference into the cell while one of them runs.
#![allow(unsafe_code)]

use crate::Converter;
use crate::machine::Machine;
use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use softplug_abi::{MORE_OUTPUT, Micros, Refusal};

/// Length of the input buffer in bytes: 1,024 bytes and the largest head.
const INPUT: usize = 1_040;
/// Length of the output buffer in bytes.
const OUTPUT: usize = 4_096;
/// Length of the region of last words in bytes.
const WORDS: usize = 256;

/// Exports a converter as a plug-in. Only on wasm32; elsewhere it is nothing,
/// so that the same crate runs natively.
///
/// The crate is a `cdylib`, `no_std` on wasm32.
#[macro_export]
macro_rules! export {
    ($converter:ty) => {
        #[cfg(target_arch = "wasm32")]
        #[allow(unsafe_code)]
        const _: () = {
            use $crate::Converter;
            use $crate::export::{Cell, bytes};

            const MANIFEST: &str = <$converter as Converter>::MANIFEST;

            #[used]
            #[unsafe(link_section = "softplug.manifest")]
            static SECTION: [u8; MANIFEST.len()] = bytes(MANIFEST);

            static CELL: Cell<$converter> = Cell::new();

            #[unsafe(no_mangle)]
            extern "C" fn softplug_v1() -> i32 {
                CELL.descriptor()
            }

            #[unsafe(no_mangle)]
            extern "C" fn softplug_v1_step(kind: i32, length: i32, now_us: i64) -> i32 {
                CELL.step(kind, length, now_us)
            }

            #[panic_handler]
            fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
                CELL.last_words(info);
                core::arch::wasm32::unreachable()
            }
        };
    };
}

/// A text as an array; for [`export!`](crate::export!).
#[doc(hidden)]
pub const fn bytes<const N: usize>(text: &str) -> [u8; N] {
    let mut out = [0; N];
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < N {
        out[at] = bytes[at];
        at += 1;
    }
    out
}

/// All of a plug-in's memory that lives between two calls; for [`export!`](crate::export!).
#[doc(hidden)]
#[derive(Debug)]
pub struct Cell<C: Converter> {
    machine: UnsafeCell<Machine<C>>,
    input: UnsafeCell<[u8; INPUT]>,
    output: UnsafeCell<[u8; OUTPUT]>,
    words: UnsafeCell<[u8; WORDS]>,
    descriptor: UnsafeCell<[u32; 6]>,
}

// SAFETY: one thread, and no call while another is under way; see the top of this file.
unsafe impl<C: Converter> Sync for Cell<C> {}

impl<C: Converter> Cell<C> {
    /// Before the first call.
    #[allow(clippy::new_without_default, reason = "it must be const")]
    pub const fn new() -> Self {
        Self {
            machine: UnsafeCell::new(Machine::new()),
            input: UnsafeCell::new([0; INPUT]),
            output: UnsafeCell::new([0; OUTPUT]),
            words: UnsafeCell::new([0; WORDS]),
            descriptor: UnsafeCell::new([0; 6]),
        }
    }

    /// `softplug_v1`.
    pub fn descriptor(&self) -> i32 {
        let address = |pointer: *mut u8| pointer as usize as u32;
        let descriptor = [
            address(self.input.get().cast()),
            INPUT as u32,
            address(self.output.get().cast()),
            OUTPUT as u32,
            address(self.words.get().cast()),
            WORDS as u32,
        ];
        // SAFETY: no other reference into the cell is alive.
        unsafe { *self.descriptor.get() = descriptor };
        self.descriptor.get() as usize as i32
    }

    /// `softplug_v1_step`.
    pub fn step(&self, kind: i32, length: i32, now_us: i64) -> i32 {
        // SAFETY: no other reference into the cell is alive, and the four parts
        // do not overlap.
        let (machine, input, output, words) = unsafe {
            (
                &mut *self.machine.get(),
                &*self.input.get(),
                &mut *self.output.get(),
                &mut *self.words.get(),
            )
        };
        let payload = usize::try_from(length).ok().and_then(|length| input.get(..length));
        let Some(payload) = payload else {
            return -i32::from(Refusal::MalformedEvent.code());
        };
        match machine.step(kind, payload, Micros(now_us), output) {
            Ok((written, false)) => written as i32,
            Ok((written, true)) => written as i32 | MORE_OUTPUT,
            Err((refusal, text)) => {
                let mut writer = Words::begin(words);
                let _ = writer.write_str(text);
                -i32::from(refusal.code())
            }
        }
    }

    /// Leaves a panic's text and place.
    pub fn last_words(&self, info: &core::panic::PanicInfo<'_>) {
        // SAFETY: the step that panicked never goes on, so its references are
        // no longer used.
        let words = unsafe { &mut *self.words.get() };
        let mut writer = Words::begin(words);
        let _ = write!(writer, "{}", info.message());
        if let Some(place) = info.location() {
            let _ = write!(writer, ", at {}:{}", place.file(), place.line());
        }
    }
}

/// Writes text behind its length; what does not fit is cut.
struct Words<'a> {
    region: &'a mut [u8; WORDS],
    length: usize,
}

impl<'a> Words<'a> {
    fn begin(region: &'a mut [u8; WORDS]) -> Self {
        let mut words = Self { region, length: 0 };
        words.set_length();
        words
    }

    fn set_length(&mut self) {
        self.region[..4].copy_from_slice(&(self.length as u32).to_le_bytes());
    }
}

impl Write for Words<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let start = 4 + self.length;
        let count = text.len().min(WORDS - start);
        self.region[start..start + count].copy_from_slice(&text.as_bytes()[..count]);
        self.length += count;
        self.set_length();
        Ok(())
    }
}
