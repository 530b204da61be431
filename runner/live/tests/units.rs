//! What a unit says that is not so: one is played here, over loopback.

use std::io::{Read, Write};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use mio::net::TcpListener;
use mio::{Events, Interest, Poll, Token};
use softplug_abi::{DeliveryId, Failure, JobId, LinkDownReason, Micros, RequestId};
use softplug_link::Job;
use softplug_live::clock::Clock;
use softplug_live::reactor::{Backoff, Feed, JobEnd, JobOutcome, LaneId, Report};
use softplug_live::reservoir::{Drawn, reservoir};
use softplug_live::units::{
    StoredDelivery, TlsKeys, TlsPrivateKey, UnitAddress, UnitClient, UnitClientError, UnitCommand,
    UnitPlace, UnitPlugin, UnitSetup, Units,
};
use softplug_unit_protocol::{
    Encoded, Identity, Messages, Outcome, Role, Session, SlotState, ToServer, ToUnit,
};
use softplug_unit_uplink::{Outbox, TcpUplink, Uplink};

const PATIENCE: Duration = Duration::from_mins(1);
const LANE: LaneId = LaneId(1);
const DIGEST: [u8; 32] = [7; 32];

/// A unit that answers each message as it is told to.
type Answers = fn(&ToUnit<'_>, &mut Outbox);

fn play<const TAKES: usize>(mut listener: TcpListener, answers: Answers) -> JoinHandle<()> {
    thread::spawn(move || {
        let clock = Clock::start();
        let mut poll = Poll::new().unwrap();
        let both = Interest::READABLE | Interest::WRITABLE;
        poll.registry().register(&mut listener, Token(0), Interest::READABLE).unwrap();
        let mut events = Events::with_capacity(4);
        let mut wait = |poll: &mut Poll, patience| poll.poll(&mut events, Some(patience)).unwrap();
        wait(&mut poll, PATIENCE);
        let (stream, _) = listener.accept().expect("somebody comes");
        let mut uplink = Uplink::Tcp(TcpUplink::new(stream));
        poll.registry().register(&mut uplink, Token(1), both).unwrap();
        let mut session = Box::new(Session::<16, TAKES>::new(Role::Unit, Identity(2)));
        let mut outbox = Outbox::default();
        loop {
            let frame = match uplink.receive() {
                Ok(frame) => frame.map(<[u8]>::to_vec),
                Err(_) => return,
            };
            if let Some(frame) = frame {
                if let Ok(Some(payload)) = session.receive(clock.now(), &frame) {
                    for message in Messages::<ToUnit<'_>>::new(payload) {
                        answers(&message.unwrap(), &mut outbox);
                    }
                }
                continue;
            }
            let now = clock.now();
            session.handle_timeout(now);
            if uplink.speak(&mut session, &mut outbox, now).is_err() {
                return;
            }
            let due = session
                .poll_timeout()
                .map_or(PATIENCE, |at| Duration::from_micros((at - now).0.max(0) as u64));
            wait(&mut poll, due);
        }
    })
}

/// What every unit says of itself.
fn honest(message: &ToUnit<'_>, outbox: &mut Outbox, name: &str) {
    let link = 0;
    if let ToUnit::Query {} = message {
        outbox.push(&ToServer::Unit { links: 1, serial: 1, name: "played" }, false);
        for slot in [0, 1] {
            let (state, length, digest) = (SlotState::Confirmed, 4, DIGEST);
            let (erased, erasable) = (1, 10);
            let told = ToServer::Slot { link, slot, state, length, digest, erased, erasable };
            outbox.push(&told, false);
        }
    }
    if let ToUnit::Query {} | ToUnit::Open { .. } = message {
        let (job, pass, received, is_whole) = (0, 0, 0, false);
        let (is_up, digest) = (true, DIGEST);
        let told = ToServer::Link { link, is_up, digest, job, pass, received, is_whole, name };
        outbox.push(&told, false);
        outbox.push(&ToServer::Up { link }, false);
        outbox.push(&ToServer::Told { link }, false);
    }
}

fn ended(job: u64, outcome: Outcome, count: u64) -> ToServer<'static> {
    ToServer::Ended {
        link: 0,
        job,
        outcome,
        failure: None,
        status: 0,
        line: 0,
        column: 0,
        taken: count,
        sent: count,
        maybe_left: count,
        surely_left: count,
        bytes_maybe_left: count,
        bytes_surely_left: count,
        why: "",
    }
}

