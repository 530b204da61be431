//! A link whose plug-in fails, or computes for long, is driven on a thread for such
//! links from then on, with all that belongs to it.

#![cfg(target_os = "linux")]

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::load::{Fragile, Load};
use softplug_abi::limits::FUEL_PER_EVENT;
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{Event, Instance, JobId, Micros, Output};
use softplug_link::Job;
use softplug_live::ReadOutcome;
use softplug_live::endpoint::{EndpointSetup, ServerEndpoint};
use softplug_live::pty::PtyPair;
use softplug_live::reactor::{Command, Condition, Feed, JobOutcome, LaneEndpoint, LaneId};
use softplug_live::reservoir::reservoir;
use softplug_native::{NativeInstance, NativePlugin};

/// So long that only something lost makes a test wait for it.
const PATIENCE: Duration = Duration::from_secs(30);
const ASIDE: &str = "softplug-aside";
const ORDINARY: &str = "softplug-io-0";

/// Names of the threads that have run an instance.
type Threads = Arc<Mutex<BTreeSet<String>>>;

/// XON/XOFF that notes where it runs, and says that it computes for so long.
struct Noted {
    inner: NativeInstance,
    threads: Threads,
    fuel_per_event: u64,
    fuel: u64,
}

impl Noted {
    fn new(threads: &Threads, fuel_per_event: u64) -> Fragile<Self> {
        Fragile::sound(Self::unbroken(threads, fuel_per_event))
    }

    fn unbroken(threads: &Threads, fuel_per_event: u64) -> Self {
        let inner = NativePlugin::XonXoff.instantiate();
        Self { inner, threads: Arc::clone(threads), fuel_per_event, fuel: 0 }
    }
}

impl Instance for Noted {
    type Fault = <NativeInstance as Instance>::Fault;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault> {
        self.fuel += self.fuel_per_event;
        let name = thread::current().name().unwrap_or_default().to_owned();
        self.threads.lock().unwrap().insert(name);
        self.inner.step(event, now)
    }

    fn total_fuel(&self) -> u64 {
        self.fuel
    }
}

fn settings() -> SettingValues {
    let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes()).unwrap();
    manifest.resolve_settings([]).unwrap()
}

/// A link with an endpoint and a client at it.
struct Line {
    lane: LaneId,
    machine: PtyPair,
    client: TcpStream,
}

impl Line {
    fn add(load: &mut Load<Noted>, instance: Fragile<Noted>) -> Self {
        let endpoint = ServerEndpoint::new(EndpointSetup::new("127.0.0.1:0".parse().unwrap()));
        let address = endpoint.address().unwrap();
        let (lane, machine) = load.add_with(115_200, instance, settings(), |setup| {
            setup.endpoint = Some(LaneEndpoint {
                endpoint: Box::new(endpoint),
                job_kind: 0,
                fields: Vec::new(),
                check: false,
            });
        });
        load.wait_until_up();
        let client = connect(address);
        Self { lane, machine, client }
    }

    /// What the machine sends comes to the client.
    fn says(&mut self, text: &[u8]) {
        assert_eq!(self.machine.write(text).unwrap(), text.len());
        let mut heard = vec![0; text.len()];
        self.client.read_exact(&mut heard).unwrap();
        assert_eq!(heard, text);
    }

    /// What the client sends comes to the machine.
    fn is_told(&mut self, text: &[u8]) {
        self.client.write_all(text).unwrap();
        self.hears(text);
    }

    /// The client has said all, and is sent away when all of it has left.
    fn client_goes(&mut self) -> SocketAddr {
        let address = self.client.peer_addr().unwrap();
        self.client.shutdown(Shutdown::Write).unwrap();
        assert_eq!(self.client.read(&mut [0; 1]).unwrap(), 0);
        address
    }

