//! Requests of the plug-in, jobs and deliveries.

use crate::common::{Rig, rooms};
use crate::{assert_events, assert_given};
use softplug_abi::{
    Action, DeliveryId, Failure, JobId, MarkId, Micros, RequestId, Value, ValueWriter, Values,
};
use softplug_link::{Job, Observed, RuleBroken};

fn request(request: RequestId) -> Action<'static> {
    Action::Request { request, kind: 0, fields: Values::new(b"") }
}

#[test]
fn ask_answered() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[request(RequestId(1)), request(RequestId(2)), request(RequestId(3))]);
    rig.host(10, |link, out| link.answer(Micros(10), RequestId(2), Ok(&[b'x'; 1_200]), out));
    rig.host(20, |link, out| link.answer(Micros(20), RequestId(3), Err(Failure::NotFound), out));
    rig.host(30, |link, out| link.answer(Micros(30), RequestId(1), Ok(b""), out));
    // Once: the same again, or to what nobody asked, reaches nobody.
    rig.host(40, |link, out| link.answer(Micros(40), RequestId(1), Ok(b"x"), out));
    rig.host(50, |link, out| link.answer(Micros(50), RequestId(9), Ok(b"x"), out));
    assert_given!(
        rig,
        [
            (10, "answer 2 more=true 504 bytes"),
            (10, "answer 2 more=true 504 bytes"),
            (10, "answer 2 more=false 192 bytes"),
            (20, "answer 3 refused not-found more=false \"\""),
            (30, "answer 1 more=false 0 bytes"),
        ]
    );
    // Its id is free again, but not before.
    rig.does(60, &[request(RequestId(1))]);
    assert_eq!(rig.breaks(70, &[request(RequestId(1))]), RuleBroken::RequestTwice(RequestId(1)));

    // Its fields reach the host as they are, and are whole records in order.
    let mut buffer = [0; 64];
    let mut fields = ValueWriter::new(&mut buffer);
    fields.push(0, Value::Int(8_001)).unwrap();
    fields.push(2, Value::Text("O8001")).unwrap();
    let fields = fields.written().to_vec();
    let with =
        |fields| Action::Request { request: RequestId(4), kind: 3, fields: Values::new(fields) };
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[with(&fields)]);
    let seen = Observed::Request { request: RequestId(4), kind: 3, fields: fields.clone() };
    assert_eq!(rig.observed(), [(0, seen)]);
    let twice = [&fields[..14], &fields[..14]].concat();
    for wrong in [&fields[..fields.len() - 1], &twice] {
        let broken = Rig::new(rooms(64, 64), 1).breaks(0, &[with(wrong)]);
        assert_eq!(broken, RuleBroken::RequestFields(RequestId(4)));
    }
}

#[test]
fn ask_withdrawn() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(
        0,
        &[
            request(RequestId(1)),
            request(RequestId(2)),
            Action::SetTimer { id: 0, deadline: Micros(500) },
        ],
    );
    rig.script.once("timer 0", &[Action::Withdraw { request: RequestId(1) }]);
    // The answer comes when the plug-in's own deadline has just run out.
    rig.before(500);
    rig.line.link.answer(Micros(500), RequestId(1), Ok(b"late"), &mut rig.out).unwrap();
    rig.host(600, |link, out| link.answer(Micros(600), RequestId(1), Err(Failure::Denied), out));
    assert_given!(rig, [(500, "timer 0 set for 500")]);

    // Withdrawn between two pieces.
    rig.script.once("answer 2", &[Action::Withdraw { request: RequestId(2) }]);
    rig.host(700, |link, out| link.answer(Micros(700), RequestId(2), Ok(&[b'x'; 1_200]), out));
    assert_given!(rig, [(700, "answer 2 more=true 504 bytes")]);
    // Or by a timer that the first piece made due: timers go before further pieces.
    rig.does(710, &[request(RequestId(3))]);
    rig.script.once("answer 3", &[Action::SetTimer { id: 5, deadline: Micros(0) }]);
    rig.script.once("timer 5", &[Action::Withdraw { request: RequestId(3) }]);
    rig.host(720, |link, out| link.answer(Micros(720), RequestId(3), Ok(&[b'x'; 1_200]), out));
    assert_given!(rig, [(720, "answer 3 more=true 504 bytes"), (720, "timer 5 set for 0")]);
    // One that is not open is passed over.
    rig.does(
        800,
        &[Action::Withdraw { request: RequestId(2) }, Action::Withdraw { request: RequestId(77) }],
    );
}

