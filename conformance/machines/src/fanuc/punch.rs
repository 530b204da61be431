//! The tape punch: what leaves between DC2 and DC4, and when it must stop.

use softplug_abi::Micros;

use super::options::{Code, Dc4, Options};
use super::tape::{Tape, with_even_parity};
use super::{DC4, Role};

/// One punch, from DC2 to its end.
#[derive(Debug)]
pub(super) struct Punch {
    tape: Vec<u8>,
    at: usize,
    /// Nothing leaves before DC1; DC2 is repeated then.
    pub(super) asks_at: Option<Micros>,
    /// SYN or NAK that follows.
    pub(super) verdict: Option<Role>,
    /// READ follows: the tape asks for a program.
    pub(super) then_read: bool,
}

impl Punch {
    /// The whole tape of a program, ASCII with LF. A character without a code
    /// is left out, as a control does.
    pub(super) fn new(options: &Options, tape: &Tape, program: &[u8]) -> Self {
        let punch = &options.punch;
        let parity =
            options.code == Code::Iso && options.parity == super::options::Parity::Software;
        let raw = |character: &u8| if parity { with_even_parity(*character) } else { *character };
        let eob = tape.punch_eob(punch.eob);
        let mut all: Vec<u8> = punch.leader.iter().map(raw).collect();
        all.extend(tape.punch(b'%'));
        all.extend(&eob);
        for character in program {
            match character {
                b'\n' => all.extend(&eob),
                character => all.extend(tape.punch(*character)),
            }
        }
        all.extend(tape.punch(b'%'));
        all.extend(&eob);
        all.resize(all.len() + punch.trailer as usize, 0);
        if let Dc4::Late(blanks) = punch.dc4 {
            all.resize(all.len() + blanks as usize, 0);
        }
        let mut punch = Self { tape: all, at: 0, asks_at: None, verdict: None, then_read: false };
        punch.close(options);
        punch
    }

    /// The next character for the transmitter.
    pub(super) fn next(&mut self) -> Option<u8> {
        let byte = *self.tape.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    /// Whether all was given to the transmitter.
    pub(super) fn is_out(&self) -> bool {
        self.at == self.tape.len()
    }

    /// RESET or an alarm in mid-punch: DC4, then what is told of it.
    pub(super) fn break_off(&mut self, options: &Options, verdict: Role) {
        self.tape.truncate(self.at);
        self.asks_at = None;
        self.close(options);
        self.verdict = options.tell_reset.then_some(verdict);
        self.then_read = false;
    }

    fn close(&mut self, options: &Options) {
        if options.punch.dc4 != Dc4::Missing {
            self.tape.push(DC4);
        }
    }
}

/// The host's stops: how many characters may still leave, and how many did.
#[derive(Debug, Default)]
pub(super) struct Stop {
    since: Option<Micros>,
    left: Vec<u32>,
}

impl Stop {
    pub(super) fn is_on(&self) -> bool {
        self.since.is_some()
    }

    /// A stop in a stop changes nothing.
    pub(super) fn begin(&mut self, at: Micros) -> bool {
        let is_new = self.since.is_none();
        if is_new {
            self.since = Some(at);
            self.left.push(0);
        }
        is_new
    }

    pub(super) fn end(&mut self) {
        self.since = None;
    }

    /// A character has left; one that ended together with the stop was in time.
    pub(super) fn character(&mut self, at: Micros) {
        if self.since.is_some_and(|since| at > since)
            && let Some(count) = self.left.last_mut()
        {
            *count += 1;
        }
    }

    pub(super) fn counts(&self) -> Vec<u32> {
        self.left.clone()
    }
}
