//! What an instance was given shows the same end when it is given again.

use crate::common::{Plugin, Refused, Script, rooms};
use softplug_abi::{
    Action, DeliveryId, Event, EventKind, Instance, JobId, MarkId, Micros, Output, RequestId,
    Values,
};
use softplug_link::{Job, Link, LinkFault, Recorder, Rerun, UnderWay};

/// Keeps what it is given.
#[derive(Debug)]
struct Logged {
    inner: Plugin,
    log: Vec<(Micros, EventKind, Vec<u8>)>,
}

impl Instance for Logged {
    type Fault = Refused;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Refused> {
        let mut payload = [0; 512];
        let length = event.encode(&mut payload).expect("it fits");
        self.log.push((now, event.kind(), payload[..length].to_vec()));
        self.inner.step(event, now)
    }
}

fn transmit(mark: MarkId) -> Action<'static> {
    Action::Transmit { mark, bytes: b"ABCDEFGH" }
}

fn request(request: RequestId) -> Action<'static> {
    Action::Request { request, kind: 0, fields: Values::new(b"") }
}

fn urgent() -> Action<'static> {
    Action::TransmitUrgent { mark: MarkId::NONE, bytes: b"0123456789" }
}

/// A story in which the plug-in is told of rooms, marks, timers, a job, answers.
/// On the byte X it does `last`.
fn tell(script: &Script, last: &[Action<'_>]) {
    script.once(
        "job-begin",
        &[
            Action::Want { job: JobId(1), bytes: 4 },
            transmit(MarkId(1)),
            Action::DeliveryBegin { delivery: DeliveryId(5), job: JobId::NONE },
            Action::Deliver { delivery: DeliveryId(5), bytes: b"12345678" },
            request(RequestId(1)),
            request(RequestId(2)),
            Action::SetTimer { id: 3, deadline: Micros(40) },
        ],
    );
    script.once(
        "timer 3",
        &[Action::TransmitUrgent { mark: MarkId(2), bytes: b"urgent" }, request(RequestId(3))],
    );
    script.once("answer 1", &[transmit(MarkId(3)), Action::Discard]);
    script.on("save", &[Action::Saved { format: 1, offset: 0, total: 1, bytes: b"s" }]);
    script.once("received \"X\"", last);
}

/// What an instance was given: when, which event, its payload.
type Given = Vec<(Micros, EventKind, Vec<u8>)>;

fn play(script: &Script) -> (LinkFault<Refused>, Given) {
    let mut out = Recorder::default();
    out.drain_by_hand = true;
    let logged = Logged { inner: script.plugin(), log: Vec::new() };
    let mut link = Link::new(logged, rooms(20, 20));
    link.open(Micros::ZERO, &mut out).unwrap();
    out.add_source(JobId(1), b"data".to_vec());
    let job = Job { id: JobId(1), kind: 0, size: None, fields: Vec::new(), check: false };
    link.begin_job(Micros(10), job, &mut out).unwrap();
    link.take(&mut [0; 8]);
    link.left(8, 8);
    link.handle_timeout(Micros(20), &mut out).unwrap();
    link.handle_timeout(Micros(50), &mut out).unwrap();
    link.take(&mut [0; 8]);
    link.answer(Micros(60), RequestId(1), Ok(b"yes"), &mut out).unwrap();
    link.save(Micros(65), &mut out).unwrap();
    let fault = link.received(Micros(70), b"X", &mut out).unwrap_err();
    (fault, link.instance().log.clone())
}

#[test]
fn every_end_comes_again() {
    let too_much = [b'x'; 21];
    let many = [request(RequestId(4)), request(RequestId(5)), request(RequestId(6))];
    let ends: [&[Action<'_>]; 11] = [
        &[Action::Transmit { mark: MarkId::NONE, bytes: &too_much }],
        // Eight bytes of the twenty are not put away yet.
        &[Action::Deliver { delivery: DeliveryId(5), bytes: &too_much[..13] }],
        &many,
        &[request(RequestId(2))],
        &[Action::Want { job: JobId(2), bytes: 1 }],
        &[Action::JobDone { job: JobId(1), sent: 0 }, Action::Want { job: JobId(1), bytes: 1 }],
        &[Action::DeliveryBegin { delivery: DeliveryId(6), job: JobId::NONE }],
        &[Action::DeliveryEnd { delivery: DeliveryId(6), failure: None, status: 0 }],
        &[Action::CheckResult { job: JobId(1), failure: None, status: 0, line: 0, column: 0 }],
        &[Action::Saved { format: 1, offset: 0, total: 0, bytes: b"" }],
        &[urgent(), urgent()],
    ];
    for last in ends {
        let script = Script::default();
        tell(&script, last);
        let (fault, log) = play(&script);
        let again = Script::default();
        tell(&again, last);
        let mut rerun = Rerun::new(again.plugin(), &UnderWay::default());
        let mut out = Recorder::default();
        let mut end = None;
        for (at, kind, payload) in &log {
            assert!(end.is_none(), "{fault}: it ended before {kind} at {at}");
            let event = Event::decode(*kind, payload).expect("it was encoded");
            end = rerun.give(*at, &event, &mut out).err();
        }
        let end = end.unwrap_or_else(|| panic!("it does not end with: {fault}"));
        assert_eq!(end.to_string(), fault.to_string());
        assert_eq!(script.take(), again.take());
    }
}

#[test]
fn what_was_under_way_is_known() {
    let script = Script::default();
    tell(&script, &[request(RequestId(2))]);
    let (fault, log) = play(&script);
    // From the answer on, with what stood on the link then.
    let from = log.iter().position(|(_, kind, _)| *kind == EventKind::Answer).expect("answered");
    let open =
        Event::Open { resumed: true, line: rooms(0, 0).line, transmit_room: 40, delivery_room: 12 };
    for (marks, ends) in [(2, "request 2"), (63, "more than 64 marks")] {
        let under_way = UnderWay {
            job: Some((JobId(1), softplug_abi::Pass::Run)),
            delivery: Some(DeliveryId(5)),
            requests: vec![RequestId(1), RequestId(2), RequestId(3)],
            marks,
        };
        let again = Script::default();
        again.once("answer 1", &[transmit(MarkId(3)), Action::Discard]);
        let last = [
            transmit(MarkId(4)),
            transmit(MarkId(5)),
            Action::Want { job: JobId(1), bytes: 1 },
            request(RequestId(2)),
        ];
        again.once("received \"X\"", &last[if marks == 2 { 2 } else { 0 }..]);
        let mut rerun = Rerun::new(again.plugin(), &under_way);
        let mut out = Recorder::default();
        rerun.give(Micros(55), &open, &mut out).unwrap();
        let mut end = None;
        for (at, kind, payload) in &log[from..] {
            let event = Event::decode(*kind, payload).expect("it was encoded");
            end = rerun.give(*at, &event, &mut out).err();
        }
        let end = end.expect("it ends").to_string();
        assert!(end.contains(ends), "{end}, where {fault}");
    }
}
