//! Where bytes are counted from, and how characters follow each other.

use crate::common::{Rig, rooms};
use softplug_abi::{Action, LineParameters, MarkId, Micros, Parity};
use softplug_link::{LinkOptions, Taken, Wire};

fn transmit(mark: MarkId, bytes: &[u8]) -> Action<'_> {
    Action::Transmit { mark, bytes }
}

#[test]
fn characters_follow_back_to_back() {
    // 1,041.67 µs a character: the nth ends n characters after the start, not n roundings.
    let line = LineParameters::new(9_600);
    let mut wire = Wire::new(line, 16);
    let starts: Vec<_> = (0..6).map(|_| wire.give(Micros(500)).0).collect();
    assert_eq!(starts, [500, 1_542, 2_584, 3_625, 4_667, 5_709]);
    assert_eq!(wire.poll_timeout(), Some(Micros(1_542)));
    wire.handle_timeout(Micros(3_624));
    assert_eq!((wire.left(), wire.space()), (2, 12));
    wire.handle_timeout(Micros(3_625));
    assert_eq!((wire.left(), wire.space()), (3, 13));
    // Given while the wire is busy, or at the very end: the same run goes on.
    assert_eq!(wire.give(Micros(6_000)), Micros(6_750));
    wire.handle_timeout(Micros(7_792));
    assert_eq!((wire.left(), wire.space()), (7, 16));
    assert_eq!(wire.give(Micros(7_792)), Micros(7_792));
    wire.handle_timeout(Micros(8_834));
    assert_eq!(wire.left(), 8);
    // To the µs: not 1,042 after the end of the second.
    let mut next = Wire::new(line, 1);
    for (at, end) in [(500, 1_542), (1_542, 2_584), (2_584, 3_625)] {
        assert_eq!(next.give(Micros(at)), Micros(at));
        assert_eq!(next.poll_timeout(), Some(Micros(end)));
        next.handle_timeout(Micros(end));
    }
    // After a silence a new run begins.
    assert_eq!(wire.give(Micros(8_900)), Micros(8_900));
    assert_eq!(wire.poll_timeout(), Some(Micros(9_942)));
}

#[test]
fn a_character_takes_all_its_bits() {
    let line =
        LineParameters { baud: 10_000, data_bits: 7, parity: Parity::Even, stop_half_bits: 4 };
    let mut wire = Wire::new(line, 1);
    wire.give(Micros(0));
    assert_eq!(wire.poll_timeout(), Some(Micros(1_100)));
    let mut wire = Wire::new(LineParameters::new(0), 1);
    assert_eq!(wire.give(Micros(70)), Micros(70));
    wire.handle_timeout(Micros(70));
    assert_eq!((wire.left(), wire.space()), (1, 1), "no rate: it leaves at once");
}

#[test]
fn a_transmitter_is_full_at_its_depth() {
    for depth in [1, 2, 16] {
        let mut wire = Wire::new(LineParameters::new(10_000), depth);
        for given in 0..depth {
            assert_eq!(wire.space(), depth - given);
            wire.give(Micros(0));
        }
        assert_eq!(wire.space(), 0);
        wire.handle_timeout(Micros(1_000));
        assert_eq!(wire.space(), 1);
    }
    assert_eq!(Wire::new(LineParameters::new(10_000), 0).space(), 1);
}

#[test]
fn a_break_stands_between_characters() {
    let mut wire = Wire::new(LineParameters::new(10_000), 4);
    wire.give(Micros(0));
    wire.give(Micros(0));
    assert_eq!(wire.give_break(Micros(100), Micros(250)), Micros(2_000));
    assert_eq!(wire.give(Micros(100)), Micros(2_250));
    assert_eq!(wire.give(Micros(100)), Micros(3_250));
    // On an idle wire it begins at once.
    assert_eq!(wire.give_break(Micros(9_000), Micros(250)), Micros(9_000));
    assert_eq!(wire.give(Micros(9_000)), Micros(9_250));
}

#[test]
fn positions_hold_over_close_and_reopening() {
    let mut rig = Rig::new(rooms(64, 64), 4);
    for round in 0..3 {
        let at = round * 100_000;
        // Three with the port at the close, the rest of it dropped.
        rig.does(at, &[transmit(MarkId(1), b"ABC"), transmit(MarkId(2), b"DEFG")]);
        rig.given();
        rig.host(at + 1_500, |link, out| link.close(Micros(at + 1_500), out));
        rig.host(at + 1_600, |link, out| link.open(Micros(at + 1_600), out));
        // The port still has A (leaving) to E; these are counted behind them.
        rig.does(
            at + 1_700,
            &[transmit(MarkId(3), b""), transmit(MarkId(4), b"xyz"), Action::Hold],
        );
        rig.given();
        rig.until(at + 20_000);
        let marks: Vec<_> =
            rig.given().into_iter().filter(|(_, event)| event.ends_with("surely-left")).collect();
        assert_eq!(marks, [(at + 5_000, "mark 3 surely-left".to_owned())]);
        rig.does(at + 30_000, &[Action::Release]);
        rig.until(at + 40_000);
        let marks: Vec<_> =
            rig.given().into_iter().filter(|(_, event)| event.ends_with("surely-left")).collect();
        assert_eq!(marks, [(at + 33_000, "mark 4 surely-left".to_owned())]);
    }
}

#[test]
fn nothing_is_sent_while_the_port_is_gone() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[transmit(MarkId::NONE, b"ABC")]);
    let reason = softplug_abi::LinkDownReason::Unplugged;
    rig.host(500, |link, out| link.link_down(Micros(500), reason, out));
    assert!(!rig.line.link.has_to_send());
    rig.until(5_000);
    assert_eq!(rig.line.link.take(&mut [0; 1]), Taken::Nothing);
    rig.host(6_000, |link, out| link.link_up(Micros(6_000), out));
    rig.until(9_000);
    assert_eq!(rig.wire(), [(0, b'A'), (6_000, b'B'), (7_000, b'C')]);
}

#[test]
fn an_ended_plugin_can_be_closed() {
    let mut rig = Rig::new(LinkOptions { ..rooms(4, 4) }, 1);
    rig.breaks(10, &[transmit(MarkId::NONE, b"12345")]);
    rig.given();
    rig.line.link.close(Micros(20), &mut rig.out).unwrap();
    rig.line.link.close(Micros(20), &mut rig.out).unwrap();
    assert_eq!(rig.given(), []);
}
