//! A machine that keeps what it gets.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use std::time::{Duration, Instant};

use softplug_abi::{LineErrorKind, Micros, ModemLines};
use softplug_machines::{Partner, Signal};

/// So long that only something lost makes a test wait for it.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

#[derive(Debug, Default)]
pub(crate) struct State {
    pub(crate) received: Vec<u8>,
    pub(crate) damaged: Vec<LineErrorKind>,
    pub(crate) outputs: Vec<(ModemLines, ModemLines)>,
    /// Sends back what it gets.
    pub(crate) echoes: bool,
    /// Sends XOFF once it has so many characters.
    pub(crate) holds_after: Option<usize>,
    signals: VecDeque<Signal>,
}

/// Clones share the machine.
#[derive(Clone, Debug, Default)]
pub(crate) struct Machine(Arc<Mutex<State>>);

impl Machine {
    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// Sends XOFF once it has `count` characters.
    pub(crate) fn holding_after(count: usize) -> Self {
        let machine = Self::default();
        machine.state().holds_after = Some(count);
        machine
    }

    pub(crate) fn wait_until(&self, is_enough: impl Fn(&State) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !is_enough(&self.state()) {
            assert!(Instant::now() < end, "the machine stays at {:?}", self.state());
            thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Partner for Machine {
    fn receive(&mut self, _: Micros, byte: u8) {
        let mut state = self.state();
        state.received.push(byte);
        if state.echoes {
            state.signals.push_back(Signal::Character(byte));
        }
        if state.holds_after == Some(state.received.len()) {
            state.signals.push_back(Signal::Character(0x13));
        }
    }

    fn next_event(&self) -> Option<Micros> {
        None
    }

    fn advance(&mut self, _: Micros) {}

    fn poll_transmit(&mut self, _: Micros) -> Option<u8> {
        None
    }

    fn poll_signal(&mut self, _: Micros) -> Option<Signal> {
        self.state().signals.pop_front()
    }

    fn receive_damaged(&mut self, _: Micros, kind: LineErrorKind, _: Option<u8>) {
        self.state().damaged.push(kind);
    }

    fn modem_lines(&mut self, _: Micros, lines: ModemLines, on: ModemLines) {
        self.state().outputs.push((lines, on));
    }
}