struct Played {
    units: Option<Units>,
    reports: Receiver<(LaneId, Report)>,
    thread: Option<JoinHandle<()>>,
    unit: UnitPlace,
}

/// A unit at which nobody is yet, and its thread.
fn listening<const TAKES: usize>(answers: Answers) -> (UnitPlace, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let port = listener.local_addr().unwrap().port();
    (UnitPlace::Tcp { host: "127.0.0.1".into(), port }, play::<TAKES>(listener, answers))
}

fn plugin(module: &[u8]) -> UnitPlugin {
    UnitPlugin { module: module.into(), digest: DIGEST, signature: None, settings: Vec::new() }
}

impl Played {
    fn with(answers: Answers) -> Self {
        Self::that_takes::<1024>(b"wasm", answers)
    }

    fn that_takes<const TAKES: usize>(module: &[u8], answers: Answers) -> Self {
        Self::that_knows::<TAKES>(module, None, answers)
    }

    fn that_knows<const TAKES: usize>(
        module: &[u8],
        stored: Option<StoredDelivery>,
        answers: Answers,
    ) -> Self {
        let (unit, thread) = listening::<TAKES>(answers);
        let thread = Some(thread);
        let (tell, reports) = channel();
        let units = Units::start(1, move |lane, report| {
            let _ = tell.send((lane, report));
        })
        .unwrap();
        let played = Self { units: Some(units), reports, thread, unit };
        played.add(LANE, module, stored);
        played
    }

    /// Drives its link, with another lane than the one that does if there is one.
    fn add(&self, lane: LaneId, module: &[u8], stored: Option<StoredDelivery>) {
        let address = UnitAddress { unit: self.unit.clone(), link: Some("mill".into()) };
        let plugin = plugin(module);
        let reopen = Backoff { first: Micros::from_millis(50), longest: Micros::from_secs(1) };
        let (delivery_room, bus, tls) = (4_096, None, None);
        let setup = UnitSetup { address, plugin, delivery_room, stored, reopen, bus, tls };
        self.units.as_ref().unwrap().add(lane, setup);
    }

    fn until<T>(&self, find: impl Fn(&Report) -> Option<T>) -> T {
        loop {
            let (_, report) = self.reports.recv_timeout(PATIENCE).expect("it is told");
            if let Some(found) = find(&report) {
                return found;
            }
        }
    }

    /// Sends 2,000 bytes.
    fn job(&self) -> JobEnd {
        self.until(|report| matches!(report, Report::Up).then_some(()));
        let (mut writer, source) = reservoir(4_096, 0, 4_096);
        writer.write(&[b'G'; 2_000]);
        writer.finish();
        let job =
            Job { id: JobId(1), kind: 0, size: Some(2_000), fields: Vec::new(), check: false };
        self.units.as_ref().unwrap().tell(LANE, UnitCommand::Begin(Feed { job, source }));
        self.until(|report| match report {
            Report::JobEnded(end) => Some(end.clone()),
            _ => None,
        })
    }
}

impl Drop for Played {
    fn drop(&mut self) {
        self.units = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[test]
fn a_job_that_was_never_fed_is_not_done() {
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        if let ToUnit::Begin { job, .. } = message {
            outbox.push(&ended(*job, Outcome::Done, 2_000), false);
        }
    });
    let end = played.job();
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Internal, status: 0 });
    assert_eq!((end.taken, end.bytes_maybe_left, end.bytes_surely_left), (0, 0, 0));
}

#[test]
fn a_job_that_was_fed_in_part_is_not_done_and_counts_are_what_was_sent_at_most() {
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        match message {
            ToUnit::Begin { job, .. } => {
                let (link, job, pass, received, until) = (0, *job, 0, 0, 500);
                outbox.push(&ToServer::Credit { link, job, pass, received, until }, false);
            }
            ToUnit::Data { job, .. } => outbox.push(&ended(*job, Outcome::Done, u64::MAX), false),
            _ => {}
        }
    });
    let end = played.job();
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Internal, status: 0 });
    assert_eq!((end.taken, end.bytes_maybe_left), (500, 500));
}

