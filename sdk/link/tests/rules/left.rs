//! When a marked byte is reported to have left.

use crate::common::{Rig, Script, rooms, unknown_rate};
use crate::{assert_events, assert_given};
use softplug_abi::{Action, MarkId, Micros};
use softplug_link::{Link, Recorder, Taken};

/// A link alone, for a port whose progress is known only roughly.
fn bare(actions: &[Action<'_>]) -> (Link<crate::common::Plugin>, Script, Recorder) {
    let script = Script::default();
    script.once("open", actions);
    let mut out = Recorder::default();
    let mut link = Link::new(script.plugin(), rooms(64, 64));
    link.open(Micros::ZERO, &mut out).unwrap();
    script.take();
    (link, script, out)
}

fn told(script: &Script) -> Vec<String> {
    script.take().into_iter().map(|(_, event)| event).collect()
}

#[test]
fn left_maybe_never_late() {
    let mut rig = Rig::new(rooms(64, 64), 4);
    rig.does(
        0,
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"A" },
            Action::Transmit { mark: MarkId(2), bytes: b"BCD" },
        ],
    );
    rig.until(5_000);
    assert_given!(
        rig,
        [
            (0, "transmit-room 4"),
            (1_000, "mark 1 maybe-left"),
            (1_000, "mark 1 surely-left"),
            (4_000, "mark 2 maybe-left"),
            (4_000, "mark 2 surely-left"),
        ]
    );

    // As soon as it can have left, though it is not certain.
    let (mut link, script, mut out) = bare(&[Action::Transmit { mark: MarkId(3), bytes: b"AB" }]);
    assert_eq!(link.take(&mut [0; 2]), Taken::Bytes(2));
    link.left(1, 0);
    link.handle_timeout(Micros(500), &mut out).unwrap();
    link.left(2, 1);
    link.handle_timeout(Micros(501), &mut out).unwrap();
    let expected = [(500, "transmit-room 2"), (501, "mark 3 maybe-left")];
    assert_eq!(script.take(), expected.map(|(at, event)| (at, event.to_owned())));
}

#[test]
fn left_surely_never_early() {
    let transmit = [
        Action::Transmit { mark: MarkId(1), bytes: b"AB" },
        Action::Transmit { mark: MarkId(2), bytes: b"C" },
    ];
    let (mut link, script, mut out) = bare(&transmit);
    // What the port was not given cannot have left.
    link.left(3, 3);
    link.handle_timeout(Micros(1), &mut out).unwrap();
    assert_eq!(told(&script), Vec::<String>::new());

    assert_eq!(link.take(&mut [0; 8]), Taken::Bytes(3));
    let steps = [
        (2, 0, vec!["transmit-room 3", "mark 1 maybe-left"]),
        (3, 1, vec!["mark 2 maybe-left"]),
        (3, 2, vec!["mark 1 surely-left"]),
        // An older count takes nothing back, and nothing is told twice.
        (1, 1, vec![]),
        (3, 2, vec![]),
        (3, 3, vec!["mark 2 surely-left"]),
        (3, 3, vec![]),
    ];
    for (at, (maybe, surely, mut expected)) in steps.into_iter().enumerate() {
        link.left(maybe, surely);
        link.handle_timeout(Micros(10 + at as i64), &mut out).unwrap();
        let mut told = told(&script);
        told.sort();
        expected.sort_unstable();
        assert_eq!(told, expected, "after {maybe} maybe and {surely} surely");
    }
}

#[test]
fn left_before_later_bytes() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[Action::Transmit { mark: MarkId(1), bytes: b"A" }]);
    rig.given();
    rig.receive(1_001, &[b"x"]).unwrap();
    assert_given!(
        rig,
        [(1_000, "mark 1 maybe-left"), (1_000, "mark 1 surely-left"), (1_001, "received \"x\""),]
    );

    // Also where nobody ran the link in between.
    let (mut link, script, mut out) = bare(&[Action::Transmit { mark: MarkId(1), bytes: b"A" }]);
    link.take(&mut [0; 1]);
    link.handle_timeout(Micros(0), &mut out).unwrap();
    script.take();
    link.left(1, 1);
    link.received(Micros(2_000), b"x", &mut out).unwrap();
    assert_eq!(told(&script), ["mark 1 maybe-left", "mark 1 surely-left", "received \"x\""]);
}

#[test]
fn left_unknown_rate() {
    let mut rig = Rig::new(unknown_rate(), 4);
    rig.does(700, &[Action::Hold, Action::Transmit { mark: MarkId(1), bytes: b"ABCDEFGH" }]);
    rig.until(800);
    assert_events!(rig, []);
    rig.does(900, &[Action::Release]);
    rig.until(5_000);
    let marks: Vec<_> = rig.given();
    let marks: Vec<_> = marks.into_iter().filter(|(_, event)| event.starts_with("mark")).collect();
    let expected = [(900, "mark 1 maybe-left"), (900, "mark 1 surely-left")];
    assert_eq!(marks, expected.map(|(at, event)| (at, event.to_owned())));
}

#[test]
fn left_empty_transmit() {
    let empty = |mark| Action::Transmit { mark, bytes: b"" };
    let mut rig = Rig::new(rooms(4, 64), 2);
    // On the last byte of the queue.
    rig.does(0, &[Action::Transmit { mark: MarkId::NONE, bytes: b"ABC" }, empty(MarkId(1))]);
    rig.until(2_500);
    rig.given();
    rig.until(3_000);
    assert_given!(rig, [(3_000, "mark 1 maybe-left"), (3_000, "mark 1 surely-left")]);

    // Nothing is queued and all has left: at once.
    rig.does(5_000, &[empty(MarkId(2))]);
    assert_given!(rig, [(5_000, "mark 2 maybe-left"), (5_000, "mark 2 surely-left")]);

    // Nothing is queued but the port holds two: with the second of them.
    rig.does(6_000, &[Action::Transmit { mark: MarkId::NONE, bytes: b"DE" }]);
    rig.does(6_500, &[empty(MarkId(3))]);
    rig.given();
    rig.until(9_000);
    assert_given!(rig, [(8_000, "mark 3 maybe-left"), (8_000, "mark 3 surely-left")]);
}
