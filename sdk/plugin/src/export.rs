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
use softplug_abi::wire::copy;
use softplug_abi::{MORE_OUTPUT, Micros, Refusal};

/// Length of the input buffer in bytes: 1,024 bytes and the largest head.
pub(crate) const INPUT: usize = 1_040;
/// Length of the output buffer in bytes.
pub(crate) const OUTPUT: usize = 4_096;
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
            use $crate::export::{Buffers, Cell, bytes};

            const MANIFEST: &str = <$converter as Converter>::MANIFEST;

            // Without `#[used]`: that would put a second copy into the data.
            #[unsafe(link_section = "softplug.manifest")]
            pub static SECTION: [u8; MANIFEST.len()] = bytes(MANIFEST);

            static CELL: Cell<$converter> = Cell::new();
            const STATE: usize = <$converter as Converter>::STATE_CAPACITY;
            static BUFFERS: Buffers<STATE> = Buffers::new();

            #[unsafe(no_mangle)]
            extern "C" fn softplug_v1() -> i32 {
                BUFFERS.descriptor()
            }

            #[unsafe(no_mangle)]
            extern "C" fn softplug_v1_step(kind: i32, length: i32, now_us: i64) -> i32 {
                CELL.step(&BUFFERS, kind, length, now_us)
            }

            #[panic_handler]
            fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
                BUFFERS.last_words(info);
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

/// The converter between two calls; for [`export!`](crate::export!).
#[doc(hidden)]
#[derive(Debug)]
pub struct Cell<C: Converter> {
    machine: UnsafeCell<Machine<C>>,
}

// SAFETY: one thread, and no call while another is under way; see the top of this file.
unsafe impl<C: Converter> Sync for Cell<C> {}

impl<C: Converter> Cell<C> {
    /// Before the first call.
    #[allow(clippy::new_without_default, reason = "it must be const")]
    pub const fn new() -> Self {
        Self { machine: UnsafeCell::new(Machine::new()) }
    }

    /// `softplug_v1_step`.
    #[inline]
    pub fn step<const STATE: usize>(
        &self,
        buffers: &Buffers<STATE>,
        kind: i32,
        length: i32,
        now_us: i64,
    ) -> i32 {
        // SAFETY: no other reference into the cell or the buffers is alive, and
        // the buffers do not overlap.
        let (machine, input, output, words, state) = unsafe {
            (
                &mut *self.machine.get(),
                &*buffers.input.get(),
                &mut *buffers.output.get(),
                &mut *buffers.words.get(),
                &mut *buffers.state.get(),
            )
        };
        let payload = usize::try_from(length).ok().and_then(|length| input.get(..length));
        let Some(payload) = payload else {
            return -i32::from(Refusal::MalformedEvent.code());
        };
        match machine.step(kind, payload, Micros(now_us), output, state) {
            Ok((written, false)) => written as i32,
            Ok((written, true)) => written as i32 | MORE_OUTPUT,
            Err(refusal) => {
                let mut words = Words::begin(words);
                let (text, wrong) = machine.why();
                words.push(text.as_bytes());
                if let Some(error) = wrong {
                    error.tell(|byte| words.push(&[byte]));
                }
                words.finish();
                -i32::from(refusal.code())
            }
        }
    }
}

/// The mailbox, and space for a state to restore; for [`export!`](crate::export!).
/// Apart from the converter, because what is all zeros takes no space in the module.
/// Aligned, because a copy between aligned buffers takes a third of the time.
#[doc(hidden)]
#[derive(Debug)]
#[repr(C, align(8))]
pub struct Buffers<const STATE: usize> {
    input: UnsafeCell<[u8; INPUT]>,
    output: UnsafeCell<[u8; OUTPUT]>,
    words: UnsafeCell<[u8; WORDS]>,
    state: UnsafeCell<[u8; STATE]>,
    descriptor: UnsafeCell<[u32; 6]>,
}

// SAFETY: as for `Cell`.
unsafe impl<const STATE: usize> Sync for Buffers<STATE> {}

impl<const STATE: usize> Buffers<STATE> {
    /// Before the first call.
    #[allow(clippy::new_without_default, reason = "it must be const")]
    pub const fn new() -> Self {
        Self {
            input: UnsafeCell::new([0; INPUT]),
            output: UnsafeCell::new([0; OUTPUT]),
            words: UnsafeCell::new([0; WORDS]),
            state: UnsafeCell::new([0; STATE]),
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
        // SAFETY: no other reference into the buffers is alive.
        unsafe { *self.descriptor.get() = descriptor };
        self.descriptor.get() as usize as i32
    }

    /// Leaves a panic's text and place.
    pub fn last_words(&self, info: &core::panic::PanicInfo<'_>) {
        // SAFETY: the step that panicked never goes on, so its references are
        // no longer used.
        let words = unsafe { &mut *self.words.get() };
        let mut writer = Words::begin(words);
        #[cfg(feature = "panic-format")]
        let _ = core::fmt::Write::write_fmt(&mut writer, format_args!("{}", info.message()));
        #[cfg(not(feature = "panic-format"))]
        writer.push(
            info.message()
                .as_str()
                .unwrap_or("a formatted message (see the feature panic-format)")
                .as_bytes(),
        );
        if let Some(place) = info.location() {
            writer.push(b", at ");
            writer.push(place.file().as_bytes());
            writer.push(b":");
            writer.number(place.line());
        }
        writer.finish();
    }
}

/// Writes text behind its length; what does not fit is cut.
struct Words<'a> {
    region: &'a mut [u8; WORDS],
    length: usize,
}

impl<'a> Words<'a> {
    fn begin(region: &'a mut [u8; WORDS]) -> Self {
        Self { region, length: 0 }
    }

    /// Only now a host sees the text.
    #[inline(never)]
    fn finish(&mut self) {
        copy(self.region, &(self.length as u32).to_le_bytes());
    }

    #[inline(never)]
    fn push(&mut self, text: &[u8]) {
        let free = self.region.get_mut(4 + self.length..).unwrap_or_default();
        self.length += text.len().min(free.len());
        copy(free, text);
    }

    fn number(&mut self, value: u32) {
        if value >= 10 {
            self.number(value / 10);
        }
        self.push(&[b'0' + (value % 10) as u8]);
    }
}

#[cfg(feature = "panic-format")]
impl core::fmt::Write for Words<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        self.push(text.as_bytes());
        Ok(())
    }
}
