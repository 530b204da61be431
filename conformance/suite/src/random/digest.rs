//! What a session shows outside, as digests have it on every machine: when, a byte for the kind, then
//! its fields. A character has one byte, numbers have eight, least first, and texts stand behind their length.

use sha2::{Digest as _, Sha256};
use softplug_abi::{Failure, Micros};
use softplug_models::Effect;

/// Of many sessions, one after the other.
#[derive(Default)]
pub(super) struct SessionsDigest {
    whole: Sha256,
    /// Of the session that is being put in.
    bytes: Vec<u8>,
}

impl SessionsDigest {
    /// The next session has shown this.
    pub(super) fn put(&mut self, effects: impl Iterator<Item = (Micros, Effect)>) {
        self.bytes.clear();
        for (at, effect) in effects {
            self.number(at.0 as u64);
            self.effect(&effect);
        }
        self.whole.update((self.bytes.len() as u64).to_le_bytes());
        self.whole.update(&self.bytes);
    }

    pub(super) fn finish(self) -> [u8; 32] {
        self.whole.finalize().into()
    }

    fn effect(&mut self, effect: &Effect) {
        match effect {
            Effect::Byte(byte) => self.bytes.extend([0, *byte]),
            Effect::Break(micros) => self.numbers(1, [u64::from(*micros)]),
            Effect::ModemLines(mask, on) => self.numbers(2, [mask.0, on.0].map(u64::from)),
            Effect::Delivered { id, bytes, name, failure, status } => {
                self.numbers(3, [u64::from(*id), code(*failure), u64::from(*status)]);
                self.text(bytes);
                self.bytes.push(name.is_some().into());
                self.text(name.as_deref().unwrap_or_default().as_bytes());
            }
            Effect::Done { job, sent } => self.numbers(4, [u64::from(*job), *sent]),
            Effect::Failed { job, failure, status, sent } => {
                let (job, status) = (u64::from(*job), u64::from(*status));
                self.numbers(5, [job, code(Some(*failure)), status, *sent]);
            }
            Effect::Checked { job, failure, status, line, column } => {
                let [job, line, column] = [*job, *line, *column].map(u64::from);
                self.numbers(6, [job, code(*failure), u64::from(*status), line, column]);
            }
            Effect::Requested { id, kind, fields } => {
                self.numbers(7, [u64::from(*id), fields.len() as u64]);
                self.text(kind.as_bytes());
                for (name, value) in fields {
                    self.text(name.as_bytes());
                    self.text(value.as_bytes());
                }
            }
            Effect::Withdrawn(id) => self.numbers(8, [u64::from(*id)]),
        }
    }

    fn numbers<const N: usize>(&mut self, kind: u8, numbers: [u64; N]) {
        self.bytes.push(kind);
        for number in numbers {
            self.number(number);
        }
    }

    fn number(&mut self, number: u64) {
        self.bytes.extend(number.to_le_bytes());
    }

    fn text(&mut self, text: &[u8]) {
        self.number(text.len() as u64);
        self.bytes.extend(text);
    }
}

/// 0: none; a failure's own are from 1.
fn code(failure: Option<Failure>) -> u64 {
    failure.map_or(0, |failure| u64::from(failure.code()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(sessions: &[&[(i64, Effect)]]) -> [u8; 32] {
        let mut digest = SessionsDigest::default();
        for session in sessions {
            digest.put(session.iter().map(|(at, effect)| (Micros(*at), effect.clone())));
        }
        digest.finish()
    }

    fn delivered(bytes: &[u8], name: Option<&str>) -> Effect {
        let (bytes, name) = (bytes.to_vec(), name.map(str::to_owned));
        Effect::Delivered { id: 1, bytes, name, failure: None, status: 0 }
    }

    #[test]
    fn what_differs_has_another_digest() {
        let requested = |fields: &[(&str, &str)]| {
            let fields = fields.iter().map(|(name, value)| ((*name).into(), (*value).into()));
            Effect::Requested { id: 1, kind: "file".to_owned(), fields: fields.collect() }
        };
        let failed = |failure, status| Effect::Failed { job: 1, failure, status, sent: 0 };
        let [one, two] = [Effect::Byte(1), Effect::Byte(2)];
        let sessions: &[&[&[(i64, Effect)]]] = &[
            &[],
            &[&[]],
            &[&[], &[]],
            &[&[(1, one.clone()), (2, two.clone())]],
            &[&[(1, one.clone())], &[(2, two.clone())]],
            &[&[(1, two.clone()), (2, one.clone())]],
            &[&[(1, Effect::Break(1))]],
            &[&[(1, Effect::Withdrawn(1))]],
            &[&[(1, delivered(b"ab", None))]],
            &[&[(1, delivered(b"a", Some("b")))]],
            &[&[(1, delivered(b"ab", Some("")))]],
            &[&[(1, requested(&[("a", "b")]))]],
            &[&[(1, requested(&[("", "ab")]))]],
            &[&[(1, failed(Failure::NoAnswer, 0))]],
            &[&[(1, failed(Failure::Aborted, 0))]],
            &[&[(1, failed(Failure::Aborted, 1))]],
        ];
        let digests: std::collections::BTreeSet<_> =
            sessions.iter().map(|sessions| digest(sessions)).collect();
        assert_eq!(digests.len(), sessions.len());
    }

    #[test]
    fn a_digest_is_what_it_was() {
        let session = [(5, Effect::Byte(0x11)), (6, Effect::Done { job: 1, sent: 2 })];
        let bytes = [
            [5, 0, 0, 0, 0, 0, 0, 0].as_slice(),
            &[0, 0x11],
            &[6, 0, 0, 0, 0, 0, 0, 0],
            &[4, 1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0],
        ]
        .concat();
        let mut whole = Sha256::new();
        whole.update([35, 0, 0, 0, 0, 0, 0, 0]);
        whole.update(bytes);
        assert_eq!(digest(&[&session]), <[u8; 32]>::from(whole.finalize()));
    }
}
