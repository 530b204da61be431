//! Another plug-in takes over.

use crate::assert_events;
use crate::common::{Plugin, Rig, Script, rooms};
use softplug_abi::limits::STATE_BYTES;
use softplug_abi::{
    Action, DeliveryId, Failure, JobId, MarkId, Micros, ModemLines, NoteLevel, RequestId, Values,
};
use softplug_link::{
    Link, LinkFault, LinkHost, LinkOptions, Observed, Recorder, RuleBroken, Supply, SwapError,
};

pub(super) fn saved(offset: u32, total: u32, bytes: &[u8]) -> Action<'_> {
    Action::Saved { format: 1, offset, total, bytes }
}

pub(super) fn swap(
    rig: &mut Rig,
    at: i64,
    next: &Script,
) -> Result<Plugin, SwapError<crate::common::Refused>> {
    rig.line.link.swap(Micros(at), next.plugin(), &mut rig.out)
}

#[test]
fn swap_quiet() {
    let script = Script::default();
    script.once(
        "open",
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"A" },
            Action::SetTimer { id: 1, deadline: Micros(1_000) },
        ],
    );
    script.once_more("save", &[saved(0, 6, b"ABC")]);
    script.once("continue", &[saved(3, 6, b"DEF")]);
    let (mut out, mut link) = (Recorder::default(), Link::new(script.plugin(), rooms(64, 64)));
    link.open(Micros::ZERO, &mut out).unwrap();
    link.take(&mut [0; 1]);
    link.handle_timeout(Micros::ZERO, &mut out).unwrap();
    script.take();

    // All of this instant is pending when the swap is asked for.
    let next = Script::default();
    link.left(1, 1);
    link.swap(Micros(1_000), next.plugin(), &mut out).unwrap();
    let old: Vec<_> = script.take().into_iter().map(|(_, event)| event).collect();
    assert_eq!(
        old,
        ["mark 1 maybe-left", "mark 1 surely-left", "timer 1 set for 1000", "save", "continue"]
    );
    let new: Vec<_> = next.take().into_iter().map(|(_, event)| event).collect();
    let opened = "open resumed transmit=64 delivery=64";
    assert_eq!(new, ["settings first=true last=true", "restore 1 0+6/6", opened]);
}

/// Has the job's data only from some moment on.
#[derive(Debug, Default)]
struct Slow {
    recorder: Recorder,
    has_data: bool,
}

impl LinkHost for Slow {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        self.recorder.handle(now, action);
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        if self.has_data { self.recorder.supply(job, buffer) } else { Supply::Later }
    }
}

#[test]
fn swap_link_keeps() {
    let (cts, dtr) = (ModemLines::CTS, ModemLines::DTR);
    let script = Script::default();
    script.on("save", &[saved(0, 0, b"")]);
    script.once(
        "job-begin",
        &[
            Action::Want { job: JobId(1), bytes: 3 },
            Action::DeliveryBegin { delivery: DeliveryId(4), job: JobId(1) },
            Action::Deliver { delivery: DeliveryId(4), bytes: b"old" },
            Action::Transmit { mark: MarkId(1), bytes: b"ABCDEF" },
            Action::Request { request: RequestId(7), kind: 0, fields: Values::new(b"") },
            Action::ModemLines { mask: dtr, on: dtr },
        ],
    );
    script.once("received", &[Action::Hold]);
    let options = LinkOptions { modem_lines: Some((cts, cts)), ..rooms(16, 16) };
    let mut out = Slow::default();
    let mut link = Link::new(script.plugin(), options);
    link.open(Micros::ZERO, &mut out).unwrap();
    out.recorder.add_source(JobId(1), b"xyz".to_vec());
    let job =
        softplug_link::Job { id: JobId(1), kind: 0, size: None, fields: Vec::new(), check: false };
    link.begin_job(Micros::ZERO, job, &mut out).unwrap();
    // One byte is with the port, five wait and are held; no room was told.
    link.take(&mut [0; 1]);
    link.received(Micros(10), b"S", &mut out).unwrap();
    link.modem_lines(Micros(20), cts, ModemLines::default(), &mut out).unwrap();

    let next = Script::default();
    link.swap(Micros(30), next.plugin(), &mut out).unwrap();
    script.take();
    let told = |script: &Script| -> Vec<String> {
        script.take().into_iter().map(|(_, event)| event).collect()
    };
    assert_eq!(
        told(&next),
        [
            "settings first=true last=true",
            "restore 1 0+0/0",
            // 16 less the five that wait; nothing of the delivery was put away.
            "open resumed transmit=11 delivery=13",
            "modem-lines known=1 on=0",
        ]
    );
    // Held, and the queue is there.
    assert_eq!((link.waiting(), link.take(&mut [0; 8])), (5, softplug_link::Taken::Nothing));
    assert_eq!(link.job(), Some(JobId(1)));
    // The request, the open `want`, the mark.
    link.answer(Micros(40), RequestId(7), Err(Failure::Denied), &mut out).unwrap();
    out.has_data = true;
    next.once(
        "received",
        &[
            Action::Release,
            Action::Deliver { delivery: DeliveryId(4), bytes: b"new" },
            Action::DeliveryEnd { delivery: DeliveryId(4), failure: None, status: 0 },
            // Exactly the room that it was told.
            Action::Transmit { mark: MarkId::NONE, bytes: &[b'x'; 11] },
        ],
    );
    link.received(Micros(50), b"Q", &mut out).unwrap();
    link.handle_timeout(Micros(50), &mut out).unwrap();
    let mut buffer = [0; 5];
    assert_eq!(link.take(&mut buffer), softplug_link::Taken::Bytes(5));
    assert_eq!(&buffer, b"BCDEF");
    link.left(6, 6);
    next.once("mark 1 surely-left", &[Action::JobDone { job: JobId(1), sent: 6 }]);
    link.handle_timeout(Micros(60), &mut out).unwrap();
    let told = told(&next);
    let wanted = [
        "answer 7 refused denied more=false \"\"",
        "received \"Q\"",
        "job-data 1 \"xyz\"",
        "mark 1 maybe-left",
        "mark 1 surely-left",
    ];
    let others: Vec<_> = told.iter().filter(|event| !event.contains("room")).collect();
    assert_eq!(others, wanted);
    assert_eq!(out.recorder.deliveries()[0].bytes, b"oldnew");
    assert_eq!(
        out.recorder.observed.last().unwrap(),
        &(Micros(60), Observed::Done { job: JobId(1), sent: 6 })
    );
}

