//! Bits that power left half programmed: they read so at one time and otherwise at another.

use crate::bench::{ATTEMPTS, NOR, digest, download, live, module, open, runs};
use crate::flash::{Flash, Tear};
use crate::model::{Model, Op, Runs};

fn life() -> Vec<Op> {
    let up = |number| {
        [download(&module(number, 300)), vec![Op::Trial, Op::Boot, Op::Confirm, Op::Boot]].concat()
    };
    [
        up(1),
        up(2),
        download(&module(3, 400)),
        vec![Op::Trial, Op::Boot, Op::Fail, Op::Boot],
        up(4),
        vec![Op::GoBack, Op::Boot],
        up(5),
    ]
    .concat()
}

/// Whatever the bits read as, and whatever is done then, there is a module to run.
#[test]
fn a_unit_that_has_confirmed_always_runs_a_module() {
    let mut whole = Flash::new(NOR);
    live(&mut whole, &mut Model::new(ATTEMPTS), &life()).unwrap();
    let mut tried = 0;
    for number in 0..whole.done.len() {
        for seed in 0..40 {
            let mut flash = Flash::new(NOR);
            let mut model = Model::new(ATTEMPTS);
            flash.cut(number, Tear::Marginal(seed * 1_009 + number as u64));
            live(&mut flash, &mut model, &life()).unwrap_err();
            if model.confirmed.is_empty() {
                continue;
            }
            tried += 1;
            flash.power_on();
            // Downloads come and go and are reset; what is refused is refused.
            for round in 0..8 {
                let fresh = module(20 + round, 150);
                let mut slots = open(&mut flash).unwrap();
                let boot = slots.boot();
                assert_ne!(
                    runs(&boot, slots.device()),
                    Runs::Nothing,
                    "cut {number}, seed {seed}: {boot:?}"
                );
                if slots.begin(150, digest(&fresh), None).is_err() {
                    if round % 2 == 0 {
                        let _ = slots.confirm();
                    } else {
                        let _ = slots.fail();
                    }
                    continue;
                }
                let mut slots = open(&mut flash).unwrap();
                let boot = slots.boot();
                assert_ne!(
                    runs(&boot, slots.device()),
                    Runs::Nothing,
                    "cut {number}, seed {seed}: {boot:?}"
                );
                if slots.begin(150, digest(&fresh), None).is_ok()
                    && slots.write(0, &fresh).is_ok()
                    && slots.finish().is_ok()
                    && slots.start_trial().is_ok()
                {
                    let boot = slots.boot();
                    assert_ne!(runs(&boot, slots.device()), Runs::Nothing);
                    let _ = slots.confirm();
                }
            }
        }
    }
    assert!(tried > 1_000, "{tried}");
}
