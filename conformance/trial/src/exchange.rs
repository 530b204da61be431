//! What both sides of a line said.

use std::cell::RefCell;
use std::rc::Rc;

use softplug_abi::{LineParameters, Micros};

/// What both sides said, in the order in which it began.
#[derive(Clone, Debug)]
pub(crate) struct Exchange {
    /// `None`: nobody wants to know.
    pieces: Option<Rc<RefCell<Vec<Said>>>>,
    /// Characters of one side that follow each other within this are one piece; so both may speak
    /// at once.
    gap: Micros,
}

/// What one side said without a pause.
#[derive(Debug)]
struct Said {
    side: Side,
    last: Micros,
    bytes: Vec<u8>,
}

/// Who said it.
///
/// ```
/// use softplug_trial::Side;
///
/// assert_ne!(Side::Us, Side::Partner);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Side {
    /// The plug-in.
    Us,
    /// The machine.
    Partner,
}

impl Exchange {
    pub(crate) fn new(line: LineParameters) -> Self {
        // Half a character more than one takes.
        Self { pieces: Some(Rc::default()), gap: Micros(line.characters(3).0 / 2) }
    }

    /// Of which nothing is kept.
    pub(crate) fn unheard() -> Self {
        Self { pieces: None, gap: Micros::ZERO }
    }

    /// A character of this side: begun, for us, and ended, for the partner, at this time.
    pub(crate) fn add(&self, side: Side, at: Micros, byte: u8) {
        let Some(pieces) = &self.pieces else { return };
        let mut pieces = pieces.borrow_mut();
        let is_last = pieces.last().is_some_and(|piece| piece.side == side);
        let latest = pieces.iter_mut().rev().find(|piece| piece.side == side);
        match latest {
            Some(piece) if is_last || (self.gap > Micros::ZERO && at - piece.last <= self.gap) => {
                piece.bytes.push(byte);
                piece.last = at;
            }
            _ => pieces.push(Said { side, last: at, bytes: vec![byte] }),
        }
    }

    pub(crate) fn pieces(&self) -> Vec<(Side, Vec<u8>)> {
        let Some(pieces) = &self.pieces else { return Vec::new() };
        pieces.borrow().iter().map(|piece| (piece.side, piece.bytes.clone())).collect()
    }
}
