//! A port that clocks characters out, in front of a machine.

use std::collections::VecDeque;

use softplug_abi::{LineErrorKind, Micros, ModemLines};

use crate::{Partner, Signal};

/// Whoever drives it need not come for each character.
const LOOK_EVERY: Micros = Micros::from_millis(5);

/// A port that takes characters whenever they are given to it, and hands one over to the machine in
/// each period for as long as it has some: the queue of an adapter or a driver. For machines at which
/// the moment of a character counts, where a pseudo-terminal keeps no rate.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::pulse_lathe::{Lathe, LatheOptions, PERIOD};
/// use softplug_machines::{Clocked, Partner};
///
/// let mut port = Clocked::new(Lathe::new(LatheOptions::default())?, PERIOD);
/// // Three pulses of one cut: two at once, and the third before the second has left.
/// port.receive(Micros(1_000), 0x44);
/// port.receive(Micros(1_000), 0x44);
/// port.receive(Micros(1_490), 0x04);
/// port.advance(Micros(2_000));
/// assert_eq!((port.machine().report().z, port.machine().report().gaps), (3, 0));
/// # Ok::<(), softplug_machines::pulse_lathe::LatheOptionsError>(())
/// ```
#[derive(Debug)]
pub struct Clocked<P> {
    machine: P,
    period: Micros,
    /// What waits in the port, and when each has left.
    queue: VecDeque<(Micros, u8)>,
    /// When the last character that was given has left.
    free: Micros,
    most: usize,
}

impl<P: Partner> Clocked<P> {
    /// In front of a machine; a character each period, of at least 1 µs.
    pub fn new(machine: P, period: Micros) -> Self {
        let period = period.max(Micros(1));
        Self { machine, period, queue: VecDeque::new(), free: Micros::ZERO, most: 0 }
    }

    /// The machine, to look at.
    pub fn machine(&self) -> &P {
        &self.machine
    }

    /// Characters that wait in the port.
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// The most that have waited.
    pub fn most_waited(&self) -> usize {
        self.most
    }
}

impl<P: Partner> Partner for Clocked<P> {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.free = self.free.max(now) + self.period;
        self.queue.push_back((self.free, byte));
        self.most = self.most.max(self.queue.len());
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, byte: Option<u8>) {
        self.machine.receive_damaged(now, kind, byte);
    }

    fn modem_lines(&mut self, now: Micros, lines: ModemLines, on: ModemLines) {
        self.machine.modem_lines(now, lines, on);
    }

    fn next_event(&self) -> Option<Micros> {
        let last = self.queue.back().map(|(at, _)| *at);
        let soon = self.queue.front().map(|(at, _)| *at + LOOK_EVERY);
        let queue = last.zip(soon).map(|(last, soon)| last.min(soon));
        queue.into_iter().chain(self.machine.next_event()).min()
    }

    fn advance(&mut self, now: Micros) {
        while let Some((at, byte)) = self.queue.pop_front_if(|(at, _)| *at <= now) {
            self.machine.advance(at);
            self.machine.receive(at, byte);
        }
        self.machine.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.machine.poll_transmit(now)
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.machine.poll_signal(now)
    }
}

#[cfg(test)]
mod tests {
    use super::Clocked;
    use crate::Partner;
    use crate::pulse_lathe::{Lathe, LatheOptions, PERIOD};
    use softplug_abi::Micros;

    fn lathe() -> Clocked<Lathe> {
        Clocked::new(Lathe::new(LatheOptions::default()).unwrap(), PERIOD)
    }

    #[test]
    fn a_port_that_runs_dry_in_a_cut_leaves_a_gap() {
        let mut port = lathe();
        for _ in 0..40 {
            port.receive(Micros::ZERO, 0x44);
        }
        assert_eq!((port.waiting(), port.next_event()), (40, Some(Micros(5_250))));
        // Forty periods last for 10 ms; the next comes half a period later.
        port.receive(Micros(10_125), 0x04);
        port.advance(Micros(20_000));
        let report = port.machine().report();
        assert_eq!((report.z, report.gaps, report.longest_gap), (41, 1, Micros(125)));
        assert_eq!((port.waiting(), port.most_waited()), (0, 41));
    }

    #[test]
    fn what_the_machine_says_has_its_own_moment() {
        let mut port = lathe();
        port.receive(Micros::ZERO, 0x04);
        port.receive(Micros::ZERO, 0xC3);
        assert_eq!(port.next_event(), Some(Micros(500)));
        // Somebody comes late; the tool was changed 5 ms behind the command all the same.
        port.advance(Micros(5_600));
        assert_eq!(port.poll_transmit(Micros(5_749)), None);
        assert_eq!(port.poll_transmit(Micros(5_750)), Some(0xC3));
    }
}
