//! Line ends: LF, CR LF, CR, LF CR and LF CR CR are each read as one.

use crate::LineEnd;
use softplug_plugin::State;

/// What a byte of text becomes.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Piece {
    /// The byte itself.
    Byte(u8),
    /// A line end.
    End(&'static [u8]),
    /// Nothing: it belongs to the line end before it.
    Nothing,
}

/// Reads line ends over any cut.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
pub(crate) enum Lines {
    #[default]
    InLine,
    AfterCr,
    AfterLf,
    AfterLfCr,
}

impl Lines {
    pub(crate) fn map(&mut self, form: LineEnd, byte: u8) -> Piece {
        let end = match form {
            LineEnd::Keep => return Piece::Byte(byte),
            LineEnd::Lf => b"\n".as_slice(),
            LineEnd::Cr => b"\r",
            LineEnd::CrLf => b"\r\n",
            LineEnd::LfCrCr => b"\n\r\r",
        };
        let (next, piece) = match (*self, byte) {
            (Self::AfterLf, b'\r') => (Self::AfterLfCr, Piece::Nothing),
            (Self::AfterCr, b'\n') | (Self::AfterLfCr, b'\r') => (Self::InLine, Piece::Nothing),
            (_, b'\n') => (Self::AfterLf, Piece::End(end)),
            (_, b'\r') => (Self::AfterCr, Piece::End(end)),
            _ => (Self::InLine, Piece::Byte(byte)),
        };
        *self = next;
        piece
    }
}