#[test]
fn a_unit_that_forgets_what_it_confirmed_gets_no_more_and_is_told_to_abort() {
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        let (link, pass) = (0, 0);
        let mut credit = |job, received, until| {
            outbox.push(&ToServer::Credit { link, job, pass, received, until }, false);
        };
        match *message {
            ToUnit::Begin { job, .. } => credit(job, 0, 500),
            ToUnit::Data { job, .. } => {
                credit(job, 500, 600);
                credit(job, 5, 700);
            }
            ToUnit::Abort { job, .. } => outbox.push(&ended(job, Outcome::Failed, 500), false),
            _ => {}
        }
    });
    assert!(matches!(played.job().outcome, JobOutcome::Failed { .. }));
}

#[test]
fn a_link_that_the_unit_does_not_have_is_told_with_those_that_it_has() {
    let played = Played::with(|message, outbox| honest(message, outbox, "lathe\n2026 ERROR fire"));
    let detail = played.until(|report| match report {
        Report::Down { detail, .. } => Some(detail.clone()),
        _ => None,
    });
    assert!(detail.contains("no link \"mill\"; it has lathe\\n2026"), "{detail}");
}

#[test]
fn a_unit_that_sends_more_than_it_may_is_sent_away() {
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        if let ToUnit::Open { .. } = message {
            for delivery in 1..100 {
                let (link, job, at, name) = (0, 0, 0, "x");
                outbox.push(&ToServer::Delivery { link, delivery, job, at, name }, false);
            }
        }
    });
    let detail = played.until(|report| match report {
        Report::Down { detail, .. } => Some(detail.clone()),
        _ => None,
    });
    assert!(detail.contains("the unit at 127.0.0.1"), "{detail}");
}

/// A unit that says a delivery three times, as one does that has not heard that it is stored; then
/// another one, and no more.
fn says_again(message: &ToUnit<'_>, outbox: &mut Outbox, stored: &AtomicU32) {
    honest(message, outbox, "mill");
    let delivery = match message {
        ToUnit::Query {} => 1,
        ToUnit::Stored { delivery, until: 3, is_whole: true, .. } => {
            match (*delivery, stored.fetch_add(1, Ordering::SeqCst)) {
                (1, 0 | 1) => 1,
                (1, _) => 2,
                _ => return,
            }
        }
        _ => return,
    };
    let (link, size) = (0, 3);
    outbox.push(&ToServer::Delivery { link, delivery, job: 0, at: 0, name: "" }, false);
    outbox.push(&ToServer::Delivered { link, delivery, at: 0, bytes: b"O77" }, false);
    outbox.push(&ToServer::DeliveryEnded { link, delivery, failure: None, status: 0, size }, false);
}

/// What is reported of deliveries, each put away, up to the end of the second one.
fn kept(played: &Played) -> Vec<(DeliveryId, String)> {
    let (mut readers, mut kept) = (Vec::new(), Vec::new());
    while kept.last().is_none_or(|(id, _)| *id != DeliveryId(2)) {
        match played.reports.recv_timeout(PATIENCE).expect("it is told").1 {
            Report::DeliveryBegun { delivery, unit, bytes, .. } => {
                assert_eq!(unit, Some(2));
                readers.push((delivery, bytes));
            }
            Report::DeliveryEnded { delivery, failure: None, bytes: 3, .. } => {
                let (_, mut reader) = readers.pop().expect("it has begun");
                let mut buffer = [0; 8];
                assert_eq!(reader.read(&mut buffer), Drawn::Bytes(3));
                kept.push((delivery, String::from_utf8_lossy(&buffer[..3]).into_owned()));
            }
            _ => {}
        }
    }
    kept
}

#[test]
fn a_delivery_that_is_said_again_is_kept_once() {
    static STORED: AtomicU32 = AtomicU32::new(0);
    let played = Played::with(|message, outbox| says_again(message, outbox, &STORED));
    let both = [1, 2].map(|number| (DeliveryId(number), "O77".to_owned()));
    assert_eq!(kept(&played), both);
    assert_eq!(STORED.load(Ordering::SeqCst), 3);
}

#[test]
fn a_delivery_that_the_gateway_before_has_stored_is_not_kept() {
    static STORED: AtomicU32 = AtomicU32::new(0);
    static OTHER: AtomicU32 = AtomicU32::new(2);
    let stored = StoredDelivery { unit: 2, delivery: DeliveryId(1) };
    let answers: Answers = |message, outbox| says_again(message, outbox, &STORED);
    let played = Played::that_knows::<1024>(b"wasm", Some(stored), answers);
    assert_eq!(kept(&played), [(DeliveryId(2), "O77".to_owned())]);
    // Of another unit it says nothing: its numbers are others.
    let stored = StoredDelivery { unit: 3, delivery: DeliveryId(9) };
    let answers: Answers = |message, outbox| says_again(message, outbox, &OTHER);
    let played = Played::that_knows::<1024>(b"wasm", Some(stored), answers);
    assert_eq!(kept(&played).len(), 2);
}

