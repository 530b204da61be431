//! What was queued last, and what waits to be queued. A discard takes all that the port
//! has not been given; what was not meant is queued again.

use softplug_plugin::{State, StateReader, StateWriter};

/// Runs that are remembered: more than a partner brings about that sends hundreds of STX
/// at once.
const MOST: usize = 256;

/// Places for runs: so many more that not every one that is forgotten moves all others.
const PLACES: usize = MOST + 32;

/// What characters can be for.
const PARTS: usize = 6;

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

    /// By their codes.
    const ALL: [Self; PARTS] =
        [Self::Answer, Self::Grant, Self::JobSetUp, Self::ReactionSetUp, Self::Job, Self::Reaction];

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
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
///
/// A partner decides how many there are and how often some are dropped, so nothing but what is rare
/// passes over all of them: the first is taken where it stands, and who drops some begins at the end
/// and stops where the last of these is found.
#[derive(Clone, Debug)]
pub(crate) struct Runs {
    places: [[u8; 4]; PLACES],
    /// Place of the first.
    begin: u16,
    length: u16,
    /// How many are of each part.
    of_part: [u16; PARTS],
}

impl Runs {
    pub(crate) const fn new() -> Self {
        Self { places: [[0; 4]; PLACES], begin: 0, length: 0, of_part: [0; PARTS] }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.length == 0
    }

    pub(crate) fn clear(&mut self) {
        (self.begin, self.length, self.of_part) = (0, 0, [0; PARTS]);
    }

    fn end(&self) -> usize {
        usize::from(self.begin + self.length)
    }

    fn as_slice(&self) -> &[[u8; 4]] {
        self.places.get(usize::from(self.begin)..self.end()).unwrap_or_default()
    }

    /// The runs move to the begin of their place.
    fn close_up(&mut self) {
        self.places.copy_within(usize::from(self.begin).min(PLACES).., 0);
        self.begin = 0;
    }

    /// A run more of this part, or one less.
    fn count(&mut self, part: Part, change: i16) {
        if let Some(count) = self.of_part.get_mut(part as usize) {
            *count = count.wrapping_add_signed(change);
        }
    }

    fn iter(&self) -> impl DoubleEndedIterator<Item = Run> {
        self.as_slice().iter().filter_map(|run| Run::from_bytes(*run))
    }

    fn last_place(&mut self) -> Option<&mut [u8; 4]> {
        let at = self.end().checked_sub(1).filter(|_| self.length > 0)?;
        self.places.get_mut(at)
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
        if usize::from(self.length) == MOST {
            return false;
        }
        if self.end() == PLACES {
            self.close_up();
        }
        let end = self.end();
        if let Some(place) = self.places.get_mut(end) {
            *place = run.to_bytes();
            self.length += 1;
            self.count(run.part, 1);
        }
        true
    }

    /// Appends characters; where there is no place, the first run is forgotten.
    pub(crate) fn remember(&mut self, run: Run) {
        if !self.push(run) {
            self.take_first();
            self.push(run);
        }
    }

    /// Takes the first character.
    pub(crate) fn first(&mut self) -> Option<Run> {
        let first = self.as_slice().first().and_then(|run| Run::from_bytes(*run))?;
        match first.count - 1 {
            0 => self.take_first(),
            count => {
                if let Some(place) = self.places.get_mut(usize::from(self.begin)) {
                    *place = Run { count, ..first }.to_bytes();
                }
            }
        }
        Some(Run { count: 1, ..first })
    }

