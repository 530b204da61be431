//! The start, the interrupts, and the one loop.
//!
//! The unsafe code here is what the vector table's macros make of the handlers' names.
#![allow(unsafe_code)]

use crate::chip::{self, MACHINE, UPLINK};
use crate::figures::{self, Figure};
use crate::flash::{self, Flash};
use crate::heap;
use crate::ring::Ring;
use alloc::boxed::Box;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m_rt::{entry, exception};
use softplug_abi::{LineParameters, Micros};
use softplug_interpreter::Room;
use softplug_unit_firmware::{Board, FromMachine, Options, Unit};
use softplug_unit_slots::Trust;

/// The rate of the line to the machine.
const BAUD: u32 = 19_200;
const UPLINK_BAUD: u32 = 460_800;
const CLOCKS_A_MICRO: u32 = chip::CLOCK / 1_000_000;
/// The processor wakes so often, in µs: twice a character.
const TICK: u32 = 250;
/// What the data sheet of such a flash promises.
const MOST_ERASES: u32 = 10_000;
/// For a plug-in: memory, 1,024 slots of stack, 64 calls within each other.
const ROOM: Room = Room { memory_bytes: 40 * 1_024, stack_slots: 1_024, call_depth: 64 };

static FROM_MACHINE: Ring<128> = Ring::new();
static FROM_UPLINK: Ring<256> = Ring::new();
static HAS_LOST: AtomicBool = AtomicBool::new(false);

struct Mps2 {
    now: Micros,
    /// What the timer showed when that was the time.
    at: u32,
    /// All clocks so far.
    clocks: u64,
}

impl Board for Mps2 {
    type Flash = Flash;
    type Code = &'static [u8];

    fn now(&mut self) -> Micros {
        let passed = chip::clocks().wrapping_sub(self.at);
        let micros = passed / CLOCKS_A_MICRO;
        self.at = self.at.wrapping_add(micros * CLOCKS_A_MICRO);
        self.clocks += u64::from(micros * CLOCKS_A_MICRO);
        self.now = self.now + Micros(i64::from(micros));
        self.now
    }

    /// This UART has 8N1 only. What QEMU connects to it takes bytes, whatever the characters would be.
    fn set_line(&mut self, line: &LineParameters) {
        MACHINE.begin(line.baud);
    }

    fn hear_machine(&mut self) -> Option<FromMachine> {
        let waiting = || FROM_MACHINE.pop().or_else(|| MACHINE.get());
        match FROM_MACHINE.pop().or_else(|| chip::alone(waiting)) {
            Some(byte) => Some(FromMachine::Byte(byte)),
            None => HAS_LOST.swap(false, Ordering::Relaxed).then_some(FromMachine::Overrun),
        }
    }

    fn machine_takes(&mut self) -> bool {
        MACHINE.takes()
    }

    fn tell_machine(&mut self, byte: u8) {
        MACHINE.put(byte);
    }

    /// This UART cannot send one; the line stays idle for as long.
    fn set_break(&mut self, _on: bool) {}

    /// What the handler had no room for waits in the UART: behind what is in the ring.
    fn hear_uplink_byte(&mut self) -> Option<u8> {
        FROM_UPLINK.pop().or_else(|| chip::alone(|| FROM_UPLINK.pop().or_else(|| UPLINK.get())))
    }

    fn tell_uplink_byte(&mut self, byte: u8) -> bool {
        let takes = UPLINK.takes();
        if takes {
            UPLINK.put(byte);
        }
        takes
    }

    fn code(&self, at: u32, length: u32) -> &'static [u8] {
        Flash::code(at, length)
    }
}

#[entry]
fn start() -> ! {
    let (static_bytes, stack_limit) = heap::begin();
    figures::begin(static_bytes, stack_limit);
    let starts = flash::count_start();
    chip::begin_timer();
    chip::begin_tick(TICK * CLOCKS_A_MICRO);
    UPLINK.begin(UPLINK_BAUD);
    MACHINE.begin(BAUD);
    chip::begin_interrupts();
    let mut unit = unit(starts);
    let (mut worked, mut turns) = (0_u64, 0_u32);
    loop {
        let begin = chip::clocks();
        chip::handle();
        unit.turn();
        turns = turns.wrapping_add(1);
        figures::set_long(Figure::Worked, Figure::WorkedHigh, worked);
        figures::set_long(Figure::Clocks, Figure::ClocksHigh, unit.board().clocks);
        figures::set(Figure::Turns, turns);
        worked += u64::from(chip::clocks().wrapping_sub(begin));
        chip::wait();
    }
}

/// In a call of its own: what is put together here takes stack that is free again afterwards.
#[inline(never)]
fn unit(starts: u32) -> Box<Unit<Mps2>> {
    let options = Options {
        name: "mps2",
        link: "machine",
        serial: 0x5350_0386,
        identity: 0x5350_0386 << 32 | u64::from(starts),
        baud: BAUD,
        trust: Trust::unsigned_too(&[]),
        most_erases: MOST_ERASES,
        room: ROOM,
    };
    let board = Mps2 { now: Micros::ZERO, at: chip::clocks(), clocks: 0 };
    Box::new(Unit::start(board, Flash, options).expect("the flash has room for two slots"))
}

/// Only for its wake.
#[exception]
fn SysTick() {}

#[exception]
unsafe fn DefaultHandler(interrupt: i16) {
    match interrupt {
        0 => {
            while !FROM_MACHINE.is_full()
                && let Some(byte) = MACHINE.get()
            {
                FROM_MACHINE.push(byte);
            }
            MACHINE.clear();
            if MACHINE.has_lost() {
                HAS_LOST.store(true, Ordering::Relaxed);
            }
        }
        2 => {
            // Clears the interrupt also where there is no room: the byte waits then, and what comes behind it.
            while !FROM_UPLINK.is_full()
                && let Some(byte) = UPLINK.get()
            {
                FROM_UPLINK.push(byte);
            }
            UPLINK.clear();
        }
        _ => panic!("an interrupt that nobody asked for: {interrupt}"),
    }
}

/// Nobody is there to be told: the board begins anew, as it would after a loss of power. The plug-in's trials are counted
/// in flash.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    chip::reset()
}
