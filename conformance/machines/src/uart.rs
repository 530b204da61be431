//! A UART as software meets it: characters leave one after the other at the
//! line's rate, and those that arrive wait in a FIFO until somebody comes.

use std::collections::VecDeque;

use softplug_abi::{LineParameters, Micros};

/// What a [`Uart`] is made of.
///
/// The example of [`Uart`] shows them.
#[derive(Copy, Clone, Debug)]
pub struct UartOptions {
    /// The line's parameters. At a rate of 0 (a pty, TCP) characters leave at
    /// once.
    pub line: LineParameters,
    /// Characters that the transmitter holds, the one on the wire included.
    pub transmit_fifo: usize,
    /// Characters that the receiver holds until they are served.
    pub receive_fifo: usize,
    /// From the arrival of a character in an empty receive FIFO until the
    /// software comes and takes all that is there.
    pub latency: Micros,
}

/// Whether a character belongs to flow control or to the data. The wire does
/// not tell them apart, the books do.
///
/// The example of [`Uart`] shows both.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Sort {
    /// A control byte, put in front of the data that waits outside the FIFO.
    Control,
    /// A byte of data.
    Data,
}

/// A character whose last bit has left.
///
/// The example of [`Uart`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Left {
    /// When its last stop bit ended.
    pub at: Micros,
    /// The character.
    pub byte: u8,
    /// What it was for.
    pub sort: Sort,
}

/// Characters arrived that the receive FIFO had no room for: this one is lost.
///
/// The example of [`Uart`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Overrun;

/// The model of a UART, both directions.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::uart::{Left, Overrun, Sort, Uart, UartOptions};
///
/// let line = LineParameters::new(9_600);
/// let latency = Micros(500);
/// let mut uart = Uart::new(UartOptions { line, transmit_fifo: 2, receive_fifo: 1, latency });
/// assert!(uart.push(Micros(0), b'G', Sort::Data));
/// assert!(uart.push(Micros(0), 0x13, Sort::Control));
/// assert!(!uart.push(Micros(0), b'1', Sort::Data), "the FIFO is full");
/// let left = Left { at: Micros(1_042), byte: b'G', sort: Sort::Data };
/// assert_eq!(uart.poll(Micros(1_042)), Some(left));
///
/// // The software comes 500 µs after the first arrival: too late for the second.
/// assert_eq!(uart.arrive(Micros(2_000), b'A'), Ok(()));
/// assert_eq!(uart.arrive(Micros(2_400), b'B'), Err(Overrun));
/// assert_eq!(uart.serve(Micros(2_500)), Some(b'A'));
/// ```
#[derive(Debug)]
pub struct Uart {
    options: UartOptions,
    transmit: VecDeque<Left>,
    /// Start of the first character of the present back-to-back run, and how
    /// many characters the run has: their ends follow without rounding drift.
    run_start: Micros,
    run_length: u64,
    run_end: Micros,
    receive: VecDeque<u8>,
    served_at: Micros,
}

impl Uart {
    /// An idle UART.
    pub fn new(options: UartOptions) -> Self {
        Self {
            options,
            transmit: VecDeque::with_capacity(options.transmit_fifo),
            run_start: Micros(i64::MIN),
            run_length: 0,
            run_end: Micros(i64::MIN),
            receive: VecDeque::with_capacity(options.receive_fifo),
            served_at: Micros::ZERO,
        }
    }

    /// Whether the transmitter takes another character.
    pub fn has_room(&self) -> bool {
        self.transmit.len() < self.options.transmit_fifo
    }

    /// Gives a character to the transmitter; false, and nothing done, where
    /// its FIFO is full.
    ///
    /// The nth character of a run that started at t ends at
    /// t + ceil(n · bits · 10⁶ / baud).
    #[must_use]
    pub fn push(&mut self, now: Micros, byte: u8, sort: Sort) -> bool {
        if !self.has_room() {
            return false;
        }
        if now > self.run_end {
            self.run_start = now;
            self.run_length = 0;
        }
        self.run_length += 1;
        self.run_end = if self.options.line.baud == 0 {
            now
        } else {
            self.run_start + self.options.line.characters(self.run_length)
        };
        self.transmit.push_back(Left { at: self.run_end, byte, sort });
        true
    }

    /// When the next character's last bit will have left.
    pub fn next_left(&self) -> Option<Micros> {
        self.transmit.front().map(|character| character.at)
    }

    /// Characters of a sort that have not left yet.
    pub fn waiting(&self, sort: Sort) -> usize {
        self.transmit.iter().filter(|character| character.sort == sort).count()
    }

    /// Takes the next character whose last bit has left by now.
    pub fn poll(&mut self, now: Micros) -> Option<Left> {
        if self.next_left()? > now {
            return None;
        }
        self.transmit.pop_front()
    }

    /// A character's stop bit ended now.
    ///
    /// # Errors
    /// The receive FIFO is full: the character is lost.
    pub fn arrive(&mut self, now: Micros, byte: u8) -> Result<(), Overrun> {
        if self.receive.len() >= self.options.receive_fifo {
            return Err(Overrun);
        }
        if self.receive.is_empty() {
            self.served_at = now + self.options.latency;
        }
        self.receive.push_back(byte);
        Ok(())
    }

