//! What the plug-in does, held against what it has to do.

use super::{Fe, State};
use crate::model::{Broken, Effect};
use softplug_abi::Failure;

/// Something that has to happen at this instant.
#[derive(Clone, Debug)]
pub(super) struct Expected {
    clause: &'static str,
    effect: Effect,
}

impl Fe {
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
        let expected: Vec<_> = self.expected.iter().map(|expected| &expected.effect).collect();
        Broken::new(clause, format!("{effect:?} came, expected was {expected:?}"))
    }
}

/// Whether what was seen is what was expected. A name without characters is the same
/// as none. What has left for a job that the end of the link has interrupted is not
/// always known: it may be told to be nothing.
fn is_same(expected: &Effect, seen: &Effect) -> bool {
    match (expected, seen) {
        (
            Effect::Delivered { id, bytes, name, failure, status },
            Effect::Delivered {
                id: id2,
                bytes: bytes2,
                name: name2,
                failure: failure2,
                status: status2,
            },
        ) => {
            let names = [name, name2].map(|name| name.as_deref().unwrap_or_default());
            (id, bytes, failure, status) == (id2, bytes2, failure2, status2) && names[0] == names[1]
        }
        (
            Effect::Failed { job, failure: Failure::Interrupted, .. },
            Effect::Failed { job: job2, failure: Failure::Interrupted, status: 0, sent: 0 },
        ) => job == job2,
        _ => expected == seen,
    }
}
