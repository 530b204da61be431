//! How much of a job's data can have left: no byte leaves before the characters
//! that waited when the plug-in was given it.

use alloc::collections::VecDeque;

/// Pieces that are told apart; more than wait in a queue of [`GRAINS`] and are
/// on the wire behind it.
const PIECES: usize = 128;
/// Parts of the transmit room that are told apart.
const GRAINS: u32 = 64;

/// The data of the latest job, in pieces.
#[derive(Clone, Debug)]
pub(crate) struct Fed {
    pieces: VecDeque<Piece>,
    /// Characters between two pieces, at least.
    grain: u64,
    bytes: u64,
    /// Urgent bytes since the job began. Each may be one of the data's that
    /// passed the queue.
    urgent: u64,
}

#[derive(Copy, Clone, Debug)]
struct Piece {
    /// None of it is among so many characters that the port was given.
    behind: u64,
    /// Bytes of the data up to its end.
    end: u64,
}

impl Fed {
    pub(crate) fn new(transmit_room: u32) -> Self {
        let grain = u64::from((transmit_room / GRAINS).max(1));
        Self { pieces: VecDeque::new(), grain, bytes: 0, urgent: 0 }
    }

    /// A job begins.
    pub(crate) fn begin(&mut self) {
        self.pieces.clear();
        (self.bytes, self.urgent) = (0, 0);
    }

    /// The plug-in is given `count` bytes while it has handed over `behind`
    /// characters in all.
    pub(crate) fn give(&mut self, count: usize, behind: u64) {
        self.bytes += count as u64;
        match self.pieces.back_mut() {
            Some(last) if behind < last.behind + self.grain => last.end = self.bytes,
            _ => self.pieces.push_back(Piece { behind, end: self.bytes }),
        }
        if self.pieces.len() > PIECES
            && let Some(oldest) = self.pieces.pop_front()
            && let Some(next) = self.pieces.front_mut()
        {
            next.behind = oldest.behind;
        }
    }

    pub(crate) fn urgent(&mut self, count: usize) {
        self.urgent += count as u64;
    }

    /// What waited is dropped: what the plug-in sends again comes behind `given` characters.
    pub(crate) fn discarded(&mut self, given: u64) {
        for piece in &mut self.pieces {
            piece.behind = piece.behind.min(given);
        }
    }

    /// Bytes of the data of which some may be among the first `characters` that
    /// the port was given.
    pub(crate) fn within(&self, characters: u64) -> u64 {
        let begun = self.pieces.iter().take_while(|piece| piece.behind < characters).last();
        (begun.map_or(0, |piece| piece.end) + self.urgent).min(self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, Debug)]
    enum Step {
        Give(usize),
        Pass(usize),
        Urgent(usize),
        Take(usize),
        Discard,
    }

    fn step() -> impl Strategy<Value = Step> {
        prop_oneof![
            4 => (1_usize..600).prop_map(Step::Give),
            4 => (1_usize..600).prop_map(Step::Pass),
            1 => (1_usize..4).prop_map(Step::Urgent),
            4 => (1_usize..300).prop_map(Step::Take),
            1 => Just(Step::Discard),
        ]
    }

    proptest! {
        /// A plug-in that passes its data on byte by byte, with what it likes between, and sends
        /// again what was discarded.
        #[test]
        fn nothing_leaves_that_does_not_count(
            steps in prop::collection::vec(step(), 1..400),
            room in prop_oneof![Just(1_u32), Just(64), Just(4_096), Just(65_536)],
        ) {
            let mut fed = Fed::new(room);
            fed.begin();
            let (mut given, mut waiting) = (0_u64, VecDeque::new());
            let (mut bytes, mut next, mut left) = (0_u64, 0_u64, 0_u64);
            for step in steps {
                match step {
                    Step::Give(count) => {
                        fed.give(count, given + waiting.len() as u64);
                        bytes += count as u64;
                    }
                    Step::Pass(count) => {
                        let end = bytes.min(next + count as u64);
                        waiting.extend(next..end);
                        next = end;
                    }
                    Step::Urgent(count) => {
                        // They pass the queue, and may be the data's next.
                        let end = bytes.min(next + count as u64);
                        fed.urgent(count);
                        given += count as u64;
                        if waiting.is_empty() {
                            left = left.max(end);
                            next = end;
                        }
                    }
                    Step::Take(count) => {
                        for _ in 0..count.min(waiting.len()) {
                            given += 1;
                            left = left.max(waiting.pop_front().unwrap() + 1);
                        }
                    }
                    Step::Discard => {
                        next = waiting.front().copied().unwrap_or(next);
                        waiting.clear();
                        fed.discarded(given);
                    }
                }
                prop_assert!(left <= fed.within(given), "{left} of {fed:?} at {given}");
                prop_assert!(fed.within(given) <= bytes);
            }
        }
    }

    #[test]
    fn what_waits_does_not_count() {
        let mut fed = Fed::new(4_096);
        fed.begin();
        // Eight pieces of 512 bytes that are passed on at once, of which 400 have left.
        for piece in 0..8 {
            fed.give(512, piece * 512);
        }
        assert_eq!([fed.within(0), fed.within(400), fed.within(513)], [0, 512, 1_024]);
        // What waits is discarded: it may be sent again.
        fed.discarded(400);
        assert_eq!([fed.within(400), fed.within(401)], [512, 4_096]);
    }
}
