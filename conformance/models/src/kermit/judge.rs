//! What the plug-in does, held against what it has to do.

use super::Kermit;
use crate::model::{Broken, Effect};
use softplug_abi::Failure;

/// Something that has to happen at this instant.
#[derive(Clone, Debug)]
pub(super) struct Expected {
    clause: &'static str,
    effect: Effect,
}

impl Kermit {
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
