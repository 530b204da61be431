//! A lane's watchdogs: nothing comes, nothing gets on, the partner holds for
//! too long.

use softplug_abi::Micros;

use super::{Lane, Phase};
use crate::channel::Counters;
use crate::reactor::LaneInstance;
use crate::reactor::report::{Alarm, AlarmKind, Report};
use crate::reactor::setup::Watchdogs;

/// What is watched, since when it has been as it is, and what was raised.
pub(super) struct Watching {
    dogs: [Dog; 3],
}

struct Dog {
    limit: Option<Micros>,
    /// As long as this stays the same, nothing happens that should.
    mark: u64,
    since: Micros,
    is_watching: bool,
    raised: bool,
}

impl Watching {
    pub(super) fn new(watchdogs: Watchdogs) -> Self {
        let limits = [watchdogs.no_bytes, watchdogs.no_progress, watchdogs.stuck_held];
        let dog =
            |limit| Dog { limit, mark: 0, since: Micros::ZERO, is_watching: false, raised: false };
        Self { dogs: limits.map(dog) }
    }

    /// All that is watched begins now.
    pub(super) fn restart(&mut self, now: Micros) {
        for dog in &mut self.dogs {
            dog.since = now;
        }
    }

    /// When the next one strikes.
    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        self.dogs.iter().filter_map(Dog::strikes_at).min()
    }

    fn raised(&self) -> impl Iterator<Item = AlarmKind> {
        AlarmKind::ALL
            .into_iter()
            .zip(&self.dogs)
            .filter(|(_, dog)| dog.raised)
            .map(|(kind, _)| kind)
    }
}

impl Dog {
    fn strikes_at(&self) -> Option<Micros> {
        let limit = self.limit.filter(|_| self.is_watching && !self.raised)?;
        Some(self.since + limit)
    }

    /// Sees how it is; what to tell.
    fn look(&mut self, now: Micros, is_watching: bool, mark: u64) -> Option<bool> {
        if is_watching && self.is_watching && mark == self.mark {
            if self.strikes_at().is_some_and(|at| at <= now) {
                self.raised = true;
                return Some(true);
            }
            return None;
        }
        (self.is_watching, self.mark, self.since) = (is_watching, mark, now);
        std::mem::take(&mut self.raised).then_some(false)
    }
}

impl<I: LaneInstance> Lane<I> {
    pub(super) fn watch(&mut self, now: Micros, counters: &Counters) {
        let is_up = matches!(&self.phase, Phase::Open(channel) if channel.gone().is_none());
        // What is stopped on purpose need not get on.
        let active = self.host.job.as_ref().filter(|active| !active.is_source_stopped());
        let progress = active.map(|active| active.taken + counters.bytes_out);
        let seen = [
            (is_up, counters.bytes_in),
            (is_up && progress.is_some(), progress.unwrap_or(0)),
            (is_up && counters.is_held(), counters.holds),
        ];
        let mut has_changed = false;
        for ((dog, kind), (is_watching, mark)) in
            self.watching.dogs.iter_mut().zip(AlarmKind::ALL).zip(seen)
        {
            if dog.limit.is_none() {
                continue;
            }
            if let Some(raised) = dog.look(now, is_watching, mark) {
                has_changed = true;
                self.host.tell(Report::Alarm(Alarm { kind, raised }));
            }
        }
        if has_changed {
            self.status.set_alarms(self.watching.raised());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dog_strikes_once_and_says_when_it_is_over() {
        let limit = Some(Micros(100));
        let mut watching = Watching::new(Watchdogs { no_bytes: limit, ..Watchdogs::default() });
        let dog = &mut watching.dogs[0];
        assert_eq!(dog.look(Micros(0), true, 7), None);
        assert_eq!(dog.strikes_at(), Some(Micros(100)));
        assert_eq!(dog.look(Micros(90), true, 8), None);
        assert_eq!(dog.strikes_at(), Some(Micros(190)));
        assert_eq!(dog.look(Micros(190), true, 8), Some(true));
        assert_eq!(dog.look(Micros(900), true, 8), None);
        assert_eq!(dog.look(Micros(901), true, 9), Some(false));
        assert_eq!(dog.look(Micros(950), false, 9), None);
        assert_eq!(dog.strikes_at(), None);
    }
}
