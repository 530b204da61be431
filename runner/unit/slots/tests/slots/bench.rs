//! A unit on a flash memory that may lose power, and what every test needs with it.

use crate::flash::{Dice, Flash, Lost};
use crate::model::{Bytes, Model, Op, Runs};
use sha2::{Digest, Sha256};
use softplug_unit_slots::{Boot, Error, Geometry, Options, Run, Slots, Trust};
use std::rc::Rc;

pub(crate) const ATTEMPTS: u8 = 3;

/// NOR flash with small blocks, so that modules have several.
pub(crate) const NOR: Geometry = Geometry { size: 12_288, erase: 512, granule: 4 };

pub(crate) fn options() -> Options<'static> {
    Options { trust: Trust::unsigned_too(&[]), attempts: ATTEMPTS, most_erases: 1_000 }
}

pub(crate) fn open(flash: &mut Flash) -> Result<Slots<'static, &mut Flash>, Error<Lost>> {
    Slots::open(flash, options())
}

/// A module of random bytes, so many as to end in the middle of a granule.
pub(crate) fn module(number: u64, length: usize) -> Bytes {
    let mut dice = Dice(number ^ 0x0d15_ea5e);
    Bytes(Rc::new((0..length).map(|_| dice.byte()).collect()))
}

pub(crate) fn digest(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

/// What a boot gave, with the bytes that really lie there.
pub(crate) fn runs(boot: &Boot, flash: &Flash) -> Runs {
    let Some(module) = boot.run.module() else { return Runs::Nothing };
    let from = module.at as usize;
    let bytes = flash.bytes[from..from + module.length as usize].to_vec();
    assert_eq!(digest(&bytes), module.digest, "what runs is not what was downloaded");
    let bytes = Bytes(Rc::new(bytes));
    match boot.run {
        Run::Trial { attempt, .. } => Runs::Trial(bytes, attempt),
        _ => Runs::Confirmed(bytes),
    }
}

/// A whole download in pieces, up to `end`.
pub(crate) fn download(module: &Bytes) -> Vec<Op> {
    let mut ops = vec![Op::Begin(module.clone())];
    let pieces = (0..module.len()).step_by(201);
    ops.extend(pieces.map(|from| Op::Write(module.clone(), from, (from + 201).min(module.len()))));
    ops.push(Op::Finish);
    ops
}

/// Lets a unit live; the model goes with it. Ends early when power fails, with what the model would have become.
pub(crate) fn live(flash: &mut Flash, model: &mut Model, ops: &[Op]) -> Result<(), Box<Model>> {
    let mut slots = open(flash).unwrap();
    for op in ops {
        let after = model.after(op);
        let result = match op {
            Op::Boot => {
                slots = open(slots.into_device()).unwrap();
                let boot = slots.boot();
                if slots.device().is_off() {
                    return Err(Box::new(after));
                }
                assert_eq!(runs(&boot, slots.device()), model.runs());
                Ok(())
            }
            Op::Begin(module) => slots.begin(module.len() as u32, digest(module), None).map(drop),
            Op::Write(module, from, to) => slots.write(*from as u32, &module[*from..*to]).map(drop),
            Op::Finish => slots.finish().map(drop),
            Op::Trial => slots.start_trial().map(drop),
            Op::Confirm => slots.confirm().map(drop),
            Op::Fail => slots.fail().map(drop),
            Op::GoBack => slots.go_back().map(drop),
        };
        match result {
            Ok(()) => *model = after,
            Err(Error::Device(_)) => return Err(Box::new(after)),
            Err(error) => panic!("{op:?}: {error}"),
        }
    }
    Ok(())
}
