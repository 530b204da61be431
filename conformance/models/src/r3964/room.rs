//! The host's room for deliveries, as far as a plug-in knows it.

/// Bytes that may be delivered, and what the host has still to put away.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Room {
    whole: usize,
    opened_with: usize,
    /// What was told to be free.
    known: usize,
    /// Put away and not told yet: it is told an eighth of the whole at a time, and
    /// when nothing is left to put away.
    untold: usize,
    waiting: usize,
    is_kept: bool,
}

impl Room {
    pub(crate) fn new(whole: u32) -> Self {
        let whole = whole as usize;
        Self { whole, opened_with: whole, known: whole, untold: 0, waiting: 0, is_kept: false }
    }

    /// The room as it is known.
    pub(crate) fn known(&self) -> usize {
        self.known
    }

    /// What was free when the link was opened.
    pub(crate) fn opened_with(&self) -> usize {
        self.opened_with
    }

    /// All that there can be.
    pub(crate) fn whole(&self) -> usize {
        self.whole
    }

    /// Bytes that the host has and could put away.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting
    }

    /// The least that has to be put away to be told at once.
    pub(crate) fn told_from(&self) -> usize {
        (self.whole / 8).max(1)
    }

    /// So many bytes were delivered.
    pub(crate) fn deliver(&mut self, bytes: usize) {
        self.known = self.known.saturating_sub(bytes);
        self.waiting += bytes;
        if !self.is_kept {
            self.put_away(usize::MAX);
        }
    }

    /// The host puts nothing away by itself, or all of it at once.
    pub(crate) fn keep(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
        if !is_kept {
            self.put_away(usize::MAX);
        }
    }

    /// The host puts so many bytes away.
    pub(crate) fn put_away(&mut self, bytes: usize) {
        let bytes = bytes.min(self.waiting);
        self.waiting -= bytes;
        self.untold += bytes;
    }

    /// Growth is told behind the timers of an instant.
    pub(crate) fn tell(&mut self) {
        let is_all = self.known + self.untold == self.whole;
        if self.untold > 0 && (is_all || self.untold >= self.whole / 8) {
            self.tell_all();
        }
    }

    /// An opening tells all of it.
    pub(crate) fn open(&mut self) {
        self.tell_all();
        self.opened_with = self.known;
    }

    fn tell_all(&mut self) {
        self.known += std::mem::take(&mut self.untold);
    }
}
