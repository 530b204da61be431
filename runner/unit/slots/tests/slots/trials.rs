//! Trials: how they begin and end, and the way back.

use crate::bench::{digest, module, open};
use crate::downloads::with_confirmed;
use crate::flash::{Flash, Lost};
use crate::model::Bytes;
use softplug_unit_slots::{
    Error, Failure, Fault, Options, PassedOver, Refusal, Run, SetUpError, Slot, Slots, State,
};

fn refusal<T: std::fmt::Debug>(result: Result<T, Error<Lost>>) -> Refusal {
    match result {
        Err(Error::Refused(refusal)) => refusal,
        other => panic!("{other:?}"),
    }
}

fn put(slots: &mut Slots<'_, &mut Flash>, module: &Bytes) -> Slot {
    slots.begin(module.len() as u32, digest(module), None).unwrap();
    slots.write(0, module).unwrap();
    slots.finish().unwrap()
}

fn slot(run: Run) -> Option<Slot> {
    run.module().map(|module| module.slot)
}

#[test]
fn the_first_plug_in_that_fails_leaves_none() {
    let mut flash = Flash::new(crate::bench::NOR);
    let mut slots = open(&mut flash).unwrap();
    assert_eq!(refusal(slots.start_trial()), Refusal::NothingToTry);
    assert_eq!(refusal(slots.fail()), Refusal::NotOnTrial);
    assert_eq!(put(&mut slots, &module(1, 50)), Slot::A);
    // Written is not run.
    assert_eq!(slots.boot().passed_over, [Some(PassedOver::NotTried), Some(PassedOver::NoModule)]);
    assert_eq!(refusal(slots.confirm()), Refusal::NotOnTrial);
    slots.start_trial().unwrap();
    assert_eq!(refusal(slots.confirm()), Refusal::NotOnTrial);
    assert!(matches!(slots.boot().run, Run::Trial { attempt: 1, of: 3, .. }));
    assert_eq!(slots.fail().unwrap(), Slot::A);
    assert_eq!(refusal(slots.confirm()), Refusal::NotOnTrial);
    let boot = slots.boot();
    assert_eq!(boot.run, Run::Nothing);
    assert_eq!(boot.passed_over[0], Some(PassedOver::Failed(Failure::Told)));
    // The next one goes where less was erased.
    assert_eq!(put(&mut slots, &module(2, 50)), Slot::B);
}

#[test]
fn each_boot_is_an_attempt_and_the_last_one_goes_back() {
    let mut flash = with_confirmed(&module(1, 300));
    let mut slots = open(&mut flash).unwrap();
    put(&mut slots, &module(2, 50));
    assert_eq!(slots.start_trial().unwrap(), Slot::B);
    let done = slots.device().done.len();
    assert_eq!(slots.start_trial().unwrap(), Slot::B);
    assert_eq!(slots.device().done.len(), done, "it is on trial already");
    for expected in 1..=3 {
        let mut slots = open(&mut flash).unwrap();
        let boot = slots.boot();
        let Run::Trial { module, attempt, of: 3 } = boot.run else { panic!("{boot:?}") };
        assert_eq!((module.slot, attempt), (Slot::B, expected));
        assert_eq!(boot.passed_over, [Some(PassedOver::Older), None]);
    }
    let mut slots = open(&mut flash).unwrap();
    let boot = slots.boot();
    assert_eq!(slot(boot.run), Some(Slot::A));
    assert_eq!(boot.passed_over[1], Some(PassedOver::Failed(Failure::AttemptsUsedUp)));
    let done = slots.device().done.len();
    slots.boot();
    assert_eq!(slots.device().done.len(), done, "a boot of a confirmed module writes nothing");
}

#[test]
fn a_trial_that_nobody_has_run_can_be_called_off() {
    let mut flash = with_confirmed(&module(1, 300));
    let mut slots = open(&mut flash).unwrap();
    slots.boot();
    put(&mut slots, &module(2, 50));
    slots.start_trial().unwrap();
    assert_eq!(slots.fail().unwrap(), Slot::B);
    // What runs goes on, and stays.
    assert_eq!(slots.confirm().unwrap(), Slot::A);
    assert_eq!(put(&mut slots, &module(3, 50)), Slot::B);
}

#[test]
fn the_way_back_needs_a_sound_module_there() {
    let (old, new) = (module(1, 300), module(2, 50));
    let mut flash = with_confirmed(&old);
    let mut slots = open(&mut flash).unwrap();
    slots.boot();
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther);
    put(&mut slots, &new);
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther);
    slots.start_trial().unwrap();
    slots.boot();
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther);
    assert_eq!(slots.confirm().unwrap(), Slot::B);
    assert_eq!(slots.confirm().unwrap(), Slot::B, "said twice is said once");
    let mut decayed = flash.clone();
    let place = decayed.bytes.windows(300).position(|bytes| bytes == &old[..]).unwrap();
    decayed.bytes[place] ^= 1;
    let mut slots = open(&mut decayed).unwrap();
    slots.boot();
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther);
    let mut slots = open(&mut flash).unwrap();
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther, "nothing runs yet");
    slots.boot();
    assert_eq!(slots.go_back().unwrap(), Slot::B);
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther);
    assert_eq!(slot(slots.boot().run), Some(Slot::A));
    assert_eq!(refusal(slots.go_back()), Refusal::NoOther);
}