#[test]
fn ids_one_each() {
    let rig = || {
        let mut rig = Rig::new(rooms(64, 64), 1);
        rig.begin(0, 5, b"data", false);
        let begin = Action::DeliveryBegin { delivery: DeliveryId(8), job: JobId(5) };
        rig.does(0, &[begin, Action::Deliver { delivery: DeliveryId(8), bytes: b"x" }]);
        rig.given();
        rig
    };
    let failure = Failure::Protocol;
    let no_job = RuleBroken::NoSuchJob(JobId(6));
    let other_job = [
        Action::Want { job: JobId(6), bytes: 1 },
        Action::JobDone { job: JobId(6), sent: 0 },
        Action::JobFailed { job: JobId(6), failure, status: 0, sent: 0 },
        Action::CheckResult { job: JobId(6), failure: None, status: 0, line: 0, column: 0 },
    ];
    for action in other_job {
        assert_eq!(rig().breaks(10, std::slice::from_ref(&action)), no_job, "{action:?}");
    }
    let no_delivery = RuleBroken::NoSuchDelivery(DeliveryId(9));
    let other_delivery = [
        Action::Deliver { delivery: DeliveryId(9), bytes: b"x" },
        Action::DeliveryName { delivery: DeliveryId(9), name: "O1" },
        Action::DeliveryEnd { delivery: DeliveryId(9), failure: None, status: 0 },
    ];
    for action in other_delivery {
        assert_eq!(rig().breaks(10, std::slice::from_ref(&action)), no_delivery, "{action:?}");
    }
    let second = Action::DeliveryBegin { delivery: DeliveryId(9), job: JobId::NONE };
    assert_eq!(rig().breaks(10, &[second]), RuleBroken::DeliveryUnderWay(DeliveryId(9)));
    let ended =
        [Action::JobDone { job: JobId(5), sent: 0 }, Action::Want { job: JobId(5), bytes: 1 }];
    assert_eq!(rig().breaks(10, &ended), RuleBroken::NoSuchJob(JobId(5)));

    // The plug-in hears nothing of a second job.
    let mut busy = rig();
    busy.begin(10, 6, b"other", false);
    assert_events!(busy, []);
    let refused = Observed::Failed { job: JobId(6), failure: Failure::Busy, status: 0, sent: 0 };
    assert_eq!(busy.observed(), [(10, refused)]);
    assert_eq!(busy.line.link.job(), Some(JobId(5)));

    // Nor of one that does not fit an event, nor of a request for one that has ended.
    busy.does(20, &[Action::JobDone { job: JobId(5), sent: 0 }]);
    let fields = vec![0; 500];
    let job = Job { id: JobId(7), kind: 0, size: None, fields, check: false };
    busy.host(30, |link, out| link.begin_job(Micros(30), job, out));
    busy.host(40, |link, out| link.abort(Micros(40), JobId(5), out));
    assert_events!(busy, []);
    let refused = Observed::Failed { job: JobId(7), failure: Failure::BadJob, status: 0, sent: 0 };
    assert_eq!(busy.observed().last().unwrap(), &(30, refused));
}

