//! What is on a device is hostile: garbage, other formats, damage, and bytes that nobody can read.

use crate::bench::{NOR, digest, module, open};
use crate::downloads::with_confirmed;
use crate::flash::{Dice, Flash};
use crate::trust::crc32;
use softplug_unit_slots::{
    Content, Device, Error, Fault, MOST_ATTEMPTS, Refusal, Run, SetUpError, Slot, State,
};

/// Something is done with the unit until it runs a new module, whatever was on it.
fn recovers(flash: &mut Flash, what: &str) {
    let fresh = module(77, 90);
    let mut slots = open(flash).unwrap();
    // A trial ends after so many boots, and one that cannot be read never does by itself.
    for _ in 0..=2 * MOST_ATTEMPTS {
        slots.boot();
    }
    let _ = slots.fail();
    match slots.begin(90, digest(&fresh), None) {
        Ok(_) => {}
        Err(Error::SetUp(
            SetUpError::OtherVersion { slot, .. } | SetUpError::OtherGeometry { slot },
        )) => {
            slots.clear(slot).unwrap();
            slots.begin(90, digest(&fresh), None).unwrap();
        }
        Err(Error::Device(Fault::LastGeneration | Fault::Worn { .. })) => return,
        Err(error) => panic!("{what}: {error}"),
    }
    slots.write(0, &fresh).unwrap();
    slots.finish().unwrap();
    slots.start_trial().unwrap();
    let Run::Trial { module, .. } = slots.boot().run else { panic!("{what}") };
    assert_eq!(module.digest, digest(&fresh));
    slots.confirm().unwrap();
}

#[test]
fn random_bytes_run_nothing_and_are_written_over() {
    for seed in 0..300 {
        let mut dice = Dice(seed);
        let bytes = (0..NOR.size).map(|_| dice.byte()).collect();
        let mut flash = Flash::with(NOR, bytes);
        let mut slots = open(&mut flash).unwrap();
        assert_eq!(slots.look(Slot::A), Content::Garbage);
        assert_eq!(slots.boot().run, Run::Nothing);
        recovers(&mut flash, &format!("seed {seed}"));
    }
    for byte in [0x00, 0x55, 0xFE] {
        let mut flash = Flash::with(NOR, vec![byte; NOR.size as usize]);
        assert_eq!(open(&mut flash).unwrap().boot().run, Run::Nothing);
        recovers(&mut flash, &format!("all {byte:02x}"));
    }
}

/// Headers and records whose check sums are right, and whose fields are anything.
#[test]
fn random_fields_with_right_check_sums_run_nothing_that_is_not_sound() {
    let whole = with_confirmed(&module(1, 300));
    for seed in 0..3_000 {
        let mut dice = Dice(seed);
        let mut bytes = whole.bytes.clone();
        // A copy of the header in every area, each with some bytes changed.
        for area in [0, 1_024, 6_144, 7_168] {
            if dice.below(4) > 0 {
                let mut header = whole.bytes[..192].to_vec();
                header[10] = u8::from(area >= 6_144);
                for _ in 0..dice.below(4) {
                    header[8 + dice.below(160)] = dice.byte();
                }
                let crc = crc32(&header[..188]);
                header[188..].copy_from_slice(&crc.to_le_bytes());
                bytes[area..area + 192].copy_from_slice(&header);
            }
            for number in 0..dice.below(32) {
                let mut record = [0; 16];
                record[0] = dice.below(8) as u8;
                record[1] = number as u8;
                record[2] = dice.below(10) as u8;
                record[4] = 1;
                let crc = crc32(&record[..12]);
                record[12..].copy_from_slice(&crc.to_le_bytes());
                let at = area + 192 + 16 * number;
                bytes[at..at + 16].copy_from_slice(&record);
            }
        }
        let mut flash = Flash::with(NOR, bytes);
        let mut slots = open(&mut flash).unwrap();
        for _ in 0..3 {
            if let Some(found) = slots.boot().run.module() {
                let from = found.at as usize;
                let bytes = &slots.device().bytes[from..from + found.length as usize];
                assert_eq!(digest(bytes), found.digest, "seed {seed}");
            }
        }
        recovers(&mut flash, &format!("seed {seed}"));
    }
}

fn changed(offset: usize, value: &[u8]) -> Flash {
    let mut flash = with_confirmed(&module(1, 300));
    flash.bytes[offset..offset + value.len()].copy_from_slice(value);
    let crc = crc32(&flash.bytes[..188]);
    flash.bytes[188..192].copy_from_slice(&crc.to_le_bytes());
    flash
}