    /// When the software comes for the characters in the receive FIFO.
    pub fn next_service(&self) -> Option<Micros> {
        (!self.receive.is_empty()).then_some(self.served_at)
    }

    /// Takes the next character out of the receive FIFO, once it is served.
    pub fn serve(&mut self, now: Micros) -> Option<u8> {
        if self.next_service()? > now {
            return None;
        }
        self.receive.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uart(baud: u32, transmit_fifo: usize, latency: i64) -> Uart {
        let line = LineParameters::new(baud);
        Uart::new(UartOptions { line, transmit_fifo, receive_fifo: 4, latency: Micros(latency) })
    }

    fn ends(uart: &mut Uart, until: i64) -> Vec<i64> {
        std::iter::from_fn(|| uart.poll(Micros(until))).map(|left| left.at.0).collect()
    }

    #[test]
    fn characters_leave_back_to_back_in_exact_time() {
        let mut uart = uart(9_600, 16, 0);
        for byte in 0..6 {
            assert!(uart.push(Micros(100), byte, Sort::Data));
        }
        assert_eq!(uart.poll(Micros(1_141)), None);
        assert_eq!(uart.next_left(), Some(Micros(1_142)));
        // 1,041.67 µs each, rounded up once and not six times.
        assert_eq!(ends(&mut uart, 10_000), [1_142, 2_184, 3_225, 4_267, 5_309, 6_350]);
    }

    #[test]
    fn a_thousand_characters_at_a_megabaud_do_not_drift() {
        let mut uart = uart(921_600, 1_000, 0);
        for _ in 0..1_000 {
            assert!(uart.push(Micros(0), b'x', Sort::Data));
        }
        let ends = ends(&mut uart, i64::MAX);
        assert_eq!((ends[0], ends[1], ends[999]), (11, 22, 10_851));
    }

    #[test]
    fn a_run_goes_on_when_fed_in_time_and_starts_anew_after_a_gap() {
        let mut uart = uart(9_600, 2, 0);
        assert!(uart.push(Micros(0), 1, Sort::Data));
        assert_eq!(ends(&mut uart, 1_042), [1_042]);
        // At the very end of the last stop bit: still back to back.
        assert!(uart.push(Micros(1_042), 2, Sort::Data));
        assert_eq!(ends(&mut uart, 5_000), [2_084]);
        assert!(uart.push(Micros(2_085), 3, Sort::Data));
        assert_eq!(ends(&mut uart, 5_000), [3_127]);
    }

    #[test]
    fn a_full_fifo_refuses_until_a_character_has_left() {
        let mut uart = uart(9_600, 2, 0);
        assert!(uart.push(Micros(0), 1, Sort::Data));
        assert!(uart.push(Micros(0), 2, Sort::Control));
        assert!(!uart.push(Micros(0), 3, Sort::Data));
        assert_eq!(uart.poll(Micros(1_042)).map(|left| left.byte), Some(1));
        assert!(uart.push(Micros(1_042), 3, Sort::Data));
        let left = uart.poll(Micros(2_084));
        assert_eq!(left, Some(Left { at: Micros(2_084), byte: 2, sort: Sort::Control }));
    }

    #[test]
    fn without_a_rate_characters_leave_at_once() {
        let mut uart = uart(0, 3, 0);
        assert!(uart.push(Micros(7), 1, Sort::Data));
        assert!(uart.push(Micros(9), 2, Sort::Data));
        assert_eq!(ends(&mut uart, 9), [7, 9]);
    }

    #[test]
    fn parity_and_stop_bits_lengthen_a_character() {
        let line = LineParameters {
            baud: 9_600,
            data_bits: 7,
            parity: softplug_abi::Parity::Even,
            stop_half_bits: 4,
        };
        let mut uart = Uart::new(UartOptions {
            line,
            transmit_fifo: 1,
            receive_fifo: 1,
            latency: Micros::ZERO,
        });
        assert!(uart.push(Micros(0), 0, Sort::Data));
        assert_eq!(uart.next_left(), Some(Micros(1_146)));
    }

    #[test]
    fn arrivals_wait_for_the_software_and_overrun_when_it_is_late() {
        let mut uart = uart(9_600, 1, 1_000);
        for (at, byte) in [(0, 10), (300, 11), (600, 12), (900, 13)] {
            assert_eq!(uart.arrive(Micros(at), byte), Ok(()));
        }
        assert_eq!(uart.arrive(Micros(950), 14), Err(Overrun));
        assert_eq!(uart.next_service(), Some(Micros(1_000)));
        assert_eq!(uart.serve(Micros(999)), None);
        let served: Vec<_> = std::iter::from_fn(|| uart.serve(Micros(1_000))).collect();
        assert_eq!(served, [10, 11, 12, 13]);
        assert_eq!(uart.next_service(), None);
        assert_eq!(uart.arrive(Micros(1_200), 15), Ok(()));
        assert_eq!(uart.next_service(), Some(Micros(2_200)));
    }
}
