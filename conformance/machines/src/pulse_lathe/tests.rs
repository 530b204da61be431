//! The lathe alone, byte by byte.

use super::{Lathe, LatheOptions, PERIOD};
use crate::Partner;
use softplug_abi::Micros;

fn feed(lathe: &mut Lathe, from: Micros, bytes: &[u8]) -> Micros {
    bytes.iter().fold(from, |at, byte| {
        lathe.receive(at + PERIOD, *byte);
        at + PERIOD
    })
}

fn said(lathe: &mut Lathe, until: Micros) -> Vec<u8> {
    let mut said = Vec::new();
    while let Some(at) = lathe.next_event().filter(|at| *at <= until) {
        lathe.advance(at);
        while let Some(byte) = lathe.poll_transmit(at) {
            said.push(byte);
        }
    }
    said
}

#[test]
fn pulses_move_the_axes() {
    let mut lathe = Lathe::new(LatheOptions::default()).unwrap();
    feed(&mut lathe, Micros::ZERO, &[0x45, 0x4F, 0x43, 0x04]);
    let report = lathe.report();
    assert_eq!((report.x, report.z, report.gaps), (-1, 1, 0));
    assert_eq!((report.x_pulses, report.z_pulses), (3, 3));
}

#[test]
fn a_gap_is_counted_inside_a_cut_only() {
    let mut lathe = Lathe::new(LatheOptions::default()).unwrap();
    let at = feed(&mut lathe, Micros::ZERO, &[0x44, 0x04]);
    // Between two cuts, and behind a hold, nothing has to follow.
    let at = feed(&mut lathe, at + Micros(10_000), &[0x44, 0xE0]);
    let at = feed(&mut lathe, at + Micros(10_000), &[0x44]);
    assert_eq!(lathe.report().gaps, 0);
    feed(&mut lathe, at + Micros(PERIOD.0 * 3), &[0x04]);
    assert_eq!((lathe.report().gaps, lathe.report().missing_periods), (1, 3));
    assert_eq!(lathe.report().longest_gap, Micros(750));
}

#[test]
fn an_axis_stops_at_its_switch_and_tells_it_once() {
    let options = LatheOptions { z_limits: (-2, 5), ..LatheOptions::default() };
    let mut lathe = Lathe::new(options).unwrap();
    feed(&mut lathe, Micros::ZERO, &[0x4C, 0x4C, 0x4C, 0x0C]);
    assert_eq!((lathe.report().z, lathe.report().lost_pulses), (-2, 2));
    assert_eq!(said(&mut lathe, Micros(10_000)), [0xF6]);
}

#[test]
fn commands_are_echoed_when_they_are_done() {
    let mut lathe = Lathe::new(LatheOptions::default()).unwrap();
    lathe.receive(Micros(250), 0xC3);
    assert_eq!(said(&mut lathe, Micros(5_499)), b"");
    assert_eq!(said(&mut lathe, Micros(5_500)), [0xC3]);
}

#[test]
fn the_spindle_tells_every_increment_and_each_turn_its_mark() {
    let options = LatheOptions { increments: 100, ..LatheOptions::default() };
    let mut lathe = Lathe::new(options).unwrap();
    // Step 12: 600 turns a minute, ten a second.
    lathe.receive(Micros(250), 0x8C);
    let said = said(&mut lathe, Micros(1_006_000));
    assert_eq!(said[0], 0x8C);
    let (mut angle, mut turns) = (0, 0);
    for byte in &said[1..] {
        angle += u32::from(byte & 0x3F);
        if byte & 0x40 != 0 {
            assert_eq!(angle % 100, 0, "the mark is where it always is");
            turns += 1;
        }
    }
    assert_eq!((angle, turns), (1_000, 10));
}

#[test]
fn the_tool_takes_away_what_is_outside_of_it() {
    let options = LatheOptions {
        blank_radius: 10,
        blank_length: 5,
        start_x: 8,
        start_z: 1,
        ..LatheOptions::default()
    };
    let mut lathe = Lathe::new(options).unwrap();
    feed(&mut lathe, Micros::ZERO, &[0x4C, 0x4C, 0x4E, 0x0F, 0x01]);
    assert_eq!(lathe.contour(), [8, 8, 8, 7, 10]);
    assert_eq!(lathe.report().cut_while_still, 4);
    let picture = lathe.picture();
    assert!(picture.contains("<path id=\"part\" d=\"M-0.00 -0.040"), "{picture}");
    assert!(picture.contains("id=\"way\" points=\"0.01,-0.040"), "{picture}");
}