#[test]
fn ids_without_job() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    for delivery in [3, 1, 3] {
        rig.does(
            i64::from(delivery),
            &[
                Action::DeliveryBegin { delivery: DeliveryId(delivery), job: JobId::NONE },
                Action::Deliver { delivery: DeliveryId(delivery), bytes: b"%" },
                Action::DeliveryName { delivery: DeliveryId(delivery), name: "first" },
                Action::DeliveryName { delivery: DeliveryId(delivery), name: "O0001" },
                Action::DeliveryEnd { delivery: DeliveryId(delivery), failure: None, status: 0 },
            ],
        );
    }
    assert_eq!(rig.line.link.job(), None);
    let kept: Vec<_> =
        rig.out.deliveries().iter().map(|kept| (kept.id, kept.name.clone(), kept.job)).collect();
    let name = Some("O0001".to_owned());
    let named = |id| (DeliveryId(id), name.clone(), JobId::NONE);
    assert_eq!(kept, [named(3), named(1), named(3)]);

    // The host can ask for the end of one.
    rig.does(10, &[Action::DeliveryBegin { delivery: DeliveryId(4), job: JobId::NONE }]);
    let failure = Some(Failure::Aborted);
    rig.script
        .once("abort 0", &[Action::DeliveryEnd { delivery: DeliveryId(4), failure, status: 0 }]);
    rig.host(20, |link, out| link.abort(Micros(20), JobId::NONE, out));
    assert_eq!(rig.out.deliveries().last().unwrap().failure, failure);
}

#[test]
fn data_pulled() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    let want = |bytes| Action::Want { job: JobId(1), bytes };
    rig.begin(0, 1, b"abcdefghij", false);
    rig.until(1_000);
    assert_events!(rig, ["job-begin 1 run"]);
    rig.does(1_000, &[want(2)]);
    rig.until(2_000);
    assert_events!(rig, ["job-data 1 \"ab\""]);
    // What was asked for adds up; more than there is gives what there is.
    rig.does(2_000, &[want(1), want(2)]);
    assert_events!(rig, ["job-data 1 \"cde\""]);
    rig.does(3_000, &[want(5)]);
    rig.until(4_000);
    assert_events!(rig, ["job-data 1 \"fghij\""]);
    // The end answers what is asked beyond it, once.
    rig.does(4_000, &[want(1)]);
    assert_events!(rig, ["job-end 1"]);
    rig.does(5_000, &[want(1)]);
    assert_events!(rig, []);
    rig.does(6_000, &[Action::JobDone { job: JobId(1), sent: 0 }]);

    // More was asked for than there is: the end follows at once; what was asked
    // for ends with the job.
    rig.script.once("job-begin 2", &[Action::Want { job: JobId(2), bytes: u32::MAX }]);
    rig.script.once("job-begin 2", &[]);
    rig.begin(7_000, 2, b"xyz", false);
    assert_events!(rig, ["job-begin 2 run", "job-data 2 \"xyz\"", "job-end 2"]);
    rig.does(8_000, &[Action::JobDone { job: JobId(2), sent: 0 }]);
    rig.begin(9_000, 3, b"xyz", false);
    assert_events!(rig, ["job-begin 3 run"]);

    // One event holds what fits the input buffer.
    rig.does(9_500, &[Action::JobDone { job: JobId(3), sent: 0 }]);
    rig.script.once("job-begin 4", &[Action::Want { job: JobId(4), bytes: 600 }]);
    rig.begin(10_000, 4, &[b'x'; 700], false);
    let sizes: Vec<_> = rig.events().iter().map(|event| event.matches('x').count()).collect();
    assert_eq!(sizes, [0, 508, 92]);
}

