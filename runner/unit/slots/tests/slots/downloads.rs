//! How a download goes: pieces in order, twice, too many; what is there already; where it goes.

use crate::bench::{NOR, digest, download, live, module, open, options};
use crate::flash::{Did, Flash, Lost, Shared, Tear};
use crate::model::{Bytes, Model, Op};
use softplug_unit_slots::{
    Begun, Content, Doing, Error, Failure, Fault, Options, PassedOver, Refusal, Run, Slot, Slots,
    State,
};
use std::cell::RefCell;
use std::rc::Rc;

fn refusal<T: std::fmt::Debug>(result: Result<T, Error<Lost>>) -> Refusal {
    match result {
        Err(Error::Refused(refusal)) => refusal,
        other => panic!("{other:?}"),
    }
}

fn begin(slots: &mut Slots<'_, &mut Flash>, module: &Bytes) -> Result<Begun, Error<Lost>> {
    slots.begin(module.len() as u32, digest(module), None)
}

/// A unit that runs this module, confirmed.
pub(crate) fn with_confirmed(module: &Bytes) -> Flash {
    let mut flash = Flash::new(NOR);
    let ops = [download(module), vec![Op::Trial, Op::Boot, Op::Confirm]].concat();
    live(&mut flash, &mut Model::new(3), &ops).unwrap();
    flash
}

#[test]
fn pieces_come_in_any_size_and_again() {
    let whole = module(1, 777);
    for size in [1, 3, 4, 5, 64, 256, 777] {
        let mut flash = Flash::new(NOR);
        let mut slots = open(&mut flash).unwrap();
        begin(&mut slots, &whole).unwrap();
        for from in (0..777).step_by(size) {
            let to = (from + size).min(777);
            assert_eq!(slots.write(from as u32, &whole[from..to]).unwrap(), to as u32);
            let programmed = slots.device().done.len();
            // The same again, one that begins before it, and one that ends before it.
            for again in [from, from.saturating_sub(7), from / 2] {
                assert_eq!(slots.write(again as u32, &whole[again..to]).unwrap(), to as u32);
                slots.write(again as u32, &whole[again..from.max(again)]).unwrap();
            }
            assert_eq!(
                slots.device().done.len(),
                programmed,
                "what came before is not written again"
            );
        }
        let slot = slots.finish().unwrap();
        let mut bytes = vec![0; 777];
        slots.read(slot, 0, &mut bytes).unwrap();
        assert_eq!(bytes, *whole.0);
        slots.read(slot, 770, &mut bytes[..7]).unwrap();
        assert_eq!(bytes[..7], whole[770..]);
        assert_eq!(refusal(slots.read(slot, 771, &mut bytes[..7])), Refusal::NoSuchBytes { slot });
        assert_eq!(
            refusal(slots.read(slot, u32::MAX, &mut bytes[..7])),
            Refusal::NoSuchBytes { slot }
        );
    }
}

#[test]
fn a_piece_may_come_again_in_part_and_go_on() {
    let whole = module(1, 30);
    let mut flash = Flash::new(NOR);
    let mut slots = open(&mut flash).unwrap();
    begin(&mut slots, &whole).unwrap();
    assert_eq!(slots.write(0, &whole[..10]).unwrap(), 10);
    assert_eq!(slots.write(5, &whole[5..19]).unwrap(), 19);
    assert_eq!(slots.write(0, &whole[..30]).unwrap(), 30);
    assert_eq!(slots.write(30, &[]).unwrap(), 30);
    slots.finish().unwrap();
}

