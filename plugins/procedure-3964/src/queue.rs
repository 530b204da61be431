//! What was queued last, and what waits to be queued. A discard takes all that the port
//! has not been given; what was not meant is queued again.

use softplug_plugin::{State, StateReader, StateWriter};

/// Runs that are remembered: more than a partner brings about that sends hundreds of STX
/// at once.
const MOST: usize = 256;

/// So many are forgotten at once, so that not every run moves all others.
const FORGOTTEN: usize = 32;

/// What a character is for.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) enum Part {
    /// DLE or NAK at the end of something.
    #[default]
    Answer,
    /// DLE that answers an STX.
    Grant,
    /// STX of the job.
    JobSetUp,
    /// STX of a reaction.
    ReactionSetUp,
    /// Of the job's block. Its characters are not remembered, only their number.
    Job,
    /// Of a reaction.
    Reaction,
}

impl Part {
    pub(crate) fn is_of_job(self) -> bool {
        matches!(self, Self::JobSetUp | Self::Job)
    }

    pub(crate) fn is_block(self) -> bool {
        matches!(self, Self::Job | Self::Reaction)
    }

    const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Answer),
            1 => Some(Self::Grant),
            2 => Some(Self::JobSetUp),
            3 => Some(Self::ReactionSetUp),
            4 => Some(Self::Job),
            5 => Some(Self::Reaction),
            _ => None,
        }
    }
}

/// Which of what waits is not to be sent.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
pub(crate) struct Meant(u8);

impl Meant {
    pub(crate) const GRANT: Self = Self(1);
    /// What is sent for a block of ours.
    pub(crate) const BLOCK: Self = Self(2);
    pub(crate) const ALL: Self = Self(7);

    pub(crate) fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(crate) fn covers(self, part: Part) -> bool {
        let needed = match part {
            Part::Grant => 1,
            Part::Answer => 4,
            Part::JobSetUp | Part::ReactionSetUp | Part::Job | Part::Reaction => 2,
        };
        self.0 & needed != 0
    }
}

/// A character, several times in a row.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Run {
    pub(crate) count: u16,
    pub(crate) byte: u8,
    pub(crate) part: Part,
}

impl Run {
    const fn to_bytes(self) -> [u8; 4] {
        let [low, high] = self.count.to_le_bytes();
        [low, high, self.byte, self.part as u8]
    }

    /// `None`: no run has these.
    fn from_bytes([low, high, byte, part]: [u8; 4]) -> Option<Self> {
        let count = u16::from_le_bytes([low, high]);
        let part = Part::from_code(part)?;
        (count > 0).then_some(Self { count, byte, part })
    }
}

/// Characters in order. They are kept as they are saved: a state is written anew for each of
/// its pieces, and run by run that would cost more than an event may.
#[derive(Clone, Debug)]
pub(crate) struct Runs {
    runs: [[u8; 4]; MOST],
    length: u16,
}

impl Runs {
    pub(crate) const fn new() -> Self {
        Self { runs: [[0; 4]; MOST], length: 0 }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.length == 0
    }

    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }

    fn as_slice(&self) -> &[[u8; 4]] {
        self.runs.get(..usize::from(self.length)).unwrap_or_default()
    }

    fn iter(&self) -> impl DoubleEndedIterator<Item = Run> {
        self.as_slice().iter().filter_map(|run| Run::from_bytes(*run))
    }

    fn last_place(&mut self) -> Option<&mut [u8; 4]> {
        let at = usize::from(self.length).checked_sub(1)?;
        self.runs.get_mut(at)
    }

    /// Appends characters; `false`: there is no place.
    pub(crate) fn push(&mut self, run: Run) -> bool {
        if let Some(place) = self.last_place()
            && let Some(last) = Run::from_bytes(*place)
            && last.part == run.part
            && (last.byte == run.byte || run.part.is_block())
            && let Some(count) = last.count.checked_add(run.count)
        {
            *place = Run { count, ..last }.to_bytes();
            return true;
        }
        let place = self.runs.get_mut(usize::from(self.length));
        let fits = place.is_some();
        if let Some(place) = place {
            *place = run.to_bytes();
            self.length += 1;
        }
        fits
    }

    /// Appends characters; where there is no place, the first are forgotten.
    pub(crate) fn remember(&mut self, run: Run) {
        if !self.push(run) {
            self.runs.copy_within(FORGOTTEN.., 0);
            self.length -= FORGOTTEN as u16;
            self.push(run);
        }
    }

    /// Takes the first character.
    pub(crate) fn first(&mut self) -> Option<Run> {
        let place = self.runs.first_mut().filter(|_| self.length > 0)?;
        let first = Run::from_bytes(*place)?;
        let left = first.count - 1;
        *place = Run { count: left, ..first }.to_bytes();
        if left == 0 {
            self.runs.copy_within(1.., 0);
            self.length -= 1;
        }
        Some(Run { count: 1, ..first })
    }

    /// Takes at most so many of the last characters, all alike.
    pub(crate) fn last(&mut self, most: u32) -> Option<Run> {
        let place = self.last_place()?;
        let last = Run::from_bytes(*place)?;
        let most = most.min(u32::from(u16::MAX)) as u16;
        let taken = Run { count: last.count.min(most), ..last };
        let left = last.count - taken.count;
        *place = Run { count: left, ..last }.to_bytes();
        if left == 0 {
            self.length -= 1;
        }
        Some(taken)
    }

    /// Only what is not meant stays.
    pub(crate) fn drop(&mut self, meant: Meant) {
        let mut kept = Self::new();
        for run in self.iter().filter(|run| !meant.covers(run.part)) {
            kept.push(run);
        }
        *self = kept;
    }

    /// These stand before all others, the last of them first; those of a block do not
    /// come again.
    pub(crate) fn put_before(&mut self, reversed: &Self) {
        let mut all = Self::new();
        for run in reversed.iter().rev().chain(self.iter()) {
            all.push(run);
        }
        *self = all;
    }
}

impl State for Runs {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.length);
        state.bytes(self.as_slice().as_flattened());
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.clear();
        for _ in 0..state.u16() {
            match Run::from_bytes(state.u32().to_le_bytes()) {
                Some(run) if self.push(run) => {}
                _ => return state.refuse(),
            }
        }
    }
}
