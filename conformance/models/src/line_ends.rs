//! Line ends: LF, CR LF, CR, LF CR and LF CR CR are one each.

/// Where a text is.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineEnds(Place);

#[derive(Copy, Clone, Debug, Default)]
enum Place {
    #[default]
    InLine,
    /// Behind CR: an LF belongs to it.
    Cr,
    /// Behind LF: a CR belongs to it.
    Lf,
    /// Behind LF CR: another CR belongs to it.
    LfCr,
}

/// What a byte is in a text.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Part {
    /// A byte of a line.
    Line,
    /// The first byte of a line end.
    End,
    /// A later byte of a line end.
    EndGoesOn,
}

impl LineEnds {
    /// What the next byte is.
    pub(crate) fn next(&mut self, byte: u8) -> Part {
        let (place, part) = match (self.0, byte) {
            (Place::Lf, b'\r') => (Place::LfCr, Part::EndGoesOn),
            (Place::Cr, b'\n') | (Place::LfCr, b'\r') => (Place::InLine, Part::EndGoesOn),
            (_, b'\r') => (Place::Cr, Part::End),
            (_, b'\n') => (Place::Lf, Part::End),
            _ => (Place::InLine, Part::Line),
        };
        self.0 = place;
        part
    }

    /// The byte as it leaves: a line end as `written`, or as it is with `None`.
    pub(crate) fn rewrite(&mut self, byte: u8, written: Option<&[u8]>) -> Vec<u8> {
        let Some(written) = written else { return vec![byte] };
        match self.next(byte) {
            Part::Line => vec![byte],
            Part::End => written.to_vec(),
            Part::EndGoesOn => Vec::new(),
        }
    }
}
