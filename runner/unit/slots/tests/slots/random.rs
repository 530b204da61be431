//! Anything in any order, with resets and loss of power, against the model.

use crate::bench::{NOR, digest, module, open, runs};
use crate::flash::{Dice, Flash, Tear};
use crate::model::{Bytes, Model, Op, Runs};
use softplug_unit_slots::{Begun, Error, Refusal, Slot, Slots, State};

/// The module that came last, if it waits for its trial.
fn look_up(slots: &Slots<'_, &mut Flash>) -> Option<Bytes> {
    let held = Slot::BOTH.into_iter().filter_map(|slot| slots.held(slot));
    let newest =
        held.max_by_key(|held| held.generation).filter(|held| held.state == State::Written)?;
    (0..5)
        .flat_map(|number| (0..40).map(move |tens| module(number, 1 + tens * 10)))
        .find(|module| digest(module) == newest.digest)
}

/// One thing that somebody does; refused or not as the model says.
fn step(
    flash: &mut Flash,
    model: &mut Model,
    dice: &mut Dice,
    life: usize,
) -> Result<(), Box<Model>> {
    let mut slots = open(flash).unwrap();
    let boot = slots.boot();
    if slots.device().is_off() {
        return Err(Box::new(model.after(&Op::Boot)));
    }
    let found = runs(&boot, slots.device());
    assert_eq!(found, model.runs());
    *model = model.after(&Op::Boot);
    let mut is_trial = matches!(found, Runs::Trial(..));
    let mut is_running = found != Runs::Nothing;
    let mut coming: Option<(Bytes, usize)> = None;
    for _ in 0..life {
        let any = module(dice.next() % 5, 1 + dice.below(40) * 10);
        let (op, result) = match dice.below(8) {
            0 => (
                Op::Begin(any.clone()),
                slots.begin(any.len() as u32, digest(&any), None).map(Some),
            ),
            1..=3 => {
                let Some((module, received)) = &mut coming else {
                    assert!(matches!(
                        slots.write(0, &any),
                        Err(Error::Refused(Refusal::NoDownload))
                    ));
                    continue;
                };
                let from = dice.below(*received + 1);
                let to = (from + dice.below(200)).min(module.len());
                let op = Op::Write(module.clone(), from, to);
                let result = slots.write(from as u32, &module[from..to]).map(|count| {
                    *received = to.max(*received);
                    assert_eq!(count as usize, *received);
                    None
                });
                (op, result)
            }
            4 => (Op::Finish, slots.finish().map(|_| None)),
            5 => (Op::Trial, slots.start_trial().map(|_| None)),
            6 if dice.below(2) == 0 => (Op::GoBack, slots.go_back().map(|_| None)),
            6 => (Op::Fail, slots.fail().map(|_| None)),
            _ => (Op::Confirm, slots.confirm().map(|_| None)),
        };
        let may = match &op {
            Op::Begin(_) => model.trial.is_none(),
            Op::Write(..) => true,
            Op::Finish => {
                coming.as_ref().is_some_and(|(module, received)| module.len() == *received)
            }
            Op::Trial => model.written.is_some() || model.trial.is_some(),
            Op::Confirm => is_running && (is_trial || !model.confirmed.is_empty()),
            Op::Fail => model.trial.is_some(),
            Op::GoBack => is_running && !is_trial && model.confirmed.len() == 2,
            Op::Boot => unreachable!("a step begins with it"),
        };
        match result {
            Ok(begun) => {
                match (&op, begun) {
                    (_, Some(Begun::AlreadyThere { .. } | Begun::UnderWay { .. })) => continue,
                    (Op::Begin(module), _) => coming = Some((module.clone(), 0)),
                    (Op::Trial, _) if model.trial.is_some() => continue,
                    (Op::Finish, _) => coming = None,
                    (Op::Confirm, _) if !is_trial => continue,
                    (Op::Confirm, _) => is_trial = false,
                    (Op::Fail, _) if is_trial => (is_trial, is_running) = (false, false),
                    (Op::GoBack, _) => is_running = false,
                    _ => {}
                }
                assert!(may, "{op:?} is done in {model:?}");
                *model = model.after(&op);
            }
            Err(Error::Device(_)) => return Err(Box::new(model.after(&op))),
            Err(error) => assert!(!may, "{op:?} is refused in {model:?}: {error}"),
        }
    }
    Ok(())
}

#[test]
fn any_order_of_operations_is_as_the_model_says() {
    let (mut cuts, mut confirmed) = (0, 0);
    for seed in 0..1_500 {
        let mut dice = Dice(seed);
        let mut flash = Flash::new(NOR);
        let mut model = Model::new(3);
        for _ in 0..30 {
            if dice.below(2) == 0 {
                let tear = match dice.below(4) {
                    0 => Tear::Nothing,
                    1 => Tear::All,
                    2 => Tear::Torn(dice.below(4), dice.next()),
                    _ => Tear::Page(dice.next()),
                };
                flash.cut(dice.below(25), tear);
            }
            let life = dice.below(40);
            if let Err(after) = step(&mut flash, &mut model, &mut dice, life) {
                cuts += 1;
                flash.power_on();
                let mut looked = flash.clone();
                let mut slots = open(&mut looked).unwrap();
                let boot = slots.boot();
                let found = runs(&boot, slots.device());
                let is_old = found == model.runs();
                assert!(
                    is_old || found == after.runs(),
                    "seed {seed}: {found:?} of {model:?} or {after:?}"
                );
                model = if is_old { model } else { *after };
                // Whether it is written shows in nothing that runs, nor whether the older one is there.
                model.written = look_up(&slots);
                let confirmed = |slot: &Slot| {
                    slots.held(*slot).is_some_and(|held| held.state == State::Confirmed)
                };
                model.confirmed.truncate(Slot::BOTH.into_iter().filter(confirmed).count());
                model.coming = None;
            }
            flash.power_on();
            confirmed += usize::from(!model.confirmed.is_empty());
        }
    }
    assert!(cuts > 5_000 && confirmed > 5_000, "{cuts} {confirmed}");
}
