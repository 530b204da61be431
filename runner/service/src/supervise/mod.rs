//! What becomes of a link whose plug-in fails: started again after a while,
//! then quarantined. And which versions a link takes by itself. Pure: the time is
//! given, nothing is started here.

pub mod evidence;
mod follow;

pub use follow::{Follow, Taking};

use std::collections::VecDeque;
use std::time::Duration;

/// When to start again, and when no more.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Limits {
    /// From a fault to the first new start; each further one takes twice as long.
    pub first_delay: Duration,
    /// But never longer than this.
    pub longest_delay: Duration,
    /// With so many faults the link is quarantined, at least 1.
    pub faults: u32,
    /// As far as they lie no longer apart than this.
    pub within: Duration,
}

impl Default for Limits {
    /// From 100 ms to 30 s; five faults in ten minutes are too many.
    fn default() -> Self {
        Self {
            first_delay: Duration::from_millis(100),
            longest_delay: Duration::from_secs(30),
            faults: 5,
            within: Duration::from_mins(10),
        }
    }
}

/// What failed.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Failed {
    /// The plug-in of the link.
    Settled,
    /// One on probation that could not be taken back in the middle: the one before
    /// it is to be started, which has done nothing wrong.
    OnProbation,
    /// There was no instance to start, or it refused its settings.
    Start,
}

/// What is to be done about it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// Start the link's plug-in at that time.
    RestartAt(Duration),
    /// Start the plug-in that was there before the one on probation, now.
    RestartFormer,
    /// Start nothing until somebody releases the link.
    Quarantine,
}

/// How a link's plug-in is.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum State {
    /// It runs.
    Running,
    /// It has failed and is started again at that time.
    Waiting {
        /// When.
        until: Duration,
    },
    /// It is left alone.
    Quarantined {
        /// Since when.
        since: Duration,
        /// How many faults led there.
        faults: u32,
    },
}

/// Watches over the plug-in of one link. Times are spans since the gateway began.
#[derive(Clone, Debug)]
pub struct Supervisor {
    limits: Limits,
    /// When it failed, within the span that counts.
    faults: VecDeque<Duration>,
    state: State,
}

impl Supervisor {
    /// For a link whose plug-in is about to run.
    pub fn new(limits: Limits) -> Self {
        Self { limits, faults: VecDeque::new(), state: State::Running }
    }

    /// How the plug-in is.
    pub fn state(&self) -> State {
        self.state
    }

    /// Faults that count at `now`.
    pub fn faults(&mut self, now: Duration) -> u32 {
        let within = self.limits.within;
        while self.faults.front().is_some_and(|at| now.saturating_sub(*at) > within) {
            self.faults.pop_front();
        }
        self.faults.len() as u32
    }

    /// The plug-in has failed. A second report of the same end changes nothing.
    pub fn failed(&mut self, now: Duration, what: Failed) -> Verdict {
        match self.state {
            State::Waiting { until } => return Verdict::RestartAt(until),
            State::Quarantined { .. } => return Verdict::Quarantine,
            State::Running => {}
        }
        if what == Failed::OnProbation {
            self.faults.clear();
            return Verdict::RestartFormer;
        }
        self.faults.push_back(now);
        let faults = self.faults(now);
        if faults >= self.limits.faults.max(1) {
            self.state = State::Quarantined { since: now, faults };
            return Verdict::Quarantine;
        }
        let until = now + self.delay(faults);
        self.state = State::Waiting { until };
        Verdict::RestartAt(until)
    }

    fn delay(&self, faults: u32) -> Duration {
        let doubled = 1_u32 << faults.saturating_sub(1).min(20);
        let delay = self.limits.first_delay.saturating_mul(doubled);
        delay.min(self.limits.longest_delay.max(self.limits.first_delay))
    }

    /// When something is to be done.
    pub fn next(&self) -> Option<Duration> {
        match self.state {
            State::Waiting { until } => Some(until),
            State::Running | State::Quarantined { .. } => None,
        }
    }

    /// Somebody stops the plug-in, whatever it is doing: nothing is started until somebody releases
    /// the link. `false` if it is in quarantine already.
    pub fn quarantine(&mut self, now: Duration) -> bool {
        let is_new = !matches!(self.state, State::Quarantined { .. });
        if is_new {
            let faults = self.faults(now);
            self.state = State::Quarantined { since: now, faults };
        }
        is_new
    }

    /// Whether the plug-in is to be started now; told once.
    pub fn takes_start(&mut self, now: Duration) -> bool {
        let is_due = self.next().is_some_and(|until| until <= now);
        if is_due {
            self.state = State::Running;
        }
        is_due
    }

