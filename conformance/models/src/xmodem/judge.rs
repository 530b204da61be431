//! What the plug-in does, held against what it has to do.

use super::{State, Xmodem};
use crate::model::{Broken, Effect};
use softplug_abi::Failure;

impl Xmodem {
    /// Something was seen that is no byte.
    pub(super) fn sees(&mut self, effect: &Effect) -> Result<(), Broken> {
        if self.expected.sees(effect) { Ok(()) } else { Err(self.unexpected(effect)) }
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
        self.expected.broken(clause, effect)
    }
}
