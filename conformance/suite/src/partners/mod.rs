//! Simulated partners: the machine at the other end of the line.
//!
//! Each is a sans-IO machine in whole µs. It is told what reached it and when,
//! says when it wants to be called next, and gives up the characters that have
//! left its transmitter. None shares code with the plug-ins that it judges.

pub mod fanuc;
pub mod r3964;
pub mod uart;
pub mod xon_xoff;

use softplug_abi::Micros;

/// A simulated machine as whoever drives it sees it. Time never runs backwards;
/// after every call, ask [`next_event`](Self::next_event) again.
pub trait Partner {
    /// A character has reached the machine: its stop bit ended at `now`.
    fn receive(&mut self, now: Micros, byte: u8);
    /// When the machine wants to be called next.
    fn next_event(&self) -> Option<Micros>;
    /// Does what is due.
    fn advance(&mut self, now: Micros);
    /// A character that has left the machine's transmitter by `now`.
    fn poll_transmit(&mut self, now: Micros) -> Option<u8>;
}

impl Partner for xon_xoff::Control {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.poll_transmit(now)
    }
}
