//! What was queued last, and what waits to be queued. A discard takes all that the port
//! has not been given; what was not meant is queued again.

use softplug_plugin::{StateError, StateReader, StateWriter};

/// Runs that are remembered: more than a partner brings about that sends hundreds of STX
/// at once.
const MOST: usize = 256;

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

    fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        match state.u8() {
            0 => Ok(Self::Answer),
            1 => Ok(Self::Grant),
            2 => Ok(Self::JobSetUp),
            3 => Ok(Self::ReactionSetUp),
            4 => Ok(Self::Job),
            5 => Ok(Self::Reaction),
            _ => Err(StateError),
        }
    }
}

/// Which of what waits is not to be sent.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
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

    pub(crate) fn save(self, state: &mut StateWriter<'_>) {
        state.u8(self.0);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        Self(state.u8())
    }
}

/// The same character, several times.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Run {
    pub(crate) count: u16,
    pub(crate) byte: u8,
    pub(crate) part: Part,
}

/// Characters in order.
#[derive(Clone, Debug)]
pub(crate) struct Runs {
    runs: [Run; MOST],
    length: u16,
}

impl Runs {
    pub(crate) const fn new() -> Self {
        let none = Run { count: 0, byte: 0, part: Part::Answer };
        Self { runs: [none; MOST], length: 0 }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.length == 0
    }

    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }

    fn as_slice(&self) -> &[Run] {
        self.runs.get(..usize::from(self.length)).unwrap_or_default()
    }

    /// Appends characters; `false`: there is no place.
    pub(crate) fn push(&mut self, run: Run) -> bool {
        let last = usize::from(self.length).checked_sub(1).and_then(|at| self.runs.get_mut(at));
        if let Some(last) = last
            && last.part == run.part
            && (last.byte == run.byte || run.part.is_block())
            && let Some(count) = last.count.checked_add(run.count)
        {
            last.count = count;
            return true;
        }
        let place = self.runs.get_mut(usize::from(self.length));
        let fits = place.is_some();
        if let Some(place) = place {
            *place = run;
            self.length += 1;
        }
        fits
    }

    /// Appends characters; where there is no place, the first are forgotten.
    pub(crate) fn remember(&mut self, run: Run) {
        if !self.push(run) {
            self.runs.rotate_left(1);
            self.length -= 1;
            self.push(run);
        }
    }

    /// Takes the first character.
    pub(crate) fn first(&mut self) -> Option<Run> {
        let first = self.runs.first_mut().filter(|_| self.length > 0)?;
        let taken = Run { count: 1, ..*first };
        first.count -= 1;
        if first.count == 0 {
            self.runs.rotate_left(1);
            self.length -= 1;
        }
        Some(taken)
    }

    /// Takes at most so many of the last characters, all alike.
    pub(crate) fn last(&mut self, most: u32) -> Option<Run> {
        let at = usize::from(self.length).checked_sub(1)?;
        let last = self.runs.get_mut(at)?;
        let most = most.min(u32::from(u16::MAX)) as u16;
        let taken = Run { count: last.count.min(most), ..*last };
        last.count -= taken.count;
        if last.count == 0 {
            self.length -= 1;
        }
        Some(taken)
    }

    /// Only what is not meant stays.
    pub(crate) fn drop(&mut self, meant: Meant) {
        let mut kept = Self::new();
        for run in self.as_slice() {
            if !meant.covers(run.part) {
                kept.push(*run);
            }
        }
        *self = kept;
    }

    /// These stand before all others, the last of them first; those of a block do not
    /// come again.
    pub(crate) fn put_before(&mut self, reversed: &Self) {
        let mut all = Self::new();
        for run in reversed.as_slice().iter().rev().chain(self.as_slice()) {
            all.push(*run);
        }
        *self = all;
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.length);
        for run in self.as_slice() {
            state.u16(run.count);
            state.u8(run.byte);
            state.u8(run.part as u8);
        }
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.clear();
        for _ in 0..state.u16() {
            let run = Run { count: state.u16(), byte: state.u8(), part: Part::restore(state)? };
            if run.count == 0 || !self.push(run) {
                return Err(StateError);
            }
        }
        Ok(())
    }
}
