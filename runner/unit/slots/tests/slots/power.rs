//! Loss of power in every operation of the memory, in every way, for a whole life.

use crate::bench::{ATTEMPTS, NOR, download, live, module, open, runs};
use crate::flash::{Dice, Did, Flash, Tear};
use crate::model::{Model, Op, Runs};
use softplug_unit_slots::Geometry;

/// Downloads that go well, fail, are given up and are cut short; the way forward and back.
fn life() -> Vec<Op> {
    let [m1, m2, m3, m4, m5, m6] = [(1, 603), (2, 1_022), (3, 1), (4, 512), (5, 700), (6, 259)]
        .map(|(number, length)| module(number, length));
    let trial = [Op::Trial, Op::Boot];
    let mut ops = vec![Op::Boot];
    // The first one ever fails, the second is confirmed.
    ops.extend(download(&m6).into_iter().chain(trial.clone()).chain([Op::Fail, Op::Boot]));
    ops.extend(download(&m1).into_iter().chain(trial.clone()).chain([Op::Confirm, Op::Boot]));
    // One fails, one resets the unit until its attempts are used up.
    ops.extend(download(&m2).into_iter().chain(trial.clone()).chain([Op::Fail, Op::Boot]));
    ops.extend(download(&m3).into_iter().chain(trial.clone()));
    ops.extend([Op::Boot, Op::Boot, Op::Boot, Op::Boot]);
    // One goes well, and the unit goes back from it.
    ops.extend(download(&m4).into_iter().chain(trial.clone()).chain([
        Op::Confirm,
        Op::GoBack,
        Op::Boot,
    ]));
    // One is begun and not ended, another one after it goes well without a reset.
    ops.extend(download(&m5).into_iter().take(3));
    ops.extend(download(&m4).into_iter().chain(trial).chain([Op::Boot, Op::Confirm, Op::Boot]));
    ops
}

fn tears(did: Did, dice: &mut Dice) -> Vec<Tear> {
    let mut tears =
        vec![Tear::Nothing, Tear::All, Tear::Page(dice.next()), Tear::Page(dice.next())];
    let places: Vec<usize> = match did {
        Did::Program { granules, .. } => (0..granules).collect(),
        Did::Erase { blocks, .. } if blocks <= 8 => (0..blocks).collect(),
        // An EEPROM is erased byte by byte.
        Did::Erase { blocks, .. } => (0..8).map(|_| dice.below(blocks)).collect(),
    };
    tears.extend(places.iter().copied().filter(|place| *place > 0).map(Tear::Prefix));
    tears.extend(places.into_iter().map(|place| Tear::Torn(place, dice.next())));
    tears
}

/// After a loss of power: the unit runs what it ran before or what it was to run then. Gives which model is right.
fn look(flash: &mut Flash, before: &Model, after: &Model, what: &str) -> Model {
    let mut looked = flash.clone();
    let mut slots = open(&mut looked).unwrap();
    let boot = slots.boot();
    let found = runs(&boot, slots.device());
    for model in [before, after] {
        let mut model = model.clone();
        model.coming = None;
        if found == model.runs() {
            return model;
        }
    }
    panic!("{what}: runs {found:?} of {before:?} or {after:?}");
}

/// What somebody does then: ends the trial if there is one, and downloads anew.
fn way_on(model: &Model, is_confirmed: bool, number: u64) -> Vec<Op> {
    let mut ops = vec![Op::Boot];
    if let Runs::Trial(..) = model.runs() {
        ops.extend([if is_confirmed { Op::Confirm } else { Op::Fail }, Op::Boot]);
    }
    ops.extend(download(&module(number, 530)));
    ops.extend([Op::Trial, Op::Boot, Op::Confirm, Op::Boot]);
    ops
}

/// Every cut of a life; after each `second` one, every cut of the way on from there. Gives how many of both.
fn cut_everywhere(geometry: Geometry, second: usize) -> (usize, usize) {
    let mut whole = Flash::new(geometry);
    live(&mut whole, &mut Model::new(ATTEMPTS), &life()).unwrap();
    let mut dice = Dice(7);
    let (mut cuts, mut double) = (0, 0);
    for (number, did) in whole.done.iter().enumerate() {
        for tear in tears(*did, &mut dice) {
            let what = format!("{geometry:?} cut {number} {did:?} {tear:?}");
            let mut flash = Flash::new(geometry);
            let mut model = Model::new(ATTEMPTS);
            flash.cut(number, tear);
            let after = live(&mut flash, &mut model, &life()).expect_err(&what);
            cuts += 1;
            flash.power_on();
            let model = look(&mut flash, &model, &after, &what);
            let on = way_on(&model, cuts % 2 == 0, 8);
            let mut healed = flash.clone();
            live(&mut healed, &mut model.clone(), &on).unwrap();
            if cuts % second != 0 {
                continue;
            }
            for (number, did) in healed.done.iter().enumerate() {
                let tears = tears(*did, &mut dice);
                let tear = tears[dice.below(tears.len())];
                let what = format!("{what}, then {number} {did:?} {tear:?}");
                let (mut flash, mut model) = (flash.clone(), model.clone());
                flash.cut(number, tear);
                let after = live(&mut flash, &mut model, &on).expect_err(&what);
                double += 1;
                flash.power_on();
                let model = look(&mut flash, &model, &after, &what);
                live(&mut flash, &mut model.clone(), &way_on(&model, double % 2 == 0, 9)).unwrap();
            }
        }
    }
    (cuts, double)
}

#[test]
fn a_cut_anywhere_leaves_the_old_module_or_the_new_one() {
    assert_eq!(cut_everywhere(NOR, 1), (2_964, 43_626));
}

#[test]
fn the_same_with_granules_of_8_bytes() {
    assert_eq!(cut_everywhere(Geometry { granule: 8, ..NOR }, 4), (1_653, 6_089));
}

#[test]
fn the_same_with_granules_of_64_bytes() {
    assert_eq!(cut_everywhere(Geometry { size: 18_432, erase: 512, granule: 64 }, 4), (592, 2_203));
}

#[test]
fn the_same_with_granules_of_1_byte_and_blocks_of_4_kibibytes() {
    let geometry = Geometry { size: 32_768, erase: 4_096, granule: 1 };
    assert_eq!(cut_everywhere(geometry, 40), (10_791, 3_153));
}

#[test]
fn the_same_with_an_eeprom() {
    let geometry = Geometry { size: 4_864, erase: 1, granule: 1 };
    assert_eq!(cut_everywhere(geometry, 40), (10_986, 3_204));
}

#[test]
fn the_same_with_an_eeprom_that_loses_pages() {
    let geometry = Geometry { size: 19_456, erase: 128, granule: 128 };
    assert_eq!(cut_everywhere(geometry, 4), (601, 2_080));
}
