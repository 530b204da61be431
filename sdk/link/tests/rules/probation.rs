//! A successor that fails, before it is in place, on probation and after it; and
//! one that begins as new.

use super::swap::{saved, swap};
use crate::assert_given;
use crate::common::{Plugin, Rig, Script, rooms};
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, EventKind, Failure, JobId, MarkId, Micros, ModemLines};
use softplug_link::{LinkFault, LinkOptions, Observed, Spare, Successor, SwapError};

#[test]
fn swap_probation() {
    // Up to its first action the old one simply goes on.
    let hold = [Action::Hold];
    let another_job = [Action::State { name: "resumed" }, Action::Want { job: JobId(2), bytes: 1 }];
    let prepare: [&dyn Fn(&Script); 8] = [
        &|next| next.once("open", &another_job),
        &|next| next.refuse("settings"),
        &|next| next.refuse("restore"),
        &|next| next.refuse("open"),
        &|next| next.once_raw("open", &[3, 0, 0, 0, 99, 0]),
        &|next| next.once_raw("restore", &[99, 0, 0, 0]),
        &|next| next.once("settings", &hold),
        &|next| next.on_more("restore", &[]),
    ];
    for (case, fails) in prepare.iter().enumerate() {
        let mut rig = Rig::new(rooms(64, 64), 1);
        rig.script.on("save", &[saved(0, 2, b"AB")]);
        rig.begin(0, 1, b"data", false);
        rig.does(
            0,
            &[
                Action::Transmit { mark: MarkId(1), bytes: b"ABC" },
                Action::SetTimer { id: 1, deadline: Micros(2_000) },
            ],
        );
        rig.given();
        let next = Script::default();
        fails(&next);
        next.on_more("continue", &[]);
        let error = swap(&mut rig, 500, &next).unwrap_err();
        assert!(!matches!(error, SwapError::Failed(_)), "case {case}: {error}");
        rig.until(3_000);
        assert_given!(
            rig,
            [
                (500, "save"),
                (2_000, "timer 1 set for 2000"),
                (2_000, "transmit-room 3"),
                (3_000, "mark 1 maybe-left"),
                (3_000, "mark 1 surely-left"),
            ]
        );
        assert_eq!(rig.wire().len(), 3);
        assert_eq!((rig.line.link.job(), rig.observed().len()), (Some(JobId(1)), 0), "case {case}");
    }
    // One that saves nothing is not replaced.
    let mut rig = Rig::new(rooms(64, 64), 1);
    let next = Script::default();
    assert!(matches!(swap(&mut rig, 10, &next), Err(SwapError::NoState)));
    assert_eq!(next.take(), []);

    // A format that its manifest does not list is not tried.
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("save", &[saved(0, 0, b"")]);
    let next = Script::default();
    let other = Successor { accepts: vec![2, 3], ..successor(&next, None) };
    let refused = rig.line.link.swap_to(Micros(10), other, &mut rig.out);
    assert!(matches!(refused, Err(SwapError::Format { format: 1 })));
    assert_eq!(next.take(), []);

    // Without probation a later fault ends the job.
    let failed =
        Observed::Failed { job: JobId(1), failure: Failure::Interrupted, status: 0, sent: 0 };
    let lines = (ModemLines::CTS, ModemLines::CTS);
    let options = LinkOptions { modem_lines: Some(lines), ..rooms(64, 64) };
    let mut rig = Rig::new(options, 1);
    rig.script.on("save", &[saved(0, 0, b"")]);
    rig.begin(0, 1, b"data", false);
    let next = Script::default();
    next.once("open", &[Action::State { name: "resumed" }]);
    next.refuse("modem-lines");
    let error = swap(&mut rig, 10, &next).unwrap_err();
    assert!(matches!(error, SwapError::Failed(LinkFault::Instance { .. })));
    assert_eq!(
        rig.observed(),
        [(10, Observed::State("resumed".to_owned())), (10, failed.clone()),]
    );
    assert!(rig.line.link.has_ended());

    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("save", &[saved(0, 0, b"")]);
    rig.begin(0, 1, b"data", false);
    rig.does(0, &[Action::Transmit { mark: MarkId::NONE, bytes: b"ABC" }]);
    let next = Script::default();
    next.refuse("received");
    swap(&mut rig, 10, &next).unwrap();
    rig.receive(20, &[b"x"]).unwrap_err();
    assert_eq!(rig.observed(), [(20, failed.clone())]);
    // Nothing more is sent.
    rig.until(9_000);
    assert_eq!(rig.wire(), [(0, b'A')]);

    // On probation the one before goes on with the last state and that event.
    let (mut rig, spare) = on_probation(1);
    rig.does(20, &[]);
    rig.receive(30, &[b"x"]).unwrap();
    let told: Vec<_> = spare.take();
    assert_eq!(
        told,
        [
            (30, "settings first=true last=true".to_owned()),
            // As it was after the cue.
            (30, "restore 1 0+2/2".to_owned()),
            (30, "open resumed transmit=62 delivery=64".to_owned()),
            (30, "received \"x\"".to_owned()),
        ]
    );
    let reverted = rig.line.link.take_reverted().expect("it was reverted");
    assert_eq!((reverted.at, reverted.event), (Micros(30), EventKind::Received));
    assert!(rig.line.link.take_reverted().is_none());
    assert_eq!((rig.line.link.job(), rig.observed()), (Some(JobId(1)), Vec::new()));
    rig.until(9_000);
    assert_eq!(rig.wire().len(), 3);

    // One that does not accept the format, or does not take the state: interrupted.
    let (mut rig, spare) = on_probation(2);
    rig.receive(20, &[b"x"]).unwrap_err();
    assert_eq!((rig.observed(), spare.take()), (vec![(20, failed.clone())], Vec::new()));
    let (mut rig, spare) = on_probation(1);
    spare.refuse("restore");
    rig.receive(20, &[b"x"]).unwrap_err();
    assert_eq!(rig.observed(), [(20, failed)]);

    // Kept: no way back, and nothing is saved any more.
    let (mut rig, spare) = on_probation(1);
    assert_eq!(rig.line.link.on_probation(), Some(0));
    rig.does(15, &[]);
    assert_eq!(rig.line.link.on_probation(), Some(1));
    rig.line.link.keep();
    assert_eq!(rig.line.link.on_probation(), None);
    rig.given();
    rig.does(18, &[]);
    rig.receive(20, &[b"x"]).unwrap_err();
    assert_eq!(spare.take(), []);
}

