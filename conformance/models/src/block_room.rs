//! The host's room for what is delivered block by block.

/// Room for deliveries.
#[derive(Clone, Debug)]
pub(crate) struct BlockRoom {
    capacity: usize,
    /// Delivered, and not put away.
    kept: usize,
    /// Delivered at this instant: that it was put away is told when the event is over.
    fresh: usize,
    keeps: bool,
}

impl BlockRoom {
    pub(crate) fn new(capacity: u32) -> Self {
        Self { capacity: capacity as usize, kept: 0, fresh: 0, keeps: false }
    }

    pub(crate) fn free(&self) -> usize {
        self.capacity.saturating_sub(self.kept)
    }

    /// A block is delivered. Whether it finds room for certain: with all that is put away at once it
    /// does.
    pub(crate) fn take(&mut self, bytes: usize) -> bool {
        self.fresh += bytes;
        if !self.keeps {
            return true;
        }
        let is_sure = bytes + self.capacity / 8 <= self.free();
        self.kept += bytes;
        is_sure
    }

    /// Whether what came at this instant is more than there is room for.
    pub(crate) fn is_over(&self) -> bool {
        self.fresh > self.capacity
    }

    /// The event is over.
    pub(crate) fn settle(&mut self) {
        self.fresh = 0;
    }

    /// From here on the host puts nothing away by itself.
    pub(crate) fn keep(&mut self) {
        self.keeps = true;
    }

    pub(crate) fn put_away(&mut self, bytes: u32) {
        self.kept = self.kept.saturating_sub(bytes as usize);
    }

    /// It puts everything away at once again.
    pub(crate) fn put_all_away(&mut self) {
        (self.keeps, self.kept) = (false, 0);
    }
}
