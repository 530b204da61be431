//! Who reads what is known of jobs and who changes it keep out of each other's way: neither waits
//! while the other stands still in the middle of the disk.

use softplug_abi::JobId;
use std::io;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use redb::StorageBackend;
use redb::backends::InMemoryBackend;
use softplug_host::Digest;
use softplug_service::jobs::{
    Advance, Data, Ending, EntryFilter, JobFilter, JobSpec, Jobs, Keep, State,
};

/// Longer than anything here takes; only a wait for the other side gets there.
const HANG: Duration = Duration::from_mins(1);

/// A storage whose reads, or syncs, stand still while its gate is shut. Reads by threads
/// called `reader` only.
#[derive(Clone, Debug, Default)]
struct Gate {
    shut: Arc<(Mutex<Shut>, Condvar)>,
}

#[derive(Debug, Default)]
struct Shut {
    reads: bool,
    syncs: bool,
    /// Who stands before it.
    waiting: usize,
}

impl Gate {
    fn shut(&self, change: impl FnOnce(&mut Shut)) {
        change(&mut self.shut.0.lock().unwrap());
        self.shut.1.notify_all();
    }

    fn pass(&self, is_shut: impl Fn(&Shut) -> bool) {
        let mut shut = self.shut.0.lock().unwrap();
        shut.waiting += 1;
        self.shut.1.notify_all();
        while is_shut(&shut) {
            shut = self.shut.1.wait(shut).unwrap();
        }
        shut.waiting -= 1;
    }

    /// Somebody stands before it.
    fn wait(&self) {
        let shut = self.shut.0.lock().unwrap();
        let (_shut, waited) =
            self.shut.1.wait_timeout_while(shut, HANG, |shut| shut.waiting == 0).unwrap();
        assert!(!waited.timed_out(), "nobody came to the gate");
    }
}

#[derive(Debug)]
struct Gated {
    memory: Arc<InMemoryBackend>,
    gate: Gate,
}

impl StorageBackend for Gated {
    fn len(&self) -> Result<u64, io::Error> {
        self.memory.len()
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> Result<(), io::Error> {
        if thread::current().name() == Some("reader") {
            self.gate.pass(|shut| shut.reads);
        }
        self.memory.read(offset, out)
    }

    fn set_len(&self, len: u64) -> Result<(), io::Error> {
        self.memory.set_len(len)
    }

    fn sync_data(&self) -> Result<(), io::Error> {
        self.gate.pass(|shut| shut.syncs);
        self.memory.sync_data()
    }

    fn write(&self, offset: u64, data: &[u8]) -> Result<(), io::Error> {
        self.memory.write(offset, data)
    }
}

fn open(gate: &Gate) -> Jobs {
    let gate = gate.clone();
    let memory = Arc::new(InMemoryBackend::new());
    let open = move || {
        let gated = Gated { memory: Arc::clone(&memory), gate: gate.clone() };
        // No cache: whoever reads comes to the gate.
        redb::Builder::new().set_cache_size(0).create_with_backend(gated)
    };
    Jobs::open_with(open, Keep::default()).unwrap().0
}

/// What comes of it in time.
#[track_caller]
fn in_time<T>(done: &Receiver<T>, what: &str) -> T {
    done.recv_timeout(HANG).unwrap_or_else(|_| panic!("{what} waits for the other side"))
}

fn on_thread<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Receiver<T> {
    let (to, done): (Sender<T>, _) = channel();
    let thread = thread::Builder::new().name(name.to_owned());
    thread.spawn(move || drop(to.send(work()))).unwrap();
    done
}

fn order(link: &str) -> JobSpec {
    JobSpec::send(link, "O1", Data { digest: Digest::of(b"G1"), size: 100_000 })
}

fn with_jobs(gate: &Gate) -> (Jobs, JobId) {
    let jobs = open(gate);
    for _ in 0..200 {
        let id = jobs.submit(order("mill")).unwrap().id;
        jobs.abort(id).unwrap();
    }
    let id = jobs.submit(order("lathe")).unwrap().id;
    jobs.begin(id).unwrap();
    (jobs, id)
}

#[test]
fn whoever_reads_is_answered_while_a_change_stands_still_on_the_disk() {
    let gate = Gate::default();
    let (jobs, id) = with_jobs(&gate);
    gate.shut(|shut| shut.syncs = true);
    let writer = jobs.clone();
    let changed = on_thread("writer", move || writer.submit(order("mill")).map(|job| job.id));
    gate.wait();
    let reader = jobs.reader().clone();
    let read = on_thread("anybody", move || {
        let filter = JobFilter { most: 1_000, ..JobFilter::default() };
        let of_mill = JobFilter {
            link: Some("mill".to_owned()),
            state: Some(State::Aborted),
            before: Some(100),
            most: 7,
            ..JobFilter::default()
        };
        let page: Vec<_> = reader.list(&of_mill).unwrap().iter().map(|job| job.id).collect();
        let journal = EntryFilter { most: 10, ..EntryFilter::default() };
        let count = reader.journal(&journal).unwrap().len();
        (reader.list(&filter).unwrap().len(), page, reader.job(id).unwrap().state, count)
    });
    let expected = (201, (93..100).rev().map(JobId).collect(), State::Running, 10);
    assert_eq!(in_time(&read, "a list"), expected);
    // So does whoever only looks at what is under way.
    let looker = jobs.clone();
    let looked = on_thread("anybody", move || {
        (looker.live().len(), looker.next("lathe"), looker.queued().len(), looker.today("lathe"))
    });
    assert_eq!(in_time(&looked, "a look").0, 1);
    gate.shut(|shut| shut.syncs = false);
    in_time(&changed, "the change").unwrap();
}

#[test]
fn feeding_goes_on_while_whoever_reads_stands_still_on_the_disk() {
    let gate = Gate::default();
    let (jobs, id) = with_jobs(&gate);
    gate.shut(|shut| shut.reads = true);
    let reader = jobs.reader().clone();
    let all = JobFilter { most: 1_000, ..JobFilter::default() };
    let listed = on_thread("reader", move || reader.list(&all).map(|jobs| jobs.len()));
    gate.wait();
    let feeder = jobs.clone();
    let fed = on_thread("feeder", move || {
        let mut spans = Vec::new();
        for to in 1..=100 {
            let at = Instant::now();
            feeder.advance(&[Advance { id, grant: Some(to * 1_000), surely: None }]).unwrap();
            spans.push(at.elapsed());
        }
        feeder.end(id, Ending::Done, None).unwrap();
        spans.sort();
        println!("a grant: p50 {:?}, p99 {:?}", spans[50], spans[98]);
        feeder.submit(order("lathe")).unwrap().id
    });
    assert_eq!(in_time(&fed, "feeding"), id.next());
    gate.shut(|shut| shut.reads = false);
    // The state that it began with, whatever was written since.
    assert_eq!(in_time(&listed, "the list").unwrap(), 201);
}