/// A link with a job and three bytes to send, whose successor refuses the byte x;
/// the spare accepts states of that format.
fn on_probation(accepted: u16) -> (Rig, Script) {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.on("save", &[saved(0, 0, b"")]);
    rig.begin(0, 1, b"data", false);
    rig.does(0, &[Action::Transmit { mark: MarkId::NONE, bytes: b"ABC" }]);
    let (next, spare) = (Script::default(), Script::default());
    next.on("save", &[saved(0, 2, b"NX")]);
    next.refuse("received \"x\"");
    let successor = successor(&next, Some((&spare, accepted)));
    rig.line.link.swap_to(Micros(10), successor, &mut rig.out).unwrap();
    rig.script = next;
    rig.script.take();
    (rig, spare)
}

#[test]
fn another_begins_as_new_after_a_fault() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.begin(0, 1, b"data", false);
    rig.does(
        0,
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"ABC" },
            Action::Hold,
            Action::SetTimer { id: 1, deadline: Micros(900) },
        ],
    );
    rig.script.refuse("received \"x\"");
    rig.receive(20, &[b"x"]).unwrap_err();
    let next = Script::default();
    let settings = SettingValues::default();
    rig.line.link.replace(Micros(500), next.plugin(), settings.clone(), &mut rig.out).unwrap();
    rig.until(2_000);
    // No timer, no mark, all the room; the three bytes are gone.
    let opened = "open new transmit=64 delivery=64";
    let told: Vec<_> = next.take().into_iter().map(|(_, event)| event).collect();
    assert_eq!(told, ["settings first=true last=true", opened]);
    assert_eq!((rig.line.link.job(), rig.wire().len(), rig.line.link.is_idle()), (None, 0, true));
    rig.script = next;
    rig.does(2_500, &[Action::Transmit { mark: MarkId(1), bytes: b"N" }]);
    rig.until(9_000);
    assert_eq!(rig.wire(), [(2_500, b'N')]);

    // A port that is gone is told of, and an idle one that runs is closed.
    let gone = softplug_abi::LinkDownReason::Unplugged;
    rig.line.link.link_down(Micros(9_500), gone, &mut rig.out).unwrap();
    rig.given();
    let third = Script::default();
    rig.line.link.replace(Micros(9_600), third.plugin(), settings, &mut rig.out).unwrap();
    assert_eq!(rig.events(), ["close"]);
    let told: Vec<_> = third.take().into_iter().map(|(_, event)| event).collect();
    assert_eq!(told, ["settings first=true last=true", opened, "link-down unplugged"]);
}

fn successor(next: &Script, spare: Option<(&Script, u16)>) -> Successor<Plugin> {
    let settings = SettingValues::default();
    let spare = spare
        .map(|(script, accepted)| Spare { instance: script.plugin(), accepts: vec![accepted] });
    Successor { instance: next.plugin(), settings, accepts: vec![1], spare }
}