#[test]
fn swap_timers() {
    let timer = |id, deadline| Action::SetTimer { id, deadline: Micros(deadline) };
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("save", &[saved(0, 0, b"")]);
    rig.does(0, &[timer(1, 2_000), timer(2, 5_000)]);
    rig.until(1_000);
    let next = Script::default();
    next.once("open resumed", &[timer(3, 500), timer(2, 4_000)]);
    swap(&mut rig, 1_000, &next).unwrap();
    next.take().drain(..3).for_each(drop);
    rig.until(9_000);
    let expected = [(4_000, "timer 2 set for 4000")];
    assert_eq!(next.take(), expected.map(|(at, event)| (at, event.to_owned())));
    assert_events!(rig, ["save"]);

    // One that has passed in between fires at once.
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("save", &[saved(0, 0, b"")]);
    let next = Script::default();
    next.once("open resumed", &[timer(3, 500)]);
    swap(&mut rig, 1_000, &next).unwrap();
    assert_eq!(next.take().last().unwrap(), &(1_000, "timer 3 set for 500".to_owned()));
}

type Seen = (Micros, Observed);

/// What is seen of a small story, and what the plug-in was given in it; with a
/// save at every instant or without.
fn story(saves: bool) -> (Vec<Seen>, Vec<(i64, String)>) {
    let mut rig = Rig::new(rooms(8, 8), 2);
    rig.out.drain_by_hand = true;
    rig.script.on_more("save", &[saved(0, 4, b"AB")]);
    rig.script.on("continue", &[saved(2, 4, b"CD")]);
    rig.script.on("job-begin", &[Action::Want { job: JobId(1), bytes: 2 }]);
    rig.script.on("timer 1", &[Action::Release, Action::Want { job: JobId(1), bytes: 3 }]);
    rig.begin(0, 1, b"abcdef", false);
    rig.does(
        100,
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"ABCDE" },
            Action::Transmit { mark: MarkId(2), bytes: b"FG" },
            Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE },
            Action::Deliver { delivery: DeliveryId(1), bytes: b"1234" },
            Action::SetTimer { id: 1, deadline: Micros(3_000) },
            Action::Request { request: RequestId(1), kind: 0, fields: Values::new(b"") },
        ],
    );
    for at in (200..12_000).step_by(100) {
        rig.until(at);
        match at {
            1_200 => rig
                .does(at, &[Action::Hold, Action::TransmitUrgent { mark: MarkId(3), bytes: b"U" }]),
            2_000 => {
                rig.out.drain(3);
                rig.tick(at);
            }
            5_000 => rig.does(at, &[Action::Discard]),
            6_000 => {
                rig.host(at, |link, out| link.answer(Micros(at), RequestId(1), Ok(b"yes"), out));
            }
            _ => {}
        }
        if saves {
            let state = rig.line.link.save(Micros(at), &mut rig.out).unwrap().unwrap();
            assert_eq!(state.bytes, b"ABCD");
        }
    }
    rig.does(12_000, &[Action::DeliveryEnd { delivery: DeliveryId(1), failure: None, status: 0 }]);
    let mut given = rig.given();
    given.retain(|(_, event)| event != "save" && event != "continue");
    (rig.out.observed, given)
}