    fn hears(&self, text: &[u8]) {
        let (mut heard, end) = (Vec::<u8>::new(), Instant::now() + PATIENCE);
        let mut buffer = [0; 256];
        while heard.len() < text.len() {
            assert!(Instant::now() < end, "only {heard:?} came");
            match self.machine.read(&mut buffer).unwrap() {
                ReadOutcome::Read(count) => heard.extend(&buffer[..count]),
                _ => thread::sleep(Duration::from_millis(1)),
            }
        }
        assert_eq!(heard, text);
    }
}

fn connect(address: SocketAddr) -> TcpStream {
    let client = TcpStream::connect(address).unwrap();
    client.set_read_timeout(Some(PATIENCE)).unwrap();
    client
}

fn names(threads: &Threads) -> Vec<String> {
    threads.lock().unwrap().iter().cloned().collect()
}

#[test]
fn a_link_whose_plugin_has_failed_goes_on_elsewhere_with_port_client_and_jobs() {
    let (of_failed, of_next, of_neighbour) =
        (Threads::default(), Threads::default(), Threads::default());
    let mut load = Load::new(settings(), 0, || unreachable!("made below"));
    // After its opening, at what the machine sends.
    let fragile = Fragile::new(Noted::unbroken(&of_failed, 0), Some(2));
    let mut line = Line::add(&mut load, fragile);
    let mut neighbour = Line::add(&mut load, Noted::new(&of_neighbour, 0));
    // Once it hears a client, the link has it.
    neighbour.is_told(b"before");
    neighbour.says(b"before");
    assert_eq!(line.machine.write(b"x").unwrap(), 1);
    load.until(line.lane, |figures| figures.condition == Condition::Faulted);
    load.replace(line.lane, Noted::new(&of_next, 0), settings());
    load.until(line.lane, |figures| figures.restarts == 1);

    // The port and the client are the same.
    line.says(b"after");
    line.is_told(b"to the machine");
    neighbour.says(b"meanwhile");

    // The listener, too.
    line.client = connect(line.client_goes());
    line.is_told(b"somebody else");
    line.says(b"again");
    line.client_goes();

    // A job whose data comes late wakes the link there.
    let (mut writer, source) = reservoir(64, 0, 64);
    let job = Job { id: JobId(1), kind: 0, size: None, fields: Vec::new(), check: false };
    load.reactor.tell(line.lane, Command::Begin(Feed { job, source }));
    load.until(line.lane, |figures| figures.job == 1);
    assert_eq!(writer.write(b"late"), 4);
    line.hears(b"late");
    writer.finish();
    let lane = line.lane;
    load.attend(|lanes| lanes[&lane].job.is_some());
    assert_eq!(load.lanes[&lane].job, Some(JobOutcome::Done));

    assert_eq!(names(&of_failed), [ORDINARY]);
    assert_eq!(names(&of_next), [ASIDE]);
    assert_eq!(names(&of_neighbour), [ORDINARY]);

    let status = load.reactor.status(lane).unwrap();
    load.reactor.remove(lane);
    let end = Instant::now() + PATIENCE;
    while status.condition() != Condition::Removed {
        assert!(Instant::now() < end, "it was not removed");
        thread::sleep(Duration::from_millis(1));
    }
    neighbour.says(b"and on");
}

#[test]
fn a_plugin_that_computes_for_long_has_no_neighbours() {
    let (of_slow, of_quick) = (Threads::default(), Threads::default());
    let mut load = Load::new(settings(), 0, || unreachable!("made below"));
    let mut slow = Line::add(&mut load, Noted::new(&of_slow, FUEL_PER_EVENT / 2));
    let mut quick = Line::add(&mut load, Noted::new(&of_quick, FUEL_PER_EVENT / 10));
    // Once it hears a client, the link has it.
    slow.is_told(b"slow");
    quick.is_told(b"quick");
    for _ in 0..5 {
        slow.says(b"slow");
        quick.says(b"quick");
    }
    slow.is_told(b"still here");
    assert_eq!(names(&of_slow), [ASIDE, ORDINARY]);
    assert_eq!(names(&of_quick), [ORDINARY]);
}