/// As one that comes when its link is called otherwise.
#[test]
fn a_lane_that_comes_to_a_session_knows_whose_deliveries_it_takes() {
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        if let ToUnit::Query {} = message {
            let (link, delivery, job, at, name) = (0, 1, 0, 0, "");
            outbox.push(&ToServer::Delivery { link, delivery, job, at, name }, false);
        }
    });
    let whose = |report: &Report| match report {
        Report::DeliveryBegun { unit, .. } => Some(*unit),
        _ => None,
    };
    assert_eq!(played.until(whose), Some(2));
    played.add(LaneId(2), b"wasm", None);
    assert_eq!(played.until(whose), Some(2));
}

/// A unit whose machine asks for something, and that asks again when it is answered, as one does that
/// has not heard the answer.
#[test]
fn a_request_that_is_said_again_gets_the_answer_that_it_got() {
    static ANSWERS: AtomicU32 = AtomicU32::new(0);
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        let asks = match message {
            ToUnit::Query {} => true,
            ToUnit::Answer { request: 7, refused: None, is_last: true, bytes: b"O77", .. } => {
                ANSWERS.fetch_add(1, Ordering::SeqCst) < 2
            }
            _ => return,
        };
        let (link, request, kind, fields) = (0, if asks { 7 } else { 8 }, 0, &[][..]);
        outbox.push(&ToServer::Request { link, request, kind, fields }, false);
    });
    let asked = || {
        played.until(|report| match report {
            Report::Request { request, .. } => Some(*request),
            _ => None,
        })
    };
    assert_eq!(asked(), RequestId(7));
    let answer = UnitCommand::Answer { request: RequestId(7), answer: Ok(b"O77".to_vec()) };
    played.units.as_ref().unwrap().tell(LANE, answer);
    assert_eq!(asked(), RequestId(8));
    assert_eq!(ANSWERS.load(Ordering::SeqCst), 3);
}

#[test]
fn a_unit_whose_port_comes_and_goes_without_end_is_sent_away() {
    let played = Played::with(|message, outbox| {
        honest(message, outbox, "mill");
        if let ToUnit::Open { .. } = message {
            for _ in 0..100 {
                outbox.push(&ToServer::Up { link: 0 }, false);
                let (reason, retry_in, detail) = (LinkDownReason::Failed, 0, "gone");
                outbox.push(&ToServer::Down { link: 0, reason, retry_in, detail }, false);
            }
        }
    });
    let (mut told, is_sent_away) = (0, |detail: &str| detail.contains("the unit at 127.0.0.1"));
    loop {
        let down = played.until(|report| match report {
            Report::Down { detail, .. } => Some(detail.clone()),
            _ => None,
        });
        if is_sent_away(&down) {
            break;
        }
        told += 1;
    }
    assert!(told < 20, "{told}");
}

/// A module whose bytes show their place.
fn module() -> Vec<u8> {
    (0..3_000_usize).map(|at| (at % 251) as u8).collect()
}

