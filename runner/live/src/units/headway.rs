//! Whether a download goes on.

/// Answers with which no byte more is in the unit's memory, at most.
const MOST_IDLE: u32 = 16;

/// How far the unit says that a download is.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Headway {
    furthest: Option<u32>,
    /// Answers since then.
    idle: u32,
}

impl Headway {
    /// So many bytes are there.
    pub(super) fn take(&mut self, until: u32) {
        let is_further = self.furthest.is_none_or(|furthest| until > furthest);
        self.idle = if is_further { 0 } else { self.idle + 1 };
        self.furthest = self.furthest.max(Some(until));
    }

    /// The last answer was of more bytes than any before.
    pub(super) fn is_some(&self) -> bool {
        self.idle == 0
    }

    /// It goes no further, however often it is asked.
    pub(super) fn is_none(&self) -> bool {
        self.idle > MOST_IDLE
    }
}