    fn take_first(&mut self) {
        if let Some(first) = self.as_slice().first().and_then(|run| Run::from_bytes(*run)) {
            self.count(first.part, -1);
            self.begin += 1;
            self.length -= 1;
        }
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
            self.count(last.part, -1);
        }
        Some(taken)
    }

    /// Only what is not meant stays.
    pub(crate) fn drop(&mut self, meant: Meant) {
        let mut left: u16 = self
            .of_part
            .iter()
            .zip(Part::ALL)
            .filter_map(|(count, part)| meant.covers(part).then_some(*count))
            .sum();
        let (mut at, end) = (self.end(), self.end());
        while left > 0
            && let Some(run) = at.checked_sub(1).and_then(|at| self.at(at))
        {
            at -= 1;
            left -= u16::from(meant.covers(run.part));
        }
        self.length -= (end - at) as u16;
        // Each is read before another one takes its place.
        for place in at..end {
            let Some(run) = self.at(place) else { return };
            self.count(run.part, -1);
            if !meant.covers(run.part) {
                self.push(run);
            }
        }
    }

    fn at(&self, place: usize) -> Option<Run> {
        self.places.get(place).and_then(|run| Run::from_bytes(*run))
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Runs as a plain list, slow and obvious.
    #[derive(Default)]
    struct Plain(Vec<Run>);

    impl Plain {
        fn push(&mut self, run: Run) -> bool {
            if let Some(last) = self.0.last_mut()
                && last.part == run.part
                && (last.byte == run.byte || run.part.is_block())
            {
                last.count += run.count;
                return true;
            }
            let fits = self.0.len() < MOST;
            if fits {
                self.0.push(run);
            }
            fits
        }

        fn remember(&mut self, run: Run) {
            if !self.push(run) {
                self.0.remove(0);
                self.push(run);
            }
        }

        fn first(&mut self) -> Option<u8> {
            let first = self.0.first_mut()?;
            first.count -= 1;
            let byte = first.byte;
            if first.count == 0 {
                self.0.remove(0);
            }
            Some(byte)
        }

        fn last(&mut self, most: u16) -> Option<u16> {
            let last = self.0.last_mut()?;
            let taken = last.count.min(most);
            last.count -= taken;
            if last.count == 0 {
                self.0.pop();
            }
            Some(taken)
        }

        fn drop(&mut self, meant: Meant) {
            let kept = core::mem::take(&mut self.0);
            for run in kept.into_iter().filter(|run| !meant.covers(run.part)) {
                self.push(run);
            }
        }
    }

    fn told(runs: impl Iterator<Item = Run>) -> Vec<(u16, u8, Part)> {
        runs.map(|run| (run.count, run.byte, run.part)).collect()
    }

    #[test]
    fn whatever_is_done_they_are_those_that_a_plain_list_has() {
        let mut dice = 1_u32;
        let mut below = |end: u32| {
            dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (dice >> 16) % end
        };
        let (mut runs, mut plain) = (Runs::new(), Plain::default());
        let mut most = 0;
        for turn in 0..60_000 {
            // Mostly they become more, then mostly fewer.
            let grows = turn / 700 % 2 == 0;
            let run = Run {
                count: 1 + (below(3) / 2) as u16,
                byte: below(3) as u8,
                part: Part::ALL[below(PARTS as u32) as usize],
            };
            match below(if grows { 40 } else { 12 }) {
                0..=2 => assert_eq!(runs.first().map(|run| run.byte), plain.first()),
                3 => {
                    let taken = runs.last(2).map(|run| run.count);
                    assert_eq!(taken, plain.last(2));
                }
                4 if below(20) == 0 => {
                    let meant = [Meant::GRANT, Meant::BLOCK, Meant::GRANT.and(Meant::BLOCK)];
                    let meant = meant[below(3) as usize];
                    runs.drop(meant);
                    plain.drop(meant);
                }
                5..=7 => {
                    runs.remember(run);
                    plain.remember(run);
                }
                _ => assert_eq!(runs.push(run), plain.push(run)),
            }
            assert_eq!(told(runs.iter()), told(plain.0.iter().copied()));
            most = most.max(plain.0.len());
        }
        assert_eq!(most, MOST);
        runs.drop(Meant::ALL);
        assert!(runs.is_empty());
    }
}