#[test]
fn a_piece_that_does_not_fit_is_refused_and_changes_nothing() {
    let whole = module(1, 30);
    let mut flash = Flash::new(NOR);
    let mut slots = open(&mut flash).unwrap();
    assert_eq!(refusal(slots.write(0, &whole)), Refusal::NoDownload);
    assert_eq!(refusal(slots.finish()), Refusal::NoDownload);
    begin(&mut slots, &whole).unwrap();
    slots.write(0, &whole[..18]).unwrap();
    let done = slots.device().done.len();
    assert_eq!(
        refusal(slots.write(19, &whole[19..])),
        Refusal::OutOfOrder { expected: 18, offset: 19 }
    );
    assert_eq!(
        refusal(slots.write(u32::MAX, &whole)),
        Refusal::OutOfOrder { expected: 18, offset: u32::MAX }
    );
    assert_eq!(refusal(slots.write(18, &[0; 13])), Refusal::TooMuch { length: 30 });
    assert_eq!(refusal(slots.write(0, &[0; 31])), Refusal::TooMuch { length: 30 });
    // One that is on the device, and one that is not yet.
    for different in [0, 3, 15, 16, 17] {
        let mut other = whole[..18].to_vec();
        other[different] ^= 1;
        let expected = Refusal::Different { offset: different as u32 };
        assert_eq!(refusal(slots.write(0, &other)), expected);
        assert_eq!(refusal(slots.write(different as u32, &other[different..])), expected);
    }
    assert_eq!(refusal(slots.finish()), Refusal::Incomplete { received: 18, length: 30 });
    assert_eq!(slots.device().done.len(), done);
    assert_eq!(slots.received(), Some(18));
    slots.write(18, &whole[18..]).unwrap();
    slots.finish().unwrap();
}

#[test]
fn lengths_that_no_slot_takes_are_refused_unwritten() {
    let mut flash = Flash::new(NOR);
    let mut slots = open(&mut flash).unwrap();
    let room = slots.room();
    assert_eq!(room, 12_288 / 2 - 2 * 1_024);
    for length in [0, room + 1, u32::MAX] {
        assert_eq!(refusal(slots.begin(length, [0; 32], None)), Refusal::Length { length, room });
    }
    assert_eq!(slots.device().done, []);
    let largest = module(1, room as usize);
    begin(&mut slots, &largest).unwrap();
    slots.write(0, &largest).unwrap();
    slots.finish().unwrap();
}

#[test]
fn a_wrong_digest_fails_the_slot_and_the_next_download_helps() {
    let whole = module(1, 300);
    let mut flash = Flash::new(NOR);
    let mut slots = open(&mut flash).unwrap();
    slots.begin(300, [9; 32], None).unwrap();
    slots.write(0, &whole).unwrap();
    assert_eq!(refusal(slots.finish()), Refusal::Digest);
    assert_eq!(slots.held(Slot::A).unwrap().state, State::Failed(Failure::Digest));
    assert_eq!(refusal(slots.start_trial()), Refusal::NothingToTry);
    assert_eq!(slots.boot().passed_over[0], Some(PassedOver::Failed(Failure::Digest)));
    begin(&mut slots, &whole).unwrap();
    slots.write(0, &whole).unwrap();
    slots.finish().unwrap();
}

#[test]
fn what_is_there_already_is_not_written_again() {
    let (old, new) = (module(1, 300), module(2, 400));
    let mut flash = with_confirmed(&old);
    flash.power_on();
    let mut slots = open(&mut flash).unwrap();
    slots.boot();
    let there = |slot, state| Begun::AlreadyThere { slot, state };
    assert_eq!(begin(&mut slots, &old).unwrap(), there(Slot::A, State::Confirmed));
    assert_eq!(slots.device().done, []);
    assert_eq!(begin(&mut slots, &new).unwrap(), Begun::Fresh { slot: Slot::B });
    slots.write(0, &new[..100]).unwrap();
    let done = slots.device().done.len();
    assert_eq!(begin(&mut slots, &new).unwrap(), Begun::UnderWay { slot: Slot::B, received: 100 });
    slots.write(100, &new[100..]).unwrap();
    slots.finish().unwrap();
    let programmed = slots.device().done.len();
    assert_eq!(programmed, done + 2, "the rest and a record");
    assert_eq!(begin(&mut slots, &new).unwrap(), there(Slot::B, State::Written));
    slots.start_trial().unwrap();
    assert_eq!(
        begin(&mut slots, &new).unwrap(),
        there(Slot::B, State::Trial { attempts: 0, of: 3 })
    );
    // Not if it has decayed, or has failed.
    slots.fail().unwrap();
    assert_eq!(begin(&mut slots, &new).unwrap(), Begun::Fresh { slot: Slot::B });
}