#[test]
fn another_format_or_geometry_is_refused_by_name_and_left_alone() {
    let cases = [
        (changed(8, &[2, 0]), Content::OtherVersion(2)),
        (changed(8, &[0, 0]), Content::OtherVersion(0)),
        (changed(12, &[0, 16]), Content::OtherGeometry),
        (changed(16, &[8]), Content::OtherGeometry),
        (changed(20, &[1]), Content::OtherGeometry),
    ];
    for (mut flash, content) in cases {
        flash.power_on();
        let mut slots = open(&mut flash).unwrap();
        assert_eq!(slots.look(Slot::A), content);
        assert_eq!(slots.boot().run, Run::Nothing);
        // The other slot works. Then it is this one's turn, and it is refused.
        recovers(&mut flash, "the other slot");
        let mut slots = open(&mut flash).unwrap();
        slots.boot();
        let done = slots.device().done.len();
        let error = slots.begin(10, [1; 32], None).unwrap_err();
        assert!(matches!(error, Error::SetUp(_)), "{error}");
        assert_eq!(slots.device().done.len(), done);
        let error = slots.clear(Slot::B).unwrap_err();
        assert!(matches!(error, Error::Refused(Refusal::InUse { slot: Slot::B })), "{error}");
        slots.clear(Slot::A).unwrap();
        assert_eq!(slots.look(Slot::A), Content::Empty);
        slots.begin(10, [1; 32], None).unwrap();
    }
}

#[test]
fn impossible_fields_are_damage() {
    for (offset, value) in [
        (0_usize, &b"S"[..]),
        (10, &[1]),
        (11, &[1]),
        (11, &[2]),
        (36, &[0, 0, 0, 0]),
        (36, &[0xFF, 0xFF, 0xFF, 0xFF]),
        (36, &[1, 16, 0, 0]),
        (72, &[1]),
        (104, &[1]),
        (187, &[1]),
    ] {
        let mut flash = changed(offset, value);
        let mut slots = open(&mut flash).unwrap();
        // A key where the header says it is signed is a key that nobody knows.
        let is_signed = offset == 11 && value == [1];
        assert_eq!(slots.look(Slot::A) == Content::Damaged, offset != 0 && !is_signed, "{offset}");
        assert_eq!(slots.boot().run == Run::Nothing, offset != 0, "{offset}");
    }
    let mut flash = changed(0, b"X");
    assert_eq!(open(&mut flash).unwrap().look(Slot::A), Content::Garbage);
}

/// Any bit of header, records or module, wrong: nothing else ever runs.
#[test]
fn a_flipped_bit_anywhere_runs_the_module_or_nothing() {
    let whole = with_confirmed(&module(1, 300));
    let mut dead = 0;
    for bit in (0..8 * 288).chain(8 * 2_048..8 * 2_348) {
        let mut bytes = whole.bytes.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let mut flash = Flash::with(NOR, bytes);
        let mut slots = open(&mut flash).unwrap();
        match slots.boot().run.module() {
            Some(found) => {
                assert_eq!(found.digest, digest(&module(1, 300)));
            }
            None => dead += 1,
        }
        if bit % 8 == 0 {
            recovers(&mut flash, &format!("bit {bit}"));
        }
    }
    // Header and module count, of the records the one that confirms; without it the module is on trial.
    assert_eq!(dead, 8 * (192 + 300));
}

#[test]
fn the_last_generation_is_an_end() {
    let mut flash = changed(24, &[0xFF; 4]);
    flash.power_on();
    let mut slots = open(&mut flash).unwrap();
    let error = slots.begin(10, [1; 32], None).unwrap_err();
    assert!(matches!(error, Error::Device(Fault::LastGeneration)), "{error}");
    assert_eq!(slots.device().done, []);
}

/// Memories with an error correction cannot read what was torn.
#[test]
fn what_cannot_be_read_counts_as_damaged() {
    let whole = with_confirmed(&module(1, 300));
    let unreadable = |range: std::ops::Range<u32>| {
        let mut flash = whole.clone();
        flash.unreadable.push(range);
        flash
    };
    // A header of the other slot, a record behind the last one, one that counts no attempt any more.
    for range in [6_144..6_145, 7_168..7_172, 0x110..0x111, 0xE0..0xE1] {
        let mut flash = unreadable(range.clone());
        let mut slots = open(&mut flash).unwrap();
        assert!(matches!(slots.boot().run, Run::Confirmed(_)), "{range:?}");
        slots.begin(20, [2; 32], None).unwrap();
    }
    for range in [0..1, 2_100..2_101] {
        let mut flash = unreadable(range.clone());
        let mut slots = open(&mut flash).unwrap();
        assert_eq!(slots.boot().run, Run::Nothing, "{range:?}");
        // The slot that may be better than it looks stays.
        slots.begin(20, [2; 32], None).unwrap();
        assert_eq!(slots.held(Slot::B).map(|held| held.state), Some(State::Writing));
    }
    let mut dead = unreadable(0..NOR.size);
    assert!(matches!(open(&mut dead), Err(Error::Device(Fault::Failed { .. }))));
    assert!(dead.read(0, &mut [0; 4]).is_err());
}
