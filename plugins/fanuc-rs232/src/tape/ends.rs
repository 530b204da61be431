//! Line ends of a program file: LF, CR LF, CR, LF CR and LF CR CR are each one.

use super::{SPECIAL_CR, SPECIAL_LF};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// What came before, over any cut.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
pub(super) enum Ends {
    InLine,
    AfterCr,
    AfterLf,
    AfterLfCr,
}

impl Ends {
    /// Takes a character; if it is a CR or LF, whether a line ends with it. If not, it
    /// belongs to the line end before it.
    pub(super) fn line_end(&mut self, character: u8) -> Option<bool> {
        if !matches!(character, SPECIAL_LF | SPECIAL_CR) {
            *self = Self::InLine;
            return None;
        }
        Some(self.take(character == SPECIAL_CR))
    }

    fn take(&mut self, is_cr: bool) -> bool {
        let (next, ends) = match (*self, is_cr) {
            (Self::AfterLf, true) => (Self::AfterLfCr, false),
            (Self::AfterCr, false) | (Self::AfterLfCr, true) => (Self::InLine, false),
            (_, false) => (Self::AfterLf, true),
            (_, true) => (Self::AfterCr, true),
        };
        *self = next;
        ends
    }
}
