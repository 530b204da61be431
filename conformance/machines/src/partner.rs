//! What every simulated machine is to whoever drives it.

use softplug_abi::{LineErrorKind, Micros, ModemLines};

/// A simulated machine as whoever drives it sees it. Time never runs backwards;
/// after every call, ask [`next_event`](Self::next_event) again.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_machines::{Partner, Signal};
/// use std::collections::VecDeque;
///
/// /// Sends back what it gets, a millisecond later.
/// #[derive(Default)]
/// struct Echo(VecDeque<(Micros, u8)>);
///
/// impl Partner for Echo {
///     fn receive(&mut self, now: Micros, byte: u8) {
///         self.0.push_back((now + Micros(1_000), byte));
///     }
///     fn next_event(&self) -> Option<Micros> {
///         self.0.front().map(|(at, _)| *at)
///     }
///     fn advance(&mut self, _now: Micros) {}
///     fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
///         self.0.pop_front_if(|(at, _)| *at <= now).map(|(_, byte)| byte)
///     }
/// }
///
/// let mut echo = Echo::default();
/// echo.receive(Micros(500), b'G');
/// assert_eq!(echo.next_event(), Some(Micros(1_500)));
/// assert_eq!(echo.poll_signal(Micros(1_500)), Some(Signal::Character(b'G')));
/// ```
pub trait Partner {
    /// A character has reached the machine: its stop bit ended at `now`.
    fn receive(&mut self, now: Micros, byte: u8);
    /// When the machine wants to be called next.
    fn next_event(&self) -> Option<Micros>;
    /// Does what is due.
    fn advance(&mut self, now: Micros);
    /// A character that has left the machine's transmitter by `now`.
    fn poll_transmit(&mut self, now: Micros) -> Option<u8>;

    /// What else a line carries, in one order with the characters. A machine
    /// that damages characters or has modem lines gives all of its output here.
    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.poll_transmit(now).map(Signal::Character)
    }

    /// A damaged character or a break has reached the machine. One that does not
    /// look at such things takes what was read.
    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, byte: Option<u8>) {
        let _ = kind;
        if let Some(byte) = byte {
            self.receive(now, byte);
        }
    }

    /// The plug-in has set these of its port's outputs.
    fn modem_lines(&mut self, now: Micros, lines: ModemLines, on: ModemLines) {
        let _ = (now, lines, on);
    }
}

/// What comes from a machine, as the plug-in's port sees it.
///
/// The example of [`Partner`] shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Signal {
    /// A character.
    Character(u8),
    /// A damaged character, or a break, which has none.
    LineError {
        /// What the port says of it.
        kind: LineErrorKind,
        /// The character as it is read.
        byte: Option<u8>,
    },
    /// Inputs of the plug-in's port.
    ModemLines {
        /// Those that the machine drives.
        lines: ModemLines,
        /// Those of them that are on.
        on: ModemLines,
    },
}