    /// Somebody releases the link: its plug-in is to be started now, and what was
    /// before is forgotten. `false` if it is not in quarantine.
    pub fn release(&mut self) -> bool {
        let was_quarantined = matches!(self.state, State::Quarantined { .. });
        if was_quarantined {
            self.begin_anew();
        }
        was_quarantined
    }

    /// The link has another plug-in, or other settings: what the old one did no
    /// longer counts, and a quarantine is over.
    pub fn begin_anew(&mut self) {
        self.faults.clear();
        self.state = State::Running;
    }

    /// Other limits, from here on.
    pub fn limit(&mut self, limits: Limits) {
        self.limits = limits;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn supervisor(faults: u32) -> Supervisor {
        Supervisor::new(Limits {
            first_delay: seconds(1),
            longest_delay: seconds(5),
            faults,
            within: seconds(100),
        })
    }

    #[test]
    fn starts_again_later_and_later() {
        let mut supervisor = supervisor(10);
        let mut now = seconds(0);
        let mut delays = Vec::new();
        for _ in 0..5 {
            let Verdict::RestartAt(until) = supervisor.failed(now, Failed::Settled) else {
                panic!("not that many faults")
            };
            assert_eq!(supervisor.failed(now, Failed::Settled), Verdict::RestartAt(until));
            assert!(!supervisor.takes_start(until.saturating_sub(Duration::from_nanos(1))));
            assert_eq!(supervisor.next(), Some(until));
            assert!(supervisor.takes_start(until) && !supervisor.takes_start(until));
            delays.push(until.saturating_sub(now).as_secs());
            now = until;
        }
        assert_eq!(delays, [1, 2, 4, 5, 5]);
    }

    #[test]
    fn too_many_faults_in_a_span_are_a_quarantine() {
        let mut supervisor = supervisor(3);
        for at in [0, 60] {
            assert!(matches!(
                supervisor.failed(seconds(at), Failed::Settled),
                Verdict::RestartAt(_)
            ));
            assert!(supervisor.takes_start(seconds(at + 10)));
        }
        // The first one is long ago.
        assert_eq!(
            supervisor.failed(seconds(101), Failed::Start),
            Verdict::RestartAt(seconds(103))
        );
        assert!(supervisor.takes_start(seconds(103)));
        assert_eq!(supervisor.failed(seconds(104), Failed::Settled), Verdict::Quarantine);
        let quarantined = State::Quarantined { since: seconds(104), faults: 3 };
        assert_eq!((supervisor.state(), supervisor.next()), (quarantined, None));
        assert!(!supervisor.takes_start(seconds(9_999)));
        assert_eq!(supervisor.failed(seconds(9_999), Failed::Settled), Verdict::Quarantine);

        assert!(supervisor.release());
        assert!(!supervisor.release());
        assert_eq!((supervisor.state(), supervisor.faults(seconds(105))), (State::Running, 0));
        let again = supervisor.failed(seconds(105), Failed::Settled);
        assert_eq!(again, Verdict::RestartAt(seconds(106)));
        supervisor.begin_anew();
        assert_eq!(supervisor.state(), State::Running);
    }

    #[test]
    fn somebody_may_stop_it_at_any_time() {
        let mut supervisor = supervisor(3);
        assert!(matches!(supervisor.failed(seconds(1), Failed::Settled), Verdict::RestartAt(_)));
        assert!(supervisor.quarantine(seconds(1)));
        let stopped = State::Quarantined { since: seconds(1), faults: 1 };
        assert_eq!((supervisor.state(), supervisor.next()), (stopped, None));
        assert!(!supervisor.quarantine(seconds(2)) && !supervisor.takes_start(seconds(9)));
        // Its end is told as a fault: nothing comes of that any more.
        assert_eq!(supervisor.failed(seconds(2), Failed::OnProbation), Verdict::Quarantine);
        assert!(supervisor.release());
        assert_eq!((supervisor.state(), supervisor.faults(seconds(3))), (State::Running, 0));
    }

    #[test]
    fn one_fault_is_enough_if_the_limit_says_so() {
        for limit in [0, 1] {
            let mut supervisor = supervisor(limit);
            assert_eq!(supervisor.failed(seconds(1), Failed::Settled), Verdict::Quarantine);
        }
    }

    #[test]
    fn a_failed_probation_is_not_held_against_the_one_before() {
        let mut supervisor = supervisor(2);
        assert!(matches!(supervisor.failed(seconds(1), Failed::Settled), Verdict::RestartAt(_)));
        assert!(supervisor.takes_start(seconds(2)));
        assert_eq!(supervisor.failed(seconds(3), Failed::OnProbation), Verdict::RestartFormer);
        assert_eq!(supervisor.state(), State::Running);
        assert_eq!(supervisor.failed(seconds(4), Failed::Settled), Verdict::RestartAt(seconds(5)));
    }
}
