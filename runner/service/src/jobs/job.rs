//! A job as it is written down.

use serde::{Deserialize, Serialize};
use softplug_abi::JobId;
use softplug_catalogue::is_same_program;
use softplug_live::units::StoredDelivery;

use super::State;
use crate::programs::Data;
pub use crate::view::{CheckFault, JobOrigin as Origin};

/// What kind of work a job is.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A program goes to the machine.
    Send,
    /// The machine is asked for something, which comes as a reception.
    Fetch,
    /// The machine sends of its own accord.
    Receive,
}

/// What to do: a job before it has a number.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct JobSpec {
    /// The link.
    pub link: String,
    /// What kind of work.
    pub kind: Kind,
    /// The plug-in's name for such a job, from its manifest; empty for a reception.
    #[serde(default)]
    pub job_kind: String,
    /// Its fields, name and value.
    #[serde(default)]
    pub fields: Vec<(String, String)>,
    /// The program's name.
    #[serde(default)]
    pub program: Option<String>,
    /// The name that the program says of itself in its text, as far as that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub named: Option<String>,
    /// The snapshot that is sent; none for a job without data, and for one whose data come
    /// from a connection.
    #[serde(default)]
    pub data: Option<Data>,
    /// Its first byte that is sent.
    #[serde(default)]
    pub from: u64,
    /// The block that it begins with, counted from 1; 0 for a byte within one.
    #[serde(default = "first_block")]
    pub from_block: u64,
    /// The highest goes first.
    #[serde(default)]
    pub priority: i32,
    /// Who wants it.
    #[serde(default)]
    pub origin: Origin,
    /// The job that this one does again, or goes on with.
    #[serde(default)]
    pub restarts: Option<JobId>,
    /// Words of coordination in its program that lie before what it sends.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub words_before: u32,
    /// Loaded by another channel of its cell, and begun when one starts it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Start>,
}

/// Whether a job that was loaded by a program has been started.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// It waits until a program starts it.
    Awaited,
    /// It was started: it goes before all others.
    Given,
}

impl JobSpec {
    /// A program to send, with nothing said beyond what is needed.
    pub fn send(link: impl Into<String>, program: impl Into<String>, data: Data) -> Self {
        let program = Some(program.into());
        Self { program, data: Some(data), ..Self::new(link, Kind::Send, "send") }
    }

    /// A job without data.
    pub fn new(link: impl Into<String>, kind: Kind, job_kind: impl Into<String>) -> Self {
        Self {
            link: link.into(),
            kind,
            job_kind: job_kind.into(),
            fields: Vec::new(),
            program: None,
            named: None,
            data: None,
            from: 0,
            from_block: 1,
            priority: 0,
            origin: Origin::default(),
            restarts: None,
            words_before: 0,
            start: None,
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_zero(number: &u32) -> bool {
    *number == 0
}

fn first_block() -> u64 {
    1
}

/// Which bytes of the data have left. Counted from the beginning of the snapshot, also for
/// a job that begins further on.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Extent {
    /// All before this byte have surely left.
    pub surely: u64,
    /// None from this byte on can have left. Written down before they are given away.
    pub maybe: u64,
}

/// A delivery as its unit numbered it, which says it again until it knows that it is stored.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FromUnit {
    /// The port of the link, as `unit://10.0.0.17:7640/mill`: it stays where the link is called otherwise.
    pub port: String,
    /// The delivery.
    pub said: StoredDelivery,
}

/// What the link knows of a job that has ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Left {
    /// Which bytes have left.
    pub extent: Extent,
    /// Bytes of the program that the plug-in took, counted like these.
    pub taken: u64,
    /// Bytes that left for it, as the plug-in counts.
    pub sent: u64,
}

/// Why a job did not end well.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Reason {
    /// Its name: the ABI's failures, `interrupted`, `disk`.
    pub failure: String,
    /// The protocol's own code, 0 without.
    #[serde(default)]
    pub status: u16,
    /// For people.
    pub text: String,
    /// Where in the program the fault is.
    #[serde(default)]
    pub check: Option<CheckFault>,
}

impl Reason {
    /// Without a code of the protocol.
    pub fn new(failure: impl Into<String>, text: impl Into<String>) -> Self {
        Self { failure: failure.into(), status: 0, text: text.into(), check: None }
    }
}

/// What came, and where it is.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Reception {
    /// Its file's name in the link's folder of receptions; none if nothing came.
    pub file: Option<String>,
    /// Bytes.
    pub bytes: u64,
    /// Whether it is whole.
    pub is_complete: bool,
    /// How it compares with what was sent last under this name.
    #[serde(default)]
    pub compared: Option<Comparison>,
}

/// A reception beside what was sent last under its name.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Comparison {
    /// The job that sent it.
    pub with: u32,
    /// The first byte that differs; none: they are the same.
    pub differs_at: Option<u64>,
}

/// A job with a number.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Job {
    /// Its number, never given twice.
    pub id: JobId,
    /// What to do.
    #[serde(flatten)]
    pub spec: JobSpec,
    /// Where it stands.
    pub state: State,
    /// Which bytes have left.
    #[serde(default)]
    pub extent: Extent,
    /// Bytes of the program that the plug-in took, those before the first one sent
    /// included; known when the job has ended.
    #[serde(default)]
    pub taken: u64,
    /// Bytes that left for it, as the plug-in counts; known when the job has ended.
    #[serde(default)]
    pub sent: u64,
    /// Words of coordination in its program that are behind it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub passed: u32,
    /// Why it did not end well.
    #[serde(default)]
    pub reason: Option<Reason>,
    /// What came.
    #[serde(default)]
    pub reception: Option<Reception>,
    /// It ended otherwise than done, and nobody has acknowledged that yet.
    #[serde(default)]
    pub is_unseen: bool,
    /// When it was given, in milliseconds since 1970.
    pub created: u64,
    /// When it began.
    #[serde(default)]
    pub began: Option<u64>,
    /// When it ended.
    #[serde(default)]
    pub ended: Option<u64>,
}

