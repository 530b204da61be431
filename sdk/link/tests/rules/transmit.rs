//! The transmit queue: urgent bytes, discard, hold.

use crate::assert_given;
use crate::common::{Rig, rooms};
use softplug_abi::{Action, MarkId};
use softplug_link::Observed;

fn transmit(bytes: &[u8]) -> Action<'_> {
    Action::Transmit { mark: MarkId::NONE, bytes }
}

fn urgent(bytes: &[u8]) -> Action<'_> {
    Action::TransmitUrgent { mark: MarkId::NONE, bytes }
}

#[test]
fn urgent_passes() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[transmit(b"AB"), Action::Hold, urgent(b"12"), urgent(b"3")]);
    rig.does(1_500, &[urgent(b"4")]);
    rig.does(6_000, &[Action::Release, urgent(b"5")]);
    rig.until(20_000);
    let expected = [
        (0, b'1'),
        (1_000, b'2'),
        (2_000, b'3'),
        (3_000, b'4'),
        (6_000, b'5'),
        (7_000, b'A'),
        (8_000, b'B'),
    ];
    assert_eq!(rig.wire(), expected);

    // A break keeps its place among them.
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[transmit(b"A"), urgent(b"1"), Action::Break { micros: 500 }, urgent(b"2")]);
    rig.until(20_000);
    assert_eq!(rig.wire(), [(0, b'1'), (1_500, b'2'), (2_500, b'A')]);
    assert_eq!(rig.observed(), [(1_000, Observed::Break(500))]);
}

#[test]
fn urgent_boundary() {
    for (depth, expected) in [(1, 1), (2, 2), (3, 3)] {
        let mut rig = Rig::new(rooms(64, 64), depth);
        rig.does(0, &[transmit(b"ABCDEF")]);
        rig.does(500, &[urgent(b"!")]);
        rig.until(20_000);
        let wire = rig.wire();
        let at = wire.iter().position(|(_, byte)| *byte == b'!').unwrap();
        assert_eq!(at, expected, "the port holds {depth}");
        // Back to back with its neighbours, which keep their order.
        let times: Vec<_> = wire.iter().map(|(at, _)| *at).collect();
        assert_eq!(times, [0, 1_000, 2_000, 3_000, 4_000, 5_000, 6_000]);
        let others: Vec<_> = wire.iter().map(|(_, byte)| *byte).filter(|b| *b != b'!').collect();
        assert_eq!(others, b"ABCDEF");
    }
}

#[test]
fn discard_only_queue() {
    let mut rig = Rig::new(rooms(64, 64), 2);
    rig.does(0, &[transmit(b"ABCD")]);
    rig.does(100, &[urgent(b"12"), Action::Hold, Action::Discard]);
    rig.does(9_000, &[transmit(b"E")]);
    rig.until(12_000);
    let left = [(0, b'A'), (1_000, b'B'), (2_000, b'1'), (3_000, b'2')];
    assert_eq!(rig.wire(), left, "urgent bytes go, the hold stays");
    rig.does(12_000, &[Action::Release]);
    rig.until(20_000);
    assert_eq!(rig.wire()[4..], [(12_000, b'E')]);
}

#[test]
fn discard_answer() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(
        0,
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"A" },
            Action::Transmit { mark: MarkId(2), bytes: b"BC" },
            transmit(b"D"),
            Action::Transmit { mark: MarkId(3), bytes: b"E" },
            transmit(b"F"),
        ],
    );
    rig.does(100, &[Action::Discard]);
    rig.until(500);
    assert_given!(
        rig,
        [
            (100, "mark 2 dropped"),
            (100, "mark 3 dropped"),
            // The byte that the port has; none for those that were dropped.
            (100, "transmit-room 1"),
            (100, "discarded 5"),
        ]
    );
    // The whole room is back, and not a byte more.
    rig.does(600, &[Action::Hold, transmit(&[b'x'; 64])]);
    rig.until(2_000);
    assert_given!(rig, [(1_000, "mark 1 maybe-left"), (1_000, "mark 1 surely-left")]);

    // Each is answered, also where nothing is there to drop.
    rig.does(3_000, &[Action::Discard, Action::Discard]);
    assert_given!(rig, [(3_000, "discarded 64"), (3_000, "discarded 0")]);
    rig.does(4_000, &[Action::Release]);
    rig.until(9_000);
    assert_eq!(rig.wire(), [(0, b'A')]);
    assert_given!(rig, []);
}

#[test]
fn hold_mid_chunk() {
    let mut rig = Rig::new(rooms(64, 64), 2);
    rig.does(0, &[transmit(b"ABCDEFGHIJKLMNOPQRST")]);
    // The port has A to D by then.
    rig.does(2_500, &[Action::Hold]);
    rig.does(2_600, &[Action::Hold]);
    rig.until(50_000);
    assert_eq!(rig.wire(), [(0, b'A'), (1_000, b'B'), (2_000, b'C'), (3_000, b'D')]);

    rig.does(50_000, &[Action::Release]);
    rig.does(50_100, &[Action::Release]);
    rig.until(90_000);
    let wire = rig.wire();
    assert_eq!(wire[4], (50_000, b'E'));
    assert_eq!(wire.len(), 20);
    rig.does(91_000, &[transmit(b"U")]);
    assert_eq!(rig.wire()[20..], [(91_000, b'U')]);
}

#[test]
fn hold_before_next_write() {
    let mut rig = Rig::new(rooms(64, 64), 4);
    rig.does(0, &[transmit(b"A"), Action::Hold]);
    rig.does(100, &[Action::Release, Action::Hold]);
    rig.does(200, &[Action::Release, transmit(b"B"), Action::Hold, Action::Discard]);
    rig.until(5_000);
    assert_eq!(rig.wire(), []);
    rig.does(
        6_000,
        &[transmit(b"C"), Action::Release, Action::Hold, transmit(b"D"), Action::Release],
    );
    rig.until(9_000);
    assert_eq!(rig.wire(), [(6_000, b'C'), (7_000, b'D')]);
}
