//! What a unit must do, without bytes: the rules of the page as a few lines.

use std::rc::Rc;

/// A module's bytes.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Bytes(pub(crate) Rc<Vec<u8>>);

impl std::ops::Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}

impl std::fmt::Debug for Bytes {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{} bytes {:02x?}", self.len(), &self[..self.len().min(4)])
    }
}

/// What somebody does with a unit.
#[derive(Clone, Debug)]
pub(crate) enum Op {
    Begin(Bytes),
    /// From here to there.
    Write(Bytes, usize, usize),
    Finish,
    Trial,
    /// A reset, and what runs then.
    Boot,
    Confirm,
    Fail,
    GoBack,
}

/// What must run after a boot.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Runs {
    Nothing,
    Trial(Bytes, u8),
    Confirmed(Bytes),
}

/// What is in a unit.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Model {
    /// The newest first; at most two.
    pub(crate) confirmed: Vec<Bytes>,
    pub(crate) trial: Option<(Bytes, u8)>,
    pub(crate) written: Option<Bytes>,
    pub(crate) coming: Option<Bytes>,
    pub(crate) attempts: u8,
}

impl Model {
    pub(crate) fn new(attempts: u8) -> Self {
        Self { confirmed: Vec::new(), trial: None, written: None, coming: None, attempts }
    }

    /// What the next boot gives.
    pub(crate) fn runs(&self) -> Runs {
        match &self.trial {
            Some((module, done)) if *done < self.attempts => Runs::Trial(module.clone(), done + 1),
            _ => self
                .confirmed
                .first()
                .map_or(Runs::Nothing, |module| Runs::Confirmed(module.clone())),
        }
    }

    /// What is in it after this went well.
    pub(crate) fn after(&self, op: &Op) -> Self {
        let mut next = self.clone();
        match op {
            Op::Begin(module) => {
                next.coming = Some(module.clone());
                next.written = None;
                next.confirmed.truncate(1);
            }
            Op::Write(..) => {}
            Op::Finish => next.written = next.coming.take(),
            Op::Trial => next.trial = next.written.take().map(|module| (module, 0)),
            Op::Boot => {
                next.coming = None;
                next.trial = next
                    .trial
                    .filter(|(_, done)| *done < self.attempts)
                    .map(|(module, done)| (module, done + 1));
            }
            Op::Confirm => {
                if let Some((module, _)) = next.trial.take() {
                    next.confirmed.insert(0, module);
                }
            }
            Op::Fail => next.trial = None,
            Op::GoBack => drop(next.confirmed.remove(0)),
        }
        next
    }
}
