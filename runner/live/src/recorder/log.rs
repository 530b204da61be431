//! Two generations of events in memory: when the newer one is full, the older one
//! goes.

use softplug_abi::{Event, Micros};
use softplug_link::UnderWay;

use super::Recording;
use super::recording::{HEAD, put_head};

/// The bound counts events and what stands before each, not the state of a
/// checkpoint.
#[derive(Debug)]
pub(super) struct Log {
    bound: usize,
    older: Generation,
    newer: Generation,
    /// The last entry of `newer` is a save, from here on.
    save_at: Option<usize>,
    saves_nothing: bool,
}

#[derive(Debug, Default)]
struct Generation {
    bytes: Vec<u8>,
    /// Bytes that make the beginning from a state.
    head: usize,
    /// It begins where the instance does, or at a state.
    is_whole: bool,
    /// What the state's plug-in took over; `None`: what the instance did.
    under_way: Option<UnderWay>,
}

impl Log {
    pub(super) fn new(bound: usize) -> Self {
        let newer = Generation { is_whole: true, ..Generation::default() };
        let older = Generation::default();
        Self { bound, older, newer, save_at: None, saves_nothing: false }
    }

    pub(super) fn wants_checkpoint(&self) -> bool {
        self.bound > 0 && !self.saves_nothing && self.newer.events() >= self.bound / 4
    }

    pub(super) fn never_again(&mut self) {
        self.saves_nothing = true;
    }

    pub(super) fn add(&mut self, event: &Event<'_>, now: Micros) {
        if self.bound == 0 || matches!(event, Event::Continue) {
            return;
        }
        if matches!(event, Event::Settings { first: true, .. }) {
            // It begins as new: nothing of what was before has an effect.
            *self = Self { saves_nothing: self.saves_nothing, ..Self::new(self.bound) };
        }
        // A save changes nothing; it matters only if it is the last event.
        if let Some(at) = self.save_at.take() {
            self.newer.bytes.truncate(at);
        }
        let size = size_bound(event);
        let is_full = self.newer.events() + HEAD + size > self.bound;
        if is_full && self.newer.events() > 0 {
            self.roll(None);
        }
        if matches!(event, Event::Save) {
            self.save_at = Some(self.newer.bytes.len());
        }
        self.write(event, now, size);
    }

    /// An event that is not given now: a part of the way to the state of now.
    pub(super) fn add_to_head(&mut self, event: &Event<'_>, now: Micros) {
        self.write(event, now, size_bound(event));
    }

    /// What is added next is how a plug-in would be brought to the state of now.
    pub(super) fn begin_from_state(&mut self, under_way: UnderWay) {
        if let Some(at) = self.save_at.take() {
            self.newer.bytes.truncate(at);
        }
        self.roll(Some(under_way));
        // Nothing counts as an event until the head is there.
        self.newer.head = usize::MAX;
    }

    pub(super) fn end_of_head(&mut self) {
        self.newer.head = self.newer.bytes.len();
    }

    fn roll(&mut self, under_way: Option<UnderWay>) {
        std::mem::swap(&mut self.older, &mut self.newer);
        self.newer.bytes.clear();
        self.newer.head = 0;
        self.newer.is_whole = under_way.is_some();
        self.newer.under_way = under_way;
    }

    fn write(&mut self, event: &Event<'_>, now: Micros, size: usize) {
        let bytes = &mut self.newer.bytes;
        let start = bytes.len();
        if bytes.capacity() < start + HEAD + size {
            // What a generation takes but for a burst: a quarter of the bound, what one
            // turn adds, and its head. So the two take as much as the bound.
            let usual = self.bound / 2;
            bytes.reserve_exact(usual.saturating_sub(start).max(HEAD + size));
        }
        bytes.resize(start + HEAD + size, 0);
        if let Ok(length) = event.encode(&mut bytes[start + HEAD..]) {
            put_head(&mut bytes[start..], now, event.kind(), length);
            bytes.truncate(start + HEAD + length);
        } else {
            // The bound is large enough; if it ever is not, there is a gap.
            bytes.truncate(start);
            self.newer.is_whole = false;
        }
    }

    pub(super) fn recording(&self, taken_over_with: &UnderWay) -> Recording {
        let (older, newer) = (&self.older, &self.newer);
        let of = |under_way: &Option<UnderWay>| {
            under_way.clone().unwrap_or_else(|| taken_over_with.clone())
        };
        if older.is_whole && !older.bytes.is_empty() {
            let bytes = [&older.bytes[..], &newer.bytes[newer.head..]].concat();
            return Recording::new(bytes, true, of(&older.under_way));
        }
        if newer.is_whole {
            return Recording::new(newer.bytes.clone(), true, of(&newer.under_way));
        }
        let bytes = [&older.bytes[older.head..], &newer.bytes[newer.head..]].concat();
        Recording::new(bytes, false, UnderWay::default())
    }
}

impl Generation {
    fn events(&self) -> usize {
        self.bytes.len().saturating_sub(self.head)
    }
}

/// No event is longer than this when it is encoded.
fn size_bound(event: &Event<'_>) -> usize {
    const FIXED: usize = 32;
    FIXED
        + match event {
            Event::Received(bytes)
            | Event::JobData { bytes, .. }
            | Event::Answer { bytes, .. }
            | Event::Restore { bytes, .. } => bytes.len(),
            Event::JobBegin { fields, .. } => fields.as_bytes().len(),
            Event::Settings { values, .. } => values.as_bytes().len(),
            _ => 0,
        }
}
