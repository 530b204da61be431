//! The host's room for deliveries.

/// Room as the plug-in knows it. The host tells growth in steps: an eighth of all, or
/// that all is free again.
#[derive(Clone, Debug)]
pub(crate) struct Room {
    capacity: u32,
    known: u32,
    /// Free, and not told yet.
    untold: u32,
    /// Delivered, and not put away yet.
    kept: u32,
    keeps: bool,
}

impl Room {
    pub(crate) fn new(capacity: u32) -> Self {
        Self { capacity, known: capacity, untold: 0, kept: 0, keeps: false }
    }

    /// Bytes that can be delivered.
    pub(crate) fn known(&self) -> u32 {
        self.known
    }

    /// Bytes that the host has not put away.
    pub(crate) fn kept(&self) -> u32 {
        self.kept
    }

    /// Whether the host puts nothing away by itself.
    pub(crate) fn keeps(&self) -> bool {
        self.keeps
    }

    /// The least that the host tells of at once.
    pub(crate) fn step(&self) -> u32 {
        (self.capacity / 8).max(1)
    }

    /// At an opening all is told.
    pub(crate) fn open(&mut self) {
        self.known += std::mem::take(&mut self.untold);
    }

    /// A byte is delivered. `false`: it finds no room.
    pub(crate) fn take(&mut self) -> bool {
        if self.known == 0 {
            return false;
        }
        self.known -= 1;
        self.kept += 1;
        if !self.keeps {
            self.put_away(self.kept);
        }
        true
    }

    /// From here on the host puts nothing away by itself.
    pub(crate) fn keep(&mut self) {
        self.keeps = true;
    }

    /// It puts everything away at once again.
    pub(crate) fn put_all_away(&mut self) {
        self.keeps = false;
        self.put_away(self.kept);
    }

    /// It puts so many bytes away.
    pub(crate) fn put_away(&mut self, bytes: u32) {
        let bytes = bytes.min(self.kept);
        self.kept -= bytes;
        self.untold += bytes;
    }

    /// Whether the plug-in is told of more room now.
    pub(crate) fn grows(&mut self) -> bool {
        let is_all = self.known + self.untold == self.capacity;
        if self.untold == 0 || !(is_all || self.untold >= self.capacity / 8) {
            return false;
        }
        self.known += std::mem::take(&mut self.untold);
        true
    }
}
