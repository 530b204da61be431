//! What the firmware must do, and with how much: tests that need `qemu-system-arm`.

mod board;
mod gateway;

use std::time::{Duration, Instant};

use board::{Board, Figures};
use gateway::{Gateway, built, program, sent_natively};
use softplug_live::reactor::JobOutcome;
use softplug_unit_slots::{Options, Ram, Slot, Slots, State, Trust};

/// The RAM that a plug-in, the link, the protocol and all else may take.
const RAM_BYTES: u32 = 128 * 1_024;
/// Instructions a second of the board that this is meant for: an STM32F405.
const INSTRUCTIONS: u64 = 168_000_000;
/// Characters a second at 19,200 baud, 8N1.
const CHARACTERS: u64 = 1_920;

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// Whether it is no XON or XOFF of the plug-in's own.
fn is_data(byte: u8) -> bool {
    !matches!(byte, XON | XOFF)
}

#[test]
fn fanuc_in_128_kib_with_a_job_and_after_a_loss_of_power() {
    let mut board = Board::start();
    let mut gateway = Gateway::start(board.uplink(), built("fanuc-rs232"));
    gateway.until_up();
    let program = program(3_000);
    let expected = sent_natively("fanuc-rs232", &program);
    board.say(&[XON]);
    gateway.begin(7, &program);
    let heard = board.hear(expected.len());
    assert_eq!(String::from_utf8_lossy(&heard), String::from_utf8_lossy(&expected));
    let end = gateway.until_ended();
    assert_eq!((end.outcome, end.taken), (JobOutcome::Done, program.len() as u64));
    assert_eq!((end.surely_left, end.maybe_left), (heard.len() as u64, heard.len() as u64));

    let figures = board.figures();
    println!("FANUC: {figures:?}, {} bytes of RAM", figures.ram());
    assert!(figures.ram() <= RAM_BYTES, "{figures:?}");
    board.is_untouched_beyond(RAM_BYTES);

    // It runs its plug-in again by itself: nobody is connected.
    drop(gateway);
    let loaded = figures.heap_bytes * 3 / 4;
    board.lose_power();
    board.until(|figures| figures.turns > 1_000 && figures.heap_bytes > loaded);
    let mut gateway = Gateway::start(board.uplink(), built("fanuc-rs232"));
    gateway.until_up();
    board.say(&[XON]);
    gateway.begin(8, &program);
    assert_eq!(board.hear(expected.len()), expected);
    assert_eq!(gateway.until_ended().outcome, JobOutcome::Done);

    let (mut bytes, geometry) = board.slots();
    let trust = Trust::unsigned_too(&[]);
    let options = Options { trust, attempts: 3, most_erases: 10_000 };
    let slots = Slots::open(Ram::new(&mut bytes, geometry).unwrap(), options).unwrap();
    let held = slots.held(Slot::A).expect("it was downloaded");
    assert_eq!((held.state, held.length as usize), (State::Confirmed, built("fanuc-rs232").len()));
    // Once downloaded, and not again after the loss of power.
    assert_eq!((slots.erases(Slot::A), slots.held(Slot::B)), (1, None));
}

#[test]
fn at_19200_baud_both_ways_half_of_the_processor_is_left() {
    let mut board = Board::start();
    let mut gateway = Gateway::start(board.uplink(), built("xon-xoff"));
    gateway.until_up();
    let program = program(9_000);
    gateway.begin(1, &program);
    let mut heard = board.hear(500);
    let begin = board.figures();
    // The machine says a character for each that it hears: so both ways have the line's rate,
    // however busy this computer is. It obeys XOFF, which comes where this computer puts away too slowly.
    let from_machine: Vec<u8> = (0..4_000).map(|nth| b"N10 G1 X10\n"[nth % 11]).collect();
    let started = Instant::now();
    let (mut said, mut may_say) = (0, true);
    while said < from_machine.len() {
        assert!(started.elapsed() < board::PATIENCE, "said {said}, heard {}", heard.len());
        let news = board.heard();
        if let Some(last) = news.iter().rfind(|byte| !is_data(**byte)) {
            may_say = *last == XON;
        }
        if may_say {
            let end = (said + news.len()).min(from_machine.len());
            board.say(&from_machine[said..end]);
            said = end;
        }
        heard.extend(news);
        gateway.hear(Duration::from_millis(4));
    }
    let end = board.figures();
    let instructions = Figures::instructions(&begin, &end) / said as u64;
    let share = instructions * CHARACTERS * 100 / INSTRUCTIONS;
    println!(
        "XON/XOFF, both ways: {instructions} instructions for a character each way, {share} %"
    );
    assert!(share <= 50, "{instructions} instructions for a character each way: {share} %");

    // Nothing was lost of either way. The plug-in's own XON and XOFF stand between.
    let patience = Instant::now();
    while heard.iter().filter(|byte| is_data(**byte)).count() < program.len() {
        assert!(patience.elapsed() < board::PATIENCE, "{} characters", heard.len());
        heard.extend(board.heard());
        gateway.hear(Duration::from_millis(4));
    }
    heard.retain(|byte| is_data(*byte));
    assert_eq!(String::from_utf8_lossy(&heard), String::from_utf8_lossy(&program));
    gateway.until_arrived(&from_machine);
}
