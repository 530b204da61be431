//! What the plug-in does, held against what it has to do.

use super::{State, Xmodem};
use crate::model::{Broken, Effect};
use softplug_abi::Failure;

/// Something that has to happen at this instant.
#[derive(Clone, Debug)]
pub(super) struct Expected {
    clause: &'static str,
    effect: Effect,
}

impl Xmodem {
    /// This has to happen before the instant is over, in any order.
    pub(super) fn expect(&mut self, clause: &'static str, effect: Effect) {
        self.expected.push(Expected { clause, effect });
    }

    /// Something was seen that is no byte.
    pub(super) fn sees(&mut self, effect: &Effect) -> Result<(), Broken> {
        match self.expected.iter().position(|expected| is_same(&expected.effect, effect)) {
            Some(place) => {
                self.expected.remove(place);
                Ok(())
            }
            None => Err(self.unexpected(effect)),
        }
    }

    /// The instant is over: something that had to come may have been missed.
    pub(super) fn misses(&self) -> Result<(), Broken> {
        let Some(Expected { clause, effect }) = self.expected.first() else { return Ok(()) };
        Err(Broken::new(clause, format!("{effect:?} had to come")))
    }

    /// A character of ours begins.
    pub(super) fn sees_byte(&mut self, byte: u8) -> Result<(), Broken> {
        self.out.begins(byte)?;
        if self.rules.leaves_at_once() {
            self.out.leaves();
            self.progress();
        }
        Ok(())
    }

    /// The rule that this breaks, or the nearest.
    fn unexpected(&self, effect: &Effect) -> Broken {
        let is_sending = matches!(self.state, State::Sending(_));
        let clause = match effect {
            Effect::Delivered { failure: None, .. } => "xmodem.rx.end",
            Effect::Delivered { failure: Some(failure), .. } => match failure {
                Failure::NoEndMark => "xmodem.rx.cancelled",
                Failure::Checksum | Failure::NoAnswer => "xmodem.rx.repeats",
                Failure::Protocol => "xmodem.rx.wrong-number",
                Failure::Aborted => "xmodem.rx.abort",
                Failure::LinkDown => "xmodem.line.down",
                Failure::Interrupted => "xmodem.line.close",
                _ => "xmodem.rx.block",
            },
            Effect::Failed { failure, .. } => match failure {
                Failure::NoAnswer if is_sending => "xmodem.tx.answer-time",
                Failure::NoAnswer => "xmodem.tx.request-time",
                Failure::Refused => "xmodem.tx.cancelled",
                Failure::AttemptsUsedUp => "xmodem.tx.repeat",
                Failure::Aborted => "xmodem.tx.abort",
                Failure::Busy => "xmodem.tx.one-job",
                Failure::LinkDown => "xmodem.line.down",
                Failure::Interrupted => "xmodem.line.close",
                _ => "xmodem.line.eight-bits",
            },
            Effect::Done { .. } => "xmodem.tx.end",
            // Nothing in the page asks for these.
            _ => "xmodem.tx.next",
        };
        let expected: Vec<_> = self.expected.iter().map(|expected| &expected.effect).collect();
        Broken::new(clause, format!("{effect:?} came, expected was {expected:?}"))
    }
}

/// Whether what was seen is what was expected. What has left for a job that the end of the link
/// has interrupted is not always known: it may be told to be nothing.
fn is_same(expected: &Effect, seen: &Effect) -> bool {
    match (expected, seen) {
        (
            Effect::Failed { job, failure: Failure::Interrupted, .. },
            Effect::Failed { job: job2, failure: Failure::Interrupted, status: 0, sent: 0 },
        ) => job == job2,
        _ => expected == seen,
    }
}