#[test]
fn a_trial_keeps_downloads_away() {
    let (old, new, newer) = (module(1, 300), module(2, 400), module(3, 200));
    let mut flash = with_confirmed(&old);
    let mut slots = open(&mut flash).unwrap();
    begin(&mut slots, &new).unwrap();
    slots.write(0, &new).unwrap();
    slots.finish().unwrap();
    slots.start_trial().unwrap();
    for is_running in [false, true] {
        let done = slots.device().done.len();
        assert_eq!(refusal(begin(&mut slots, &newer)), Refusal::TrialUnderWay { slot: Slot::B });
        if is_running {
            assert_eq!(refusal(slots.clear(Slot::B)), Refusal::InUse { slot: Slot::B });
        }
        assert_eq!(refusal(slots.clear(Slot::A)), Refusal::InUse { slot: Slot::A });
        assert_eq!(slots.device().done.len(), done);
        slots.boot();
    }
}

/// The newer of two confirmed modules has decayed. What runs is the older one, and it must stay.
#[test]
fn a_download_leaves_alone_what_runs_instead_of_what_decayed() {
    let (old, new) = (module(1, 300), module(2, 400));
    let mut flash = with_confirmed(&old);
    let ops = [download(&new), vec![Op::Trial, Op::Boot, Op::Confirm]].concat();
    let mut model = Model { confirmed: vec![old], ..Model::new(3) };
    live(&mut flash, &mut model, &ops).unwrap();
    let place = flash.bytes.windows(400).position(|bytes| bytes == &new[..]).unwrap();
    flash.bytes[place + 399] ^= 0x10;
    for boots in [false, true] {
        let mut flash = flash.clone();
        let mut slots = open(&mut flash).unwrap();
        if boots {
            let Run::Confirmed(module) = slots.boot().run else { panic!() };
            assert_eq!(module.slot, Slot::A);
        }
        // Also the new one again: there it is no longer.
        assert_eq!(begin(&mut slots, &new).unwrap(), Begun::Fresh { slot: Slot::B });
    }
}

/// The newer module could not be read at the start, and can be later. What runs by then must stay.
#[test]
fn a_download_leaves_alone_what_runs() {
    let (old, new) = (module(1, 300), module(2, 400));
    let mut flash = with_confirmed(&old);
    let ops = [download(&new), vec![Op::Trial, Op::Boot, Op::Confirm]].concat();
    live(&mut flash, &mut Model { confirmed: vec![old], ..Model::new(3) }, &ops).unwrap();
    // Slot B's module.
    flash.unreadable.push(8_192..8_193);
    let flash = Shared(Rc::new(RefCell::new(flash)));
    let mut slots = Slots::open(flash.clone(), options()).unwrap();
    let boot = slots.boot();
    assert_eq!(boot.run.module().map(|module| module.slot), Some(Slot::A), "{boot:?}");
    flash.0.borrow_mut().unreadable.clear();
    let begun = slots.begin(10, [1; 32], None).unwrap();
    assert_eq!(begun, Begun::Fresh { slot: Slot::B });
}

#[test]
fn a_device_that_keeps_nothing_is_noticed() {
    let whole = module(1, 300);
    let mut flash = Flash::new(NOR);
    // The area of slot A's module.
    flash.stuck = Some(2_248..2_252);
    let mut slots = open(&mut flash).unwrap();
    begin(&mut slots, &whole).unwrap();
    let error = slots.write(0, &whole).unwrap_err();
    assert!(matches!(error, Error::Device(Fault::NotKept { at: 2_048 })), "{error}");
    assert_eq!(refusal(slots.write(0, &whole)), Refusal::NoDownload);
    assert_eq!(slots.boot().run, Run::Nothing);
}

