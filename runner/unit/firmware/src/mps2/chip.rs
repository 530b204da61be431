//! The registers: two UARTs of the CMSDK kind, a timer, the processor's tick and its interrupts.
//!
//! Each is a word at a fixed address of this chip, read and written as a whole, which is all that the unsafe code
//! here does. The processor's own are those of every Cortex-M4.
#![allow(unsafe_code)]

use core::arch::asm;
use core::ptr;

/// What all clocks here are counted by, in Hz.
pub(crate) const CLOCK: u32 = 25_000_000;

/// A register.
#[derive(Copy, Clone)]
struct Register(usize);

impl Register {
    fn read(self) -> u32 {
        // SAFETY: only addresses of registers of this chip are made here.
        unsafe { ptr::read_volatile(self.0 as *const u32) }
    }

    fn write(self, value: u32) {
        // SAFETY: only addresses of registers of this chip are made here; none of them lets the processor
        // change memory by itself.
        unsafe { ptr::write_volatile(self.0 as *mut u32, value) }
    }
}

/// A UART.
#[derive(Copy, Clone)]
pub(crate) struct Uart(usize);

/// To the machine; interrupt 0.
pub(crate) const MACHINE: Uart = Uart(0x4000_4000);
/// To the gateway; interrupt 2.
pub(crate) const UPLINK: Uart = Uart(0x4000_5000);

const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const RX_OVERRUN: u32 = 8;
const RX_INTERRUPT: u32 = 2;

impl Uart {
    fn data(self) -> Register {
        Register(self.0)
    }

    fn state(self) -> Register {
        Register(self.0 + 4)
    }

    fn interrupts(self) -> Register {
        Register(self.0 + 0xC)
    }

    /// Switches it on, with an interrupt for each byte that comes. It has 8N1 and nothing else.
    pub(crate) fn begin(self, baud: u32) {
        Register(self.0 + 0x10).write((CLOCK / baud).max(16));
        // Both directions, and the interrupt of the one.
        Register(self.0 + 8).write(1 | 2 | 8);
    }

    pub(crate) fn takes(self) -> bool {
        self.state().read() & TX_FULL == 0
    }

    pub(crate) fn put(self, byte: u8) {
        self.data().write(u32::from(byte));
    }

    /// Its interrupt is not asked for any more.
    pub(crate) fn clear(self) {
        self.interrupts().write(RX_INTERRUPT);
    }

    /// A byte that has come, if one has.
    pub(crate) fn get(self) -> Option<u8> {
        self.clear();
        (self.state().read() & RX_FULL != 0).then(|| self.data().read() as u8)
    }

    /// Whether a byte was lost since the last call.
    pub(crate) fn has_lost(self) -> bool {
        let has_lost = self.state().read() & RX_OVERRUN != 0;
        if has_lost {
            self.state().write(RX_OVERRUN);
        }
        has_lost
    }
}

/// Counts down by the clock, all the time.
const TIMER: usize = 0x4000_0000;

pub(crate) fn begin_timer() {
    Register(TIMER + 8).write(u32::MAX);
    Register(TIMER + 4).write(u32::MAX);
    Register(TIMER).write(1);
}

/// Clocks since the timer began, without what is beyond 32 bits.
pub(crate) fn clocks() -> u32 {
    u32::MAX - Register(TIMER + 4).read()
}

/// The processor wakes at least so often from here on.
pub(crate) fn begin_tick(clocks: u32) {
    Register(0xE000_E014).write(clocks - 1);
    Register(0xE000_E018).write(0);
    // On, with its interrupt, by the processor's clock.
    Register(0xE000_E010).write(7);
}

/// Interrupts 0 and 2.
pub(crate) fn begin_interrupts() {
    Register(0xE000_E100).write(1 | 1 << 2);
}

/// Waits for an interrupt, with handlers held off until [`handle`].
pub(crate) fn wait() {
    // SAFETY: holding interrupts off and waiting touches no memory; one that comes ends the wait all the same.
    unsafe { asm!("cpsid i", "wfi", options(nomem, nostack, preserves_flags)) }
}

/// Lets the handlers run that [`wait`] has held off.
pub(crate) fn handle() {
    // SAFETY: the handlers touch the rings and the UARTs only, neither of which is held by a reference.
    unsafe { asm!("cpsie i", options(nostack, preserves_flags)) }
}

/// Does something that no handler comes between.
pub(crate) fn alone<T>(act: impl FnOnce() -> T) -> T {
    // SAFETY: it holds the handlers off, no more; nothing here is called with them held off already.
    unsafe { asm!("cpsid i", options(nostack, preserves_flags)) }
    let done = act();
    handle();
    done
}

/// Begins anew, as after a loss of power.
pub(crate) fn reset() -> ! {
    Register(0xE000_ED0C).write(0x05FA_0004);
    loop {
        // SAFETY: it waits and touches no memory.
        unsafe { asm!("wfi", options(nomem, nostack, preserves_flags)) }
    }
}
