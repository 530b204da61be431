//! When a file in a drop folder is whole, as far as its size and its times tell: they have not
//! changed for a while. Without a clock and without a disk.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::time::Duration;

/// What changes when somebody writes to a file, or puts another in its place.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct FileState {
    pub(super) inode: u64,
    pub(super) size: u64,
    /// Seconds and nanoseconds, on the clock of whoever has the disk.
    pub(super) modified: (i64, i64),
    pub(super) changed: (i64, i64),
}

/// The files of a folder from one look to the next.
#[derive(Debug, Default)]
pub(super) struct Settling {
    seen: BTreeMap<OsString, Seen>,
    looks: u64,
}

#[derive(Copy, Clone, Debug)]
struct Seen {
    state: FileState,
    since: Duration,
    first_look: u64,
}

impl Settling {
    /// What is there at `now`, on a clock that never goes back. Gives those that have not changed for
    /// `settle`, in the order in which they came: by the look that first saw them, then by when
    /// something of them last changed (a copy may keep the time of what it copies), then by name. An empty one may be the beginning of a copy, and never settles.
    pub(super) fn look(
        &mut self,
        found: BTreeMap<OsString, FileState>,
        now: Duration,
        settle: Duration,
    ) -> Vec<(OsString, FileState)> {
        self.looks += 1;
        let before = std::mem::take(&mut self.seen);
        let mut settled = Vec::new();
        for (name, state) in found {
            let known = before.get(&name);
            let first_look = known.map_or(self.looks, |known| known.first_look);
            let since = known.filter(|known| known.state == state).map_or(now, |known| known.since);
            let seen = Seen { state, since, first_look };
            if state.size > 0 && now.saturating_sub(since) >= settle {
                settled.push((first_look, state.changed, name.clone(), state));
            }
            self.seen.insert(name, seen);
        }
        settled.sort_by(|one, other| (one.0, one.1, &one.2).cmp(&(other.0, other.1, &other.2)));
        settled.into_iter().map(|(_, _, name, state)| (name, state)).collect()
    }

    /// The folder was gone: what is there when it comes back is new.
    pub(super) fn forget(&mut self) {
        self.seen.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTLE: Duration = Duration::from_secs(5);

    fn file(size: u64, modified: i64) -> FileState {
        FileState { inode: 1, size, modified: (modified, 0), changed: (modified, 0) }
    }

    fn look(settling: &mut Settling, now: u64, found: &[(&str, FileState)]) -> Vec<String> {
        let found = found.iter().map(|(name, state)| (OsString::from(name), *state)).collect();
        let settled = settling.look(found, Duration::from_secs(now), SETTLE);
        settled.into_iter().map(|(name, _)| name.into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_settles_when_nothing_of_it_has_changed_for_long_enough() {
        let mut settling = Settling::default();
        let mut at = |now, state| look(&mut settling, now, &[("O1", state)]).len();
        assert_eq!(at(0, file(10, 1)), 0);
        assert_eq!(at(4, file(20, 1)), 0, "it grew");
        assert_eq!(at(8, file(20, 2)), 0, "it was written over");
        assert_eq!(at(12, FileState { inode: 2, ..file(20, 2) }), 0, "it is another one");
        assert_eq!(at(16, FileState { inode: 2, ..file(20, 2) }), 0);
        assert_eq!(at(17, FileState { inode: 2, ..file(20, 2) }), 1);
    }

    #[test]
    fn an_empty_one_never_does() {
        let mut settling = Settling::default();
        assert!(look(&mut settling, 0, &[("O1", file(0, 1))]).is_empty());
        assert!(look(&mut settling, 1_000, &[("O1", file(0, 1))]).is_empty());
        assert!(look(&mut settling, 1_001, &[("O1", file(1, 1))]).is_empty());
        assert_eq!(look(&mut settling, 1_006, &[("O1", file(1, 1))]), ["O1"]);
    }

    #[test]
    fn the_order_is_that_of_arrival() {
        let mut settling = Settling::default();
        look(&mut settling, 0, &[("z", file(1, 9))]);
        look(&mut settling, 1, &[("z", file(1, 9)), ("b", file(1, 3)), ("a", file(1, 4))]);
        let all = [("a", file(1, 4)), ("b", file(1, 3)), ("c", file(1, 3)), ("z", file(1, 9))];
        look(&mut settling, 2, &all);
        assert_eq!(look(&mut settling, 7, &all), ["z", "b", "a", "c"]);
    }

    #[test]
    fn what_was_gone_begins_anew() {
        let mut settling = Settling::default();
        look(&mut settling, 0, &[("O1", file(1, 1))]);
        look(&mut settling, 4, &[]);
        assert!(look(&mut settling, 8, &[("O1", file(1, 1))]).is_empty());
        settling.forget();
        assert!(look(&mut settling, 12, &[("O1", file(1, 1))]).is_empty());
        assert_eq!(look(&mut settling, 17, &[("O1", file(1, 1))]), ["O1"]);
    }

    #[test]
    fn without_a_time_to_settle_the_first_look_will_do() {
        let mut settling = Settling::default();
        let found = BTreeMap::from([(OsString::from("O1"), file(1, 1))]);
        assert_eq!(settling.look(found, Duration::ZERO, Duration::ZERO).len(), 1);
    }
}