/// A unit without a plug-in, which takes this module and a job.
fn empty(message: &ToUnit<'_>, outbox: &mut Outbox) {
    let link = 0;
    let mut is_link_told = false;
    match *message {
        ToUnit::Query {} => {
            outbox.push(&ToServer::Unit { links: 1, serial: 1, name: "played" }, false);
            for slot in [0, 1] {
                let (state, length, digest) = (SlotState::Empty, 0, [0; 32]);
                let (erased, erasable) = (1, 10);
                let told = ToServer::Slot { link, slot, state, length, digest, erased, erasable };
                outbox.push(&told, false);
            }
            is_link_told = true;
        }
        ToUnit::Download { .. } => outbox.push(&ToServer::Downloaded { link, until: 0 }, false),
        ToUnit::Piece { at, bytes, .. } => {
            assert_eq!(Some(bytes), module().get(at as usize..at as usize + bytes.len()));
            let until = at + bytes.len() as u32;
            outbox.push(&ToServer::Downloaded { link, until }, false);
        }
        ToUnit::Install { .. } => outbox.push(&ToServer::Installed { link, slot: 0 }, false),
        ToUnit::Open { .. } => is_link_told = true,
        ToUnit::Begin { job, .. } => {
            let (pass, received, until) = (0, 0, 4_000);
            outbox.push(&ToServer::Credit { link, job, pass, received, until }, false);
        }
        ToUnit::End { job, size, .. } => outbox.push(&ended(job, Outcome::Done, size), false),
        _ => {}
    }
    if is_link_told {
        let is_up = matches!(message, ToUnit::Open { .. });
        let digest = if is_up { DIGEST } else { [0; 32] };
        let (job, pass, received, is_whole, name) = (0, 0, 0, false, "mill");
        let told = ToServer::Link { link, is_up, digest, job, pass, received, is_whole, name };
        outbox.push(&told, false);
        if is_up {
            outbox.push(&ToServer::Up { link }, false);
        }
        outbox.push(&ToServer::Told { link }, false);
    }
}

#[test]
fn a_unit_that_takes_short_frames_is_given_its_plug_in_and_its_job() {
    let module = module();
    for played in [
        Played::that_takes::<128>(&module, empty),
        Played::that_takes::<512>(&module, empty),
        Played::that_takes::<1024>(&module, empty),
    ] {
        let end = played.job();
        assert_eq!((end.outcome, end.taken), (JobOutcome::Done, 2_000));
    }
}

#[test]
fn a_unit_that_takes_short_frames_is_given_a_plug_in_by_hand() {
    let (unit, thread) = listening::<512>(empty);
    let mut client = UnitClient::connect(&unit, None, 1, PATIENCE / 2).unwrap();
    let mut last = 0;
    assert!(client.flash(None, &plugin(&module()), |until| last = until).unwrap());
    assert_eq!(last, 3_000);
    drop(client);
    thread.join().unwrap();
}

#[test]
fn settings_that_are_longer_than_a_unit_takes_are_told() {
    let (unit, thread) = listening::<128>(empty);
    let mut client = UnitClient::connect(&unit, None, 1, PATIENCE / 2).unwrap();
    let settings = vec![("title".to_owned(), "x".repeat(100))];
    let plugin = UnitPlugin { settings, ..plugin(&module()) };
    let refused = client.flash(None, &plugin, |_| {}).unwrap_err().to_string();
    assert!(refused.contains("its settings have 107 bytes; 64 are the most"), "{refused}");
    drop(client);
    thread.join().unwrap();
}

/// Somebody who says this to each who comes, and hears them to their end; a link with TLS that leads there, and
/// what it is told as down for.
fn down_with_tls(says: &'static [u8]) -> (UnitPlace, TlsKeys, String) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let unit = listener.local_addr().unwrap().to_string().parse::<UnitPlace>().unwrap();
    thread::spawn(move || {
        for stream in listener.incoming() {
            thread::spawn(move || {
                let mut stream = stream.unwrap();
                let _ = stream.write_all(says);
                let _ = stream.read_to_end(&mut Vec::new());
            });
        }
    });
    let folder = tempfile::tempdir().unwrap();
    let [own, other] =
        ["a", "b"].map(|name| TlsPrivateKey::make(&folder.path().join(name)).unwrap());
    let keys = TlsKeys::of_gateway(&own, &[other.public()]);
    let (tell, reports) = channel();
    let units = Units::start(1, move |_, report| {
        let _ = tell.send(report);
    })
    .unwrap();
    let (address, tls) = (UnitAddress { unit: unit.clone(), link: None }, Some(keys.clone()));
    let reopen = Backoff { first: Micros::from_secs(60), longest: Micros::from_secs(60) };
    let (plugin, delivery_room) = (plugin(b"wasm"), 4_096);
    units.add(
        LANE,
        UnitSetup { address, tls, plugin, delivery_room, stored: None, reopen, bus: None },
    );
    loop {
        if let Report::Down { detail, .. } = reports.recv_timeout(PATIENCE).expect("it is told") {
            return (unit, keys, detail);
        }
    }
}

#[test]
fn who_does_not_answer_in_the_handshake_of_tls_is_left() {
    let (unit, keys, detail) = down_with_tls(b"");
    assert!(detail.contains("the handshake of TLS has not come to an end in time"), "{detail}");
    let error = UnitClient::connect(&unit, Some(&keys), 1, Duration::from_secs(1)).unwrap_err();
    assert!(matches!(error, UnitClientError::Closed { .. }), "{error}");
}