#[test]
fn data_pause() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("job-begin", &[Action::Want { job: JobId(1), bytes: 2 }]);
    rig.begin(0, 1, b"abcdef", false);
    rig.does(0, &[Action::Transmit { mark: MarkId::NONE, bytes: b"ABCD" }]);
    rig.given();
    rig.host(500, |link, out| link.pause(Micros(500), JobId(1), out));
    rig.does(600, &[Action::Want { job: JobId(1), bytes: 2 }]);
    rig.host(2_500, |link, out| link.abort(Micros(2_500), JobId(1), out));
    rig.does(2_600, &[Action::Want { job: JobId(1), bytes: 2 }]);
    rig.host(2_700, |link, out| link.resume(Micros(2_700), JobId(1), out));
    rig.until(9_000);
    assert_given!(
        rig,
        [
            (500, "pause 1"),
            (600, "job-data 1 \"cd\""),
            (2_500, "abort 1"),
            (2_600, "job-data 1 \"ef\""),
            (2_700, "resume 1"),
            (3_000, "transmit-room 4"),
        ]
    );
    assert_eq!(rig.wire(), [(0, b'A'), (1_000, b'B'), (2_000, b'C'), (3_000, b'D')]);
    assert_eq!(rig.line.link.job(), Some(JobId(1)));
    // Only the plug-in ends it.
    rig.does(
        9_500,
        &[Action::JobFailed { job: JobId(1), failure: Failure::Aborted, status: 0, sent: 4 }],
    );
    let failed = Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent: 4 };
    assert_eq!(rig.observed(), [(9_500, failed)]);
}

#[test]
fn check_sequence() {
    let good = Action::CheckResult { job: JobId(1), failure: None, status: 0, line: 0, column: 0 };
    let want = Action::Want { job: JobId(1), bytes: 100 };
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("job-begin 1", std::slice::from_ref(&want));
    rig.script.once("job-end 1", std::slice::from_ref(&good));
    rig.script.once(
        "job-end 1",
        &[
            Action::Transmit { mark: MarkId::NONE, bytes: b"A" },
            Action::JobDone { job: JobId(1), sent: 1 },
        ],
    );
    rig.begin(0, 1, b"abc", true);
    assert_events!(
        rig,
        [
            "job-begin 1 check",
            "job-data 1 \"abc\"",
            "job-end 1",
            "job-begin 1 run",
            "job-data 1 \"abc\"",
            "job-end 1",
            "transmit-room 1",
        ]
    );
    assert_eq!(rig.wire(), [(0, b'A')]);

    // A bad result, given before the data's end, ends the job.
    let failure = Some(Failure::UnsupportedCharacter);
    let bad = Action::CheckResult { job: JobId(2), failure, status: 9, line: 3, column: 4 };
    rig.script.on("job-begin 2", &[Action::Want { job: JobId(2), bytes: 1 }]);
    rig.script.once("job-data 2", &[bad]);
    rig.begin(5_000, 2, b"abc", true);
    rig.until(9_000);
    assert_events!(rig, ["job-begin 2 check", "job-data 2 \"a\""]);
    assert_eq!(rig.wire().len(), 1);
    let checked = Observed::Checked { job: JobId(2), failure, status: 9, line: 3, column: 4 };
    assert_eq!(rig.observed().last().unwrap(), &(5_000, checked));
    assert_eq!(rig.line.link.job(), None);

    // Without a check the data comes once; and a result belongs into a check.
    rig.script.on("job-begin 3", &[Action::Want { job: JobId(3), bytes: 9 }]);
    rig.begin(10_000, 3, b"abc", false);
    assert_events!(rig, ["job-begin 3 run", "job-data 3 \"abc\"", "job-end 3"]);
    let result =
        Action::CheckResult { job: JobId(3), failure: None, status: 0, line: 0, column: 0 };
    assert_eq!(rig.breaks(11_000, &[result]), RuleBroken::NotChecked(JobId(3)));

    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.begin(0, 1, b"abc", true);
    assert_eq!(
        rig.breaks(10, &[Action::JobDone { job: JobId(1), sent: 3 }]),
        RuleBroken::OnlyChecked(JobId(1))
    );
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.begin(0, 1, b"abc", true);
    assert_eq!(rig.breaks(10, &[good.clone(), good]), RuleBroken::NotChecked(JobId(1)));
    // An abort during the check is answered by a failure.
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.begin(0, 1, b"abc", true);
    rig.does(
        10,
        &[Action::JobFailed { job: JobId(1), failure: Failure::Aborted, status: 0, sent: 0 }],
    );
    assert_eq!(rig.line.link.job(), None);
}