#[test]
fn a_read_that_fails_now_and_then_is_tried_again() {
    let old = module(1, 300);
    let mut flash = with_confirmed(&old);
    let shared = Shared(Rc::new(RefCell::new(flash.clone())));
    let mut slots = Slots::open(shared.clone(), options()).unwrap();
    shared.0.borrow_mut().failing_reads = 2;
    assert!(matches!(slots.boot().run, Run::Confirmed(_)));
    flash.failing_reads = 2;
    open(&mut flash).unwrap();
    let mut flash = with_confirmed(&old);
    flash.failing_reads = u32::MAX;
    let error = open(&mut flash).unwrap_err();
    let broken = Fault::Failed { doing: Doing::Reading, at: 0x2000 - 0x400, source: Lost::Broken };
    assert_eq!(error.to_string(), broken.to_string());
}

fn worn(flash: &mut Flash) -> Slots<'static, &mut Flash> {
    Slots::open(flash, Options { most_erases: 5, ..options() }).unwrap()
}

#[test]
fn a_worn_slot_takes_nothing_and_runs_on() {
    let old = module(1, 300);
    let mut flash = with_confirmed(&old);
    for erases in 1..=5 {
        let mut slots = worn(&mut flash);
        slots.begin(10, [erases; 32], None).unwrap();
        assert_eq!((slots.erases(Slot::A), slots.erases(Slot::B)), (1, u32::from(erases)));
    }
    flash.power_on();
    let mut slots = worn(&mut flash);
    let error = slots.begin(10, [6; 32], None).unwrap_err();
    assert!(
        matches!(error, Error::Device(Fault::Worn { slot: Slot::B, erases: 5, most: 5 })),
        "{error}"
    );
    assert!(matches!(slots.boot().run, Run::Confirmed(_)));
    assert_eq!(slots.device().done, []);
}

#[test]
fn the_count_of_erasures_is_what_the_device_saw() {
    let old = module(1, 300);
    let mut flash = with_confirmed(&old);
    flash.power_on();
    for number in 0..40 {
        let mut slots = open(&mut flash).unwrap();
        slots.begin(600, [number; 32], None).unwrap();
    }
    let slots = open(&mut flash).unwrap();
    let (counted, device) = (slots.erases(Slot::B), slots.into_device());
    let erasures = |from: u32, to: u32| {
        device
            .done
            .iter()
            .filter(|did| matches!(did, Did::Erase { at, .. } if (from..to).contains(at)))
            .count()
    };
    assert_eq!(counted, 40);
    // First area, second area, module.
    assert_eq!(
        (erasures(6_144, 7_168), erasures(7_168, 8_192), erasures(8_192, 12_288)),
        (20, 20, 40)
    );
    assert_eq!(erasures(0, 6_144), 0, "the other slot is not touched");
}

/// Power fails again and again while the new header's area is erased, or before it.
#[test]
fn an_erasure_that_is_cut_short_counts() {
    let mut flash = with_confirmed(&module(1, 300));
    open(&mut flash).unwrap().begin(600, [0; 32], None).unwrap();
    for number in 1..=20 {
        // It confirms what stays, retires what goes, and erases.
        let tear = if number % 2 == 0 { Tear::Page(number) } else { Tear::All };
        flash.cut(2, tear);
        open(&mut flash).unwrap().begin(600, [number as u8; 32], None).unwrap_err();
        assert!(matches!(flash.done[2], Did::Erase { .. }), "{:?}", flash.done);
        flash.power_on();
        assert_eq!(open(&mut flash).unwrap().erases(Slot::B), 1 + number as u32);
    }
    let mut slots = open(&mut flash).unwrap();
    slots.begin(600, [99; 32], None).unwrap();
    assert_eq!(slots.erases(Slot::B), 22);
}

#[test]
fn content_is_told() {
    let mut flash = Flash::new(NOR);
    let slots = open(&mut flash).unwrap();
    assert_eq!(slots.look(Slot::A), Content::Empty);
    assert_eq!(slots.look(Slot::B).to_string(), "is empty");
}
