//! What the plug-in does, held against what it has to do.

use super::{Fe, State};
use crate::model::{Broken, Effect};
use softplug_abi::Failure;

impl Fe {
    /// Something was seen that is no byte.
    pub(super) fn sees(&mut self, effect: &Effect) -> Result<(), Broken> {
        if self.expected.sees(effect) { Ok(()) } else { Err(self.unexpected(effect)) }
    }

    /// A character of ours begins.
    pub(super) fn sees_byte(&mut self, byte: u8) -> Result<(), Broken> {
        if self.out.is_empty() {
            self.takes_room_early();
        }
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
            Effect::Delivered { failure: None, .. } => "heidenhain-fe.rx.end",
            Effect::Delivered { failure: Some(failure), .. } => match failure {
                Failure::NoEndMark => "heidenhain-fe.rx.no-end",
                Failure::Checksum => "heidenhain-fe.rx.bad-block",
                Failure::NoAnswer => "heidenhain-fe.rx.silence",
                Failure::PartnerReset => "heidenhain-fe.rx.new-header",
                Failure::Aborted => "heidenhain-fe.rx.abort",
                Failure::LinkDown => "heidenhain-fe.line.down",
                Failure::Interrupted => "heidenhain-fe.line.close",
                _ => "heidenhain-fe.rx.block",
            },
            Effect::Done { .. } => "heidenhain-fe.tx.end",
            Effect::Failed { failure, .. } => match failure {
                Failure::NoAnswer if is_sending => "heidenhain-fe.tx.answer-time",
                Failure::NoAnswer => "heidenhain-fe.tx.request-time",
                Failure::Refused => "heidenhain-fe.tx.partner-ends",
                Failure::PartnerReset => "heidenhain-fe.tx.header-between",
                Failure::AttemptsUsedUp => "heidenhain-fe.tx.repeat",
                Failure::Aborted => "heidenhain-fe.tx.abort",
                Failure::Busy => "heidenhain-fe.tx.one-job",
                Failure::LinkDown => "heidenhain-fe.line.down",
                Failure::Interrupted => "heidenhain-fe.line.close",
                _ => "heidenhain-fe.tx.next",
            },
            Effect::Checked { .. } => "heidenhain-fe.tx.check",
            Effect::Requested { .. } => "heidenhain-fe.tx.ask-host",
            Effect::Withdrawn(_) => "heidenhain-fe.tx.withdrawn",
            // Nothing in the page asks for these.
            Effect::Byte(_) | Effect::Break(_) | Effect::ModemLines(..) => {
                "heidenhain-fe.line.noise"
            }
        };
        self.expected.broken(clause, effect)
    }
}