#[test]
fn who_answers_the_handshake_of_tls_with_something_else_is_told_so() {
    let (unit, keys, detail) = down_with_tls(b"\x01\x02\x00\x00\x00\x00\x00\x00\x00\x00");
    assert!(detail.contains("the other side speaks without TLS"), "{detail}");
    let error = UnitClient::connect(&unit, Some(&keys), 1, PATIENCE).unwrap_err();
    assert!(error.to_string().contains("the other side speaks without TLS"), "{error}");
}

#[test]
fn names_that_would_steer_a_terminal_are_made_plain() {
    let (unit, thread) = listening::<1024>(|message, outbox| {
        honest(message, outbox, "mi\u{1b}[2J\u{9b}\r\u{202e}\u{2066}ll");
    });
    let mut client = UnitClient::connect(&unit, None, 1, PATIENCE / 2).unwrap();
    let survey = client.survey().unwrap();
    assert_eq!(survey.links[0].name, "mi\\u{1b}[2J\\u{9b}\\r\\u{202e}\\u{2066}ll");
    let refused = client.flash(Some("mill"), &plugin(&module()), |_| {}).unwrap_err().to_string();
    assert!(refused.ends_with(&survey.links[0].name), "{refused}");
    drop(client);
    thread.join().unwrap();
}

#[test]
fn a_download_that_goes_no_further_ends() {
    let (unit, thread) = listening::<1024>(|message, outbox| match message {
        ToUnit::Piece { link, .. } => {
            outbox.push(&ToServer::Downloaded { link: *link, until: 0 }, false);
        }
        message => empty(message, outbox),
    });
    let mut client = UnitClient::connect(&unit, None, 1, PATIENCE / 2).unwrap();
    let mut told = 0;
    let error = client.flash(None, &plugin(&module()), |_| told += 1).unwrap_err();
    assert!(matches!(error, UnitClientError::Stuck { .. }), "{error}");
    assert_eq!(told, 17);
    drop(client);
    thread.join().unwrap();
}

#[test]
fn an_answer_that_is_no_message_is_the_units_fault() {
    let (unit, thread) = listening::<1024>(|message, outbox| {
        if let ToUnit::Query {} = message {
            outbox.push(&Encoded(&[200, 0, 0]), false);
        }
    });
    let mut client = UnitClient::connect(&unit, None, 1, PATIENCE / 2).unwrap();
    let error = client.survey().unwrap_err();
    assert!(matches!(error, UnitClientError::NoMessage { .. }), "{error}");
    drop(client);
    thread.join().unwrap();
}

#[test]
fn a_plug_in_that_ends_at_once_does_not_pass_for_one_that_runs() {
    let (unit, thread) = listening::<1024>(|message, outbox| match message {
        ToUnit::Open { link, digest, .. } => {
            let (link, digest) = (*link, *digest);
            let (job, pass, received, is_whole, name) = (0, 0, 0, false, "mill");
            let is_up = false;
            let told = ToServer::Link { link, is_up, digest, job, pass, received, is_whole, name };
            outbox.push(&told, false);
            outbox.push(&ToServer::Fault { link, what: "it\u{1b}[2J trapped" }, false);
        }
        message => empty(message, outbox),
    });
    let mut client = UnitClient::connect(&unit, None, 1, PATIENCE / 2).unwrap();
    let error = client.flash(None, &plugin(&module()), |_| {}).unwrap_err();
    assert!(matches!(error, UnitClientError::NotRun { .. }), "{error}");
    assert!(error.to_string().ends_with("by a fault: it\\u{1b}[2J trapped"), "{error}");
    drop(client);
    thread.join().unwrap();
}

#[test]
fn a_gateways_download_that_goes_no_further_is_told() {
    let played = Played::that_takes::<1024>(&module(), |message, outbox| match message {
        ToUnit::Piece { link, .. } => {
            outbox.push(&ToServer::Downloaded { link: *link, until: 0 }, false);
        }
        message => empty(message, outbox),
    });
    let detail = played.until(|report| match report {
        Report::Down { detail, .. } => Some(detail.clone()),
        _ => None,
    });
    assert!(detail.contains("goes no further"), "{detail}");
}