impl Job {
    /// The plug-in has, or had, it.
    pub fn has_begun(&self) -> bool {
        self.began.is_some()
    }

    /// The link is busy with it. A reception does not keep the link from sending.
    pub fn occupies(&self) -> bool {
        self.spec.kind != Kind::Receive && self.has_begun() && !self.state.is_final()
    }

    /// It ended otherwise than done, after it had begun: somebody has to know.
    pub(super) fn has_ended_badly(&self) -> bool {
        self.has_begun() && self.state.is_final() && self.state != State::Done
    }

    /// The file of its reception, if it has one.
    pub fn file(&self) -> Option<&str> {
        self.reception.as_ref()?.file.as_deref()
    }

    /// The name that the program says of itself, where it is another than its file's.
    pub fn other_name(&self) -> Option<&str> {
        let file = super::plain_name(self.spec.program.as_deref()?);
        let named = self.spec.named.as_deref()?;
        (!is_same_program(file, named)).then_some(named)
    }

    /// Bytes of the snapshot, 0 without.
    pub fn size(&self) -> u64 {
        self.spec.data.map_or(0, |data| data.size)
    }
}

/// The job whose turn it is among those of one link: none while one is under way.
pub(super) fn next<'a>(jobs: impl Iterator<Item = &'a Job> + Clone) -> Option<&'a Job> {
    if jobs.clone().any(Job::occupies) {
        return None;
    }
    let queued = jobs.filter(|job| job.state == State::Queued);
    let ready = queued.filter(|job| job.spec.start != Some(Start::Awaited));
    ready.max_by_key(|job| (job.spec.start, job.spec.priority, std::cmp::Reverse(job.id)))
}

#[cfg(test)]
mod tests {
    use softplug_host::Digest;

    use super::*;
    use proptest::prelude::*;

    fn job(id: JobId, priority: i32, state: State, has_begun: bool, kind: Kind) -> Job {
        Job {
            id,
            spec: JobSpec { priority, ..JobSpec::new("a", kind, "send") },
            state,
            extent: Extent::default(),
            taken: 0,
            sent: 0,
            passed: 0,
            reason: None,
            reception: None,
            is_unseen: false,
            created: 0,
            began: has_begun.then_some(1),
            ended: None,
        }
    }

    #[test]
    fn the_highest_goes_first_and_among_equals_the_oldest() {
        let queued = |id, priority| job(id, priority, State::Queued, false, Kind::Send);
        let mut jobs = vec![
            queued(JobId(1), 0),
            queued(JobId(2), 5),
            queued(JobId(3), 5),
            queued(JobId(4), -1),
        ];
        assert_eq!(next(jobs.iter()).map(|job| job.id), Some(JobId(2)));
        jobs.push(job(JobId(5), 0, State::Running, true, Kind::Receive));
        assert_eq!(next(jobs.iter()).map(|job| job.id), Some(JobId(2)));
        jobs.push(job(JobId(6), 0, State::Paused, true, Kind::Send));
        assert_eq!(next(jobs.iter()), None);
    }

    #[test]
    fn what_was_loaded_waits_for_its_start_and_goes_first_then() {
        let queued = |id, priority, start| {
            let mut job = job(id, priority, State::Queued, false, Kind::Send);
            job.spec.start = start;
            job
        };
        let jobs = [queued(JobId(1), 0, None), queued(JobId(2), 9, Some(Start::Awaited))];
        assert_eq!(next(jobs.iter()).map(|job| job.id), Some(JobId(1)));
        let jobs = [queued(JobId(1), 9, None), queued(JobId(2), 0, Some(Start::Given))];
        assert_eq!(next(jobs.iter()).map(|job| job.id), Some(JobId(2)));
    }

    proptest! {
        #[test]
        fn one_at_a_time_and_only_what_waits(
            jobs in proptest::collection::vec((any::<i32>(), 0..7_usize, any::<bool>()), 0..12)
        ) {
            let jobs: Vec<_> = (1..).zip(jobs).map(|(id, (priority, state, begun))| {
                job(JobId(id), priority, super::super::state::ALL[state], begun, Kind::Send)
            }).collect();
            match next(jobs.iter()) {
                None => prop_assert!(
                    jobs.iter().any(Job::occupies) || jobs.iter().all(|job| job.state != State::Queued)
                ),
                Some(found) => {
                    prop_assert!(!jobs.iter().any(Job::occupies));
                    prop_assert_eq!(found.state, State::Queued);
                    for other in jobs.iter().filter(|other| other.state == State::Queued) {
                        prop_assert!(found.spec.priority >= other.spec.priority);
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_written_is_read_also_if_it_is_from_an_older_gateway() {
        let data = Data { digest: Digest::of(b"G1"), size: 2 };
        let mut one = job(JobId(1), 3, State::Running, true, Kind::Send);
        one.spec = JobSpec::send("lathe", "O1", data);
        let text = serde_json::to_string(&one).unwrap();
        assert_eq!(serde_json::from_str::<Job>(&text).unwrap(), one);
        let old = r#"{"id": 7, "link": "a", "kind": "send", "state": "queued", "created": 1}"#;
        let old: Job = serde_json::from_str(old).unwrap();
        assert_eq!((old.id, old.spec.origin, old.size()), (JobId(7), Origin::Order, 0));
    }
}
