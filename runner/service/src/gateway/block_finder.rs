//! At which block the jobs under way are: looked up in their programs, away from the control loop.

use softplug_abi::JobId;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::Control;
use crate::jobs::Data;
use crate::jobs::blocks::BlockCursor;
use crate::programs::Snapshots;
use crate::view::BlockView;

/// A job whose block is wanted.
#[derive(Debug)]
pub(super) struct Wanted {
    pub(super) job: JobId,
    pub(super) link: String,
    pub(super) data: Data,
    /// The block at which it began, and the byte.
    pub(super) begins: (u64, u64),
    /// The first byte that has not surely left.
    pub(super) byte: u64,
}

/// Where the last look at each program ended.
#[derive(Clone, Debug, Default)]
pub(super) struct BlockFinder {
    places: Arc<Mutex<HashMap<JobId, Place>>>,
    /// A look that takes long is not followed by another before it is over.
    is_looking: bool,
}

#[derive(Debug)]
struct Place {
    cursor: BlockCursor,
    start: u64,
    end: u64,
}

/// The block of each of these that is in another one than at the last look.
fn find(
    places: &mut HashMap<JobId, Place>,
    wanted: &[Wanted],
    snapshots: &Snapshots,
) -> Vec<(String, JobId, BlockView)> {
    places.retain(|job, _| wanted.iter().any(|wanted| wanted.job == *job));
    let mut found = Vec::new();
    for Wanted { job, link, data, begins, byte } in wanted {
        let place = places.entry(*job).or_insert_with(|| Place {
            cursor: BlockCursor::beginning(begins.0, begins.1),
            start: 0,
            end: 0,
        });
        let is_same = (place.start..place.end).contains(byte);
        // It is sent to its end: nothing follows the last block.
        if is_same || (place.end != 0 && place.end >= data.size && *byte >= place.start) {
            continue;
        }
        let block = snapshots.open(*data).map(|mut file| place.cursor.block_at(&mut file, *byte));
        // Whoever sends it says what cannot be read.
        if let Ok(Ok(Some(block))) = block {
            (place.start, place.end) = (block.start, block.end);
            found.push((link.clone(), *job, BlockView { number: block.number, text: block.text }));
        }
    }
    found
}

impl Control {
    /// Has the blocks of these jobs looked up.
    pub(super) fn find_blocks(&mut self, wanted: Vec<Wanted>) {
        if wanted.is_empty() || self.block_finder.is_looking {
            return;
        }
        self.block_finder.is_looking = true;
        let (places, shared) = (Arc::clone(&self.block_finder.places), Arc::clone(&self.shared));
        self.shared.parts.worker.give(move || {
            let mut places = places.lock().unwrap_or_else(PoisonError::into_inner);
            let found = find(&mut places, &wanted, &shared.parts.snapshots);
            shared.tell(move |control| control.found_blocks(found));
        });
    }

    fn found_blocks(&mut self, found: Vec<(String, JobId, BlockView)>) {
        self.block_finder.is_looking = false;
        for (link, job, block) in found {
            let running = self.links.get_mut(&link).and_then(|link| link.job.as_mut());
            if let Some(running) = running.filter(|running| running.job.id == job) {
                running.block = Some(block);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn only_what_has_got_to_another_block_is_looked_up() {
        let folder = tempfile::tempdir().unwrap();
        let snapshots = Snapshots::open_folder(folder.path()).unwrap();
        let program = (1..=9).map(|n| format!("N{n} G1 X{n}\n")).collect::<Vec<_>>().concat();
        let data = snapshots.take_all(&mut io::Cursor::new(program), "O1", 1_000).unwrap();
        let mut places = HashMap::new();
        let mut at = |byte| {
            let link = "lathe-1".to_owned();
            let wanted = [Wanted { job: JobId(1), link, data, begins: (1, 0), byte }];
            find(&mut places, &wanted, &snapshots).pop().map(|(_, _, block)| block.text)
        };
        assert_eq!(at(0).as_deref(), Some("N1 G1 X1"));
        assert_eq!(at(8), None, "it is in the same block yet");
        assert_eq!(at(9).as_deref(), Some("N2 G1 X2"));
        assert_eq!(at(74).as_deref(), Some("N9 G1 X9"));
        assert_eq!(at(81), None, "it has ended");
        assert_eq!(at(0).as_deref(), Some("N1 G1 X1"), "it was put back");
        find(&mut places, &[], &snapshots);
        assert!(places.is_empty(), "what has ended is forgotten");
    }
}