#[test]
fn swap_save_changes_nothing() {
    let without = story(false);
    assert_eq!(without.0.len(), 10, "{:?}", without.0);
    assert_eq!(story(true), without);
}

#[test]
fn swap_pieces() {
    let save = |pieces: &[Action<'_>]| {
        let script = Script::default();
        script.on("save", pieces);
        let mut rig = Rig::with(script, rooms(64, 64), 1);
        rig.line.link.save(Micros(10), &mut rig.out)
    };
    let whole = |pieces: &[Action<'_>]| save(pieces).unwrap().unwrap().bytes;
    assert_eq!(whole(&[saved(0, 5, b"AB"), saved(2, 5, b"CDE")]), b"ABCDE");
    assert_eq!(whole(&[saved(0, 0, b"")]), b"");
    let note = Action::Note { level: NoteLevel::Debug, code: 0, text: "saving" };
    assert_eq!(whole(&[note, saved(0, 1, b"A"), Action::State { name: "idle" }]), b"A");
    assert_eq!(save(&[]).unwrap(), None);
    let largest = vec![b'x'; 60_000];
    let script = Script::default();
    script.once_raw("save", &{
        let mut bytes = Vec::new();
        for (offset, length) in [(0, 60_000), (60_000, STATE_BYTES - 60_000)] {
            bytes.extend(22_u16.to_le_bytes());
            bytes.extend((12 + length as u16).to_le_bytes());
            bytes.extend([1, 0, 0, 0]);
            bytes.extend((offset as u32).to_le_bytes());
            bytes.extend(STATE_BYTES.to_le_bytes());
            bytes.extend(&largest[..length as usize]);
        }
        bytes
    });
    let mut rig = Rig::with(script, rooms(64, 64), 1);
    let state = rig.line.link.save(Micros(10), &mut rig.out).unwrap().unwrap();
    assert_eq!(state.bytes.len(), 65_536);

    let format = |format, offset| Action::Saved { format, offset, total: 4, bytes: b"AB" };
    let wrong: [&[Action<'_>]; 9] = [
        &[saved(1, 5, b"AB")],                       // does not begin at 0
        &[saved(0, 5, b"AB"), saved(3, 5, b"DE")],   // a gap
        &[saved(0, 5, b"AB"), saved(1, 5, b"BCDE")], // an overlap
        &[saved(0, 5, b"AB")],                       // not all
        &[saved(0, 4, b"AB"), saved(2, 5, b"CDE")],  // another total
        &[format(1, 0), format(2, 2)],               // another format
        &[saved(0, 2, b"AB"), saved(2, 2, b"")],     // more than all
        &[saved(0, 0, b""), saved(0, 0, b"")],       // an empty state twice
        &[saved(0, 2, b"AB"), saved(0, 2, b"AB")],   // twice
    ];
    for pieces in wrong {
        let fault = save(pieces).unwrap_err();
        let source = RuleBroken::StatePieces;
        assert!(
            matches!(fault, LinkFault::Rule { source: broken, .. } if broken == source),
            "{pieces:?}"
        );
    }
    let over = save(&[saved(0, STATE_BYTES + 1, b"AB")]).unwrap_err();
    assert!(matches!(over, LinkFault::Malformed { .. }));
    let acts = save(&[saved(0, 1, b"A"), Action::Hold]).unwrap_err();
    assert!(matches!(acts, LinkFault::Rule { source: RuleBroken::ActedOnState, .. }));
    let unasked = Rig::new(rooms(64, 64), 1).breaks(0, &[saved(0, 0, b"")]);
    assert_eq!(unasked, RuleBroken::StateUnasked);

    // The other way: cut to what an event holds.
    let script = Script::default();
    let state = vec![b's'; 1_300];
    script.on("save", &[saved(0, 1_300, &state)]);
    let mut rig = Rig::with(script, rooms(64, 64), 1);
    let next = Script::default();
    swap(&mut rig, 10, &next).unwrap();
    let restored: Vec<_> = next.take().into_iter().map(|(_, event)| event).collect();
    let expected = ["restore 1 0+500/1300", "restore 1 500+500/1300", "restore 1 1000+300/1300"];
    assert_eq!(restored[1..4], expected);
}