#[test]
fn an_attempt_that_cannot_be_counted_is_not_run() {
    let mut flash = with_confirmed(&module(1, 300));
    let mut slots = open(&mut flash).unwrap();
    put(&mut slots, &module(2, 50));
    slots.start_trial().unwrap();
    // Slot B's records from the third on.
    flash.stuck = Some(6_144 + 192 + 32..6_144 + 192 + 512);
    let mut slots = open(&mut flash).unwrap();
    let boot = slots.boot();
    assert_eq!(slot(boot.run), Some(Slot::A));
    assert_eq!(boot.passed_over[1], Some(PassedOver::NotCounted));
    let error = slots.fail().unwrap_err();
    assert!(
        matches!(error, Error::Device(Fault::NotKept { .. } | Fault::Failed { .. })),
        "{error}"
    );
    assert_eq!(refusal(slots.begin(9, [9; 32], None)), Refusal::TrialUnderWay { slot: Slot::B });
    // Neither ended nor run: it can be cleared.
    slots.clear(Slot::B).unwrap();
    slots.begin(9, [9; 32], None).unwrap();
}

/// A record that a place does not take goes into the next one.
#[test]
fn places_that_keep_nothing_are_gone_over() {
    let mut flash = with_confirmed(&module(1, 300));
    flash.stuck = Some(6_144 + 192..6_144 + 192 + 32);
    let mut slots = open(&mut flash).unwrap();
    put(&mut slots, &module(2, 50));
    slots.start_trial().unwrap();
    assert!(matches!(slots.boot().run, Run::Trial { attempt: 1, .. }));
    let mut slots = open(&mut flash).unwrap();
    assert!(matches!(slots.boot().run, Run::Trial { attempt: 2, .. }));
    slots.confirm().unwrap();
}

/// Records that were torn use up room; a trial that cannot be counted any more has failed.
#[test]
fn a_trial_without_a_record_left_has_failed() {
    let mut flash = with_confirmed(&module(1, 300));
    let mut slots = open(&mut flash).unwrap();
    put(&mut slots, &module(2, 50));
    slots.start_trial().unwrap();
    let records = 6_144 + 192;
    for (torn, runs) in [(2..31, false), (2..30, true)] {
        let mut bytes = flash.bytes.clone();
        for number in torn {
            bytes[records + 16 * number] = 0;
        }
        let mut flash = Flash::with(crate::bench::NOR, bytes);
        let mut slots = open(&mut flash).unwrap();
        let boot = slots.boot();
        assert_eq!(slot(boot.run), Some(if runs { Slot::B } else { Slot::A }), "{boot:?}");
        if runs {
            slots.confirm().unwrap();
            assert_eq!(slots.held(Slot::B).unwrap().state, State::Confirmed);
        } else {
            assert_eq!(boot.passed_over[1], Some(PassedOver::Failed(Failure::NoRecordLeft)));
        }
        // Either way the next download comes through.
        put(&mut slots, &module(3, 60));
        slots.start_trial().unwrap();
        assert!(matches!(slots.boot().run, Run::Trial { .. }));
        slots.confirm().unwrap();
    }
}

#[test]
fn attempts_are_one_to_eight() {
    for attempts in [0, 9, 255] {
        let options = Options { attempts, ..crate::bench::options() };
        let error = Slots::open(Flash::new(crate::bench::NOR), options).unwrap_err();
        assert!(matches!(error, Error::SetUp(SetUpError::Attempts { .. })), "{error}");
    }
}

#[test]
fn what_is_asked_for_runs_or_it_is_said_why_not() {
    let (old, new) = (module(1, 300), module(2, 50));
    let mut flash = with_confirmed(&old);
    let mut slots = open(&mut flash).unwrap();
    assert_eq!(slot(slots.boot().run), Some(Slot::A));
    assert_eq!(refusal(slots.change_to(&digest(&new))), Refusal::NotHeld);
    slots.begin(50, digest(&new), None).unwrap();
    assert_eq!(refusal(slots.change_to(&digest(&new))), Refusal::Unfinished);
    slots.write(0, &new).unwrap();
    slots.finish().unwrap();

    // What was downloaded goes on trial; asked for again, it is that trial's next attempt.
    for expected in 1..=2 {
        let Run::Trial { module, attempt, .. } = slots.change_to(&digest(&new)).unwrap().run else {
            panic!("it is on trial");
        };
        assert_eq!((module.digest, attempt), (digest(&new), expected));
    }
    slots.confirm().unwrap();

    // Back to the one before, and no further: what was gone back from has failed.
    assert_eq!(slot(slots.change_to(&digest(&old)).unwrap().run), Some(Slot::A));
    let failed = Refusal::FailedBefore(Failure::Told);
    assert_eq!(refusal(slots.change_to(&digest(&new))), failed);
    // What runs already is no way back.
    assert_eq!(slot(slots.change_to(&digest(&old)).unwrap().run), Some(Slot::A));
}
