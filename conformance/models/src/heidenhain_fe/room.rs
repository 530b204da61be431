//! The host's room for what is delivered.

/// Room as the host gives it: what it puts away is room again, told at the latest
/// when it is an eighth of all, or when nothing is left to put away. A plug-in that
/// takes over is told all of it at once, so no model knows exactly how much of it
/// the plug-in knows.
#[derive(Clone, Debug)]
pub(super) struct Room {
    capacity: usize,
    /// Delivered, and not put away.
    kept: usize,
    /// Delivered and put away within one event, which is not told before its end.
    fresh: usize,
    keeps: bool,
}

impl Room {
    pub(super) fn new(capacity: u32) -> Self {
        Self { capacity: capacity as usize, kept: 0, fresh: 0, keeps: false }
    }

    /// All that is free, told or not.
    pub(super) fn free(&self) -> usize {
        self.capacity.saturating_sub(self.kept + self.fresh)
    }

    /// Whether so many bytes can find room.
    pub(super) fn may_take(&self, bytes: usize) -> bool {
        bytes <= self.free()
    }

    /// Whether so many bytes find room for certain.
    pub(super) fn must_take(&self, bytes: usize) -> bool {
        let untold = if self.kept == 0 { 0 } else { (self.capacity / 8).saturating_sub(1) };
        bytes + untold <= self.free()
    }

    pub(super) fn deliver(&mut self, bytes: usize) {
        let part = if self.keeps { &mut self.kept } else { &mut self.fresh };
        *part += bytes;
    }

    /// An event has ended: what was put away in it is told.
    pub(super) fn tell(&mut self) {
        self.fresh = 0;
    }

    pub(super) fn keep(&mut self) {
        self.keeps = true;
    }

    pub(super) fn put_away(&mut self, bytes: usize) {
        self.kept -= bytes.min(self.kept);
    }

    pub(super) fn put_all_away(&mut self) {
        self.keeps = false;
        self.kept = 0;
    }

    /// Whether a few lines fill it.
    pub(super) fn is_small(&self) -> bool {
        self.capacity <= 1_000
    }

    pub(super) fn is_kept(&self) -> bool {
        self.keeps
    }
}
