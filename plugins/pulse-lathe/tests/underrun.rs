//! A host that is late: the queue runs empty inside a cut, which is told and counted.

use pulse_lathe::PulseLathe;
use softplug_link::{Job, Link, LinkOptions, Observed, Recorder, Taken};
use softplug_plugin::{Converter, JobId, LineParameters, Micros, Native};

const PERIOD: i64 = 250;

struct Late {
    link: Link<Native<PulseLathe>>,
    host: Recorder,
    now: Micros,
    taken: u64,
}

impl Late {
    /// A job under way, with these settings.
    fn begin(settings: &[(&str, &str)], program: &[u8]) -> Self {
        let manifest = softplug_abi::manifest::Manifest::parse(PulseLathe::MANIFEST.as_bytes());
        let settings = manifest.unwrap().resolve_settings(settings.iter().copied()).unwrap();
        let line = LineParameters::new(40_000);
        let options = LinkOptions { line, settings, ..LinkOptions::default() };
        let mut link = Link::new(Native::new(), options);
        let mut host = Recorder::default();
        let now = Micros::ZERO;
        link.open(now, &mut host).unwrap();
        host.add_source(JobId(1), program.to_vec());
        let size = Some(program.len() as u64);
        let job = Job { id: JobId(1), kind: 0, size, fields: Vec::new(), check: true };
        link.begin_job(now, job, &mut host).unwrap();
        link.handle_timeout(now, &mut host).unwrap();
        Self { link, host, now, taken: 0 }
    }

    /// The port takes up to `most` bytes, which leave; only then does the host look again.
    fn pass(&mut self, most: usize) -> usize {
        let mut buffer = vec![0; most];
        let count = match self.link.take(&mut buffer) {
            Taken::Bytes(count) => count,
            _ => 0,
        };
        self.taken += count as u64;
        self.now = self.now + Micros(PERIOD * count as i64);
        self.link.left(self.taken, self.taken);
        self.link.handle_timeout(self.now, &mut self.host).unwrap();
        count
    }

    /// What was told: the number of each underrun.
    fn told(&self) -> Vec<u16> {
        let notes = self.host.observed.iter().filter_map(|(_, seen)| match seen {
            Observed::Note(_, code, text) if text.starts_with("underrun") => Some(*code),
            _ => None,
        });
        notes.collect()
    }
}

#[test]
fn a_queue_that_runs_empty_inside_a_cut_is_told_and_counted() {
    let mut late = Late::begin(&[("input", "iso")], b"G00 Z8\n");
    // All that waits has left before the host looks again: two times, and then the rest in time.
    assert_eq!(late.pass(4_096), 400);
    assert_eq!(late.told(), [1]);
    assert_eq!(late.pass(4_096), 400);
    assert_eq!(late.told(), [1], "the last pulse of the cut has left: nothing had to follow");
    let ended = late.host.observed.iter().any(|(_, seen)| matches!(seen, Observed::Done { .. }));
    assert!(!ended, "E2 has still to leave");
    late.pass(4_096);
    let ended = late.host.observed.iter().any(|(_, seen)| matches!(seen, Observed::Done { .. }));
    assert!(ended);
}

#[test]
fn each_underrun_has_its_number() {
    let mut late = Late::begin(&[("input", "iso")], b"G00 Z50\n");
    for number in 1..=5 {
        late.pass(4_096);
        assert_eq!(late.told().len(), number);
    }
    assert_eq!(late.told(), [1, 2, 3, 4, 5]);
}

#[test]
fn a_host_that_looks_in_time_has_none() {
    for most in [1, 7, 50, 99, 250] {
        let mut late = Late::begin(&[("input", "iso")], b"G00 Z50\n");
        while late.pass(most) > 0 {}
        assert_eq!(late.told(), [0; 0], "{most} bytes at a time");
        assert_eq!(late.taken, 5_001);
    }
}

#[test]
fn an_underrun_stops_the_job_if_it_is_to() {
    let mut late = Late::begin(&[("input", "iso"), ("underrun", "stop")], b"G00 Z50\n");
    late.pass(4_096);
    let failed = late
        .host
        .observed
        .iter()
        .any(|(_, seen)| matches!(seen, Observed::Failed { status: 23, sent: 400, .. }));
    assert!(failed, "{:?}", late.host.observed.last());
}
