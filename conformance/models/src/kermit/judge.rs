//! What the plug-in does, held against what it has to do.

use super::Kermit;
use crate::model::{Broken, Effect};
use softplug_abi::Failure;

impl Kermit {
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
        let clause = match effect {
            Effect::Delivered { failure: None, .. } => "kermit.rx.file",
            Effect::Delivered { failure: Some(failure), .. } => match failure {
                Failure::NoEndMark => "kermit.rx.error",
                Failure::Checksum | Failure::NoAnswer => "kermit.rx.repeats",
                Failure::Protocol => "kermit.rx.unexpected",
                Failure::Aborted => "kermit.rx.abort",
                Failure::PartnerReset => "kermit.rx.restart",
                Failure::LinkDown => "kermit.line.down",
                Failure::Interrupted => "kermit.line.close",
                _ => "kermit.rx.file",
            },
            Effect::Failed { failure, .. } => match failure {
                Failure::NoAnswer | Failure::AttemptsUsedUp => "kermit.tx.repeat",
                Failure::Refused => "kermit.tx.error",
                Failure::Aborted => "kermit.tx.abort",
                Failure::Busy => "kermit.tx.one-job",
                Failure::BadJob => "kermit.tx.name",
                Failure::UnsupportedCharacter => "kermit.tx.narrow",
                Failure::NotSupported => "kermit.line.crc-only",
                Failure::LinkDown => "kermit.line.down",
                Failure::Interrupted => "kermit.line.close",
                _ => "kermit.tx.order",
            },
            Effect::Done { .. } => "kermit.tx.confirmed",
            Effect::Requested { .. } => "kermit.ask.request",
            Effect::Withdrawn(_) => "kermit.ask.withdrawn",
            // Nothing in the page asks for these.
            _ => "kermit.tx.order",
        };
        self.expected.broken(clause, effect)
    }
}
