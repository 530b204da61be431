//! The frozen bytes of format 1: what is written has them, what has them is read, and the page shows them.

use crate::bench::{digest, options};
use crate::flash::Flash;
use sha2::{Digest, Sha256};
use softplug_unit_slots::{
    Geometry, Options, PassedOver, Run, Signature, Slot, Slots, State, ToBeSigned, Trust, key_id,
};
use std::collections::BTreeMap;

const TEXT: &str = include_str!("../golden/slots-1.txt");
const DEVICE: Geometry = Geometry { size: 65_536, erase: 4_096, granule: 8 };
/// Where records begin, and where modules do.
const RECORDS: usize = 192;
const MODULE: usize = 8_192;
const B: usize = 32_768;

fn golden() -> BTreeMap<&'static str, Vec<u8>> {
    let lines = TEXT.lines().filter(|line| !line.starts_with('#'));
    lines
        .map(|line| {
            let (name, hex) = line.split_once(' ').unwrap();
            let byte = |place| u8::from_str_radix(&hex[place..place + 2], 16).unwrap();
            (name, (0..hex.len()).step_by(2).map(byte).collect())
        })
        .collect()
}

fn module() -> Vec<u8> {
    (0..1_000_usize).map(|n| (7 * n + n / 256) as u8).collect()
}

fn signature() -> Signature {
    let golden = golden();
    let (key, bytes) = (&golden["key-id"], &golden["signature"]);
    Signature { key: key[..].try_into().unwrap(), bytes: bytes[..].try_into().unwrap() }
}

fn public() -> [[u8; 32]; 1] {
    [golden()["public-key"][..].try_into().unwrap()]
}

fn download(slots: &mut Slots<'_, &mut Flash>, module: &[u8], signature: Option<Signature>) {
    slots.begin(module.len() as u32, digest(module), signature).unwrap();
    slots.write(0, module).unwrap();
    slots.finish().unwrap();
}

#[track_caller]
fn holds(flash: &Flash, at: usize, name: &str) {
    let expected = &golden()[name];
    assert_eq!(&flash.bytes[at..at + expected.len()], &expected[..], "{name}");
}

#[test]
fn what_is_signed_and_by_whom() {
    let golden = golden();
    assert_eq!(key_id(&public()[0])[..], golden["key-id"]);
    let signed = ToBeSigned::new(1_000, &Sha256::digest(module()).into());
    assert_eq!(signed.as_bytes(), golden["signed"]);
    // The longest number has its room too.
    let longest = ToBeSigned::new(u32::MAX, &[0xFF; 32]);
    assert!(
        longest.as_bytes().starts_with(
            b"DSSEv1 36 application/vnd.softplug.plugin+json 97 {\"length\":4294967295,"
        )
    );
}

#[test]
fn a_life_writes_these_bytes() {
    let mut flash = Flash::new(DEVICE);
    let mut slots = Slots::open(&mut flash, options()).unwrap();
    download(&mut slots, &module(), None);
    slots.start_trial().unwrap();
    slots.boot();
    slots.boot();
    slots.confirm().unwrap();
    download(&mut slots, &module()[1..], None);
    slots.start_trial().unwrap();
    slots.boot();
    slots.confirm().unwrap();
    slots.begin(5, [5; 32], None).unwrap();
    holds(&flash, 0, "header/unsigned");
    assert_eq!(
        flash.bytes[MODULE..MODULE + 8],
        [0xFF; 8],
        "the slot is erased for the third module"
    );
    let names = ["written", "trial", "attempt", "attempt/second", "confirmed"];
    for (number, name) in names.into_iter().enumerate() {
        holds(&flash, RECORDS + 16 * number, &format!("record/{name}"));
    }
    holds(&flash, RECORDS + 16 * 5, "record/retired");
    // The third header is in the other area.
    assert_eq!(flash.bytes[4_096..4_104], *b"SPLGSLOT");
    assert_eq!(flash.bytes[RECORDS + 16 * 6..4_096], [0xFF; 4_096 - RECORDS - 16 * 6]);
}

#[test]
fn failures_write_these_bytes() {
    let three_attempts = |flash: &mut Flash| {
        let mut slots = Slots::open(flash, options()).unwrap();
        download(&mut slots, &module(), None);
        slots.start_trial().unwrap();
        slots.boot();
        slots.boot();
    };
    let fifth = RECORDS + 16 * 5;
    let mut flash = Flash::new(DEVICE);
    three_attempts(&mut flash);
    let mut told = flash.clone();
    let mut slots = Slots::open(&mut told, options()).unwrap();
    slots.boot();
    slots.fail().unwrap();
    holds(&told, fifth, "record/failed/told");
    let mut used_up = flash.clone();
    let mut slots = Slots::open(&mut used_up, options()).unwrap();
    slots.boot();
    assert_eq!(slots.boot().run, Run::Nothing);
    holds(&used_up, fifth, "record/failed/attempts-used-up");
    let mut unfit = flash.clone();
    unfit.bytes[MODULE + 999] ^= 1;
    assert_eq!(Slots::open(&mut unfit, options()).unwrap().boot().run, Run::Nothing);
    holds(&unfit, fifth, "record/failed/unfit");
    let mut other = Flash::new(DEVICE);
    let mut slots = Slots::open(&mut other, options()).unwrap();
    slots.begin(1_000, digest(&module()), None).unwrap();
    slots.write(0, &[0; 1_000]).unwrap();
    slots.finish().unwrap_err();
    holds(&other, RECORDS, "record/failed/digest");
}

#[test]
fn a_signed_module_writes_these_bytes() {
    let mut flash = Flash::new(DEVICE);
    let keys = public();
    let options = Options { trust: Trust::unsigned_too(&keys), ..options() };
    let mut slots = Slots::open(&mut flash, options).unwrap();
    download(&mut slots, b"the one before", None);
    slots.start_trial().unwrap();
    slots.boot();
    slots.confirm().unwrap();
    download(&mut slots, &module(), Some(signature()));
    holds(&flash, B, "header/signed");
    assert_eq!(flash.bytes[B + MODULE..B + MODULE + 1_000], module());
}

/// A device whose slot A has this header, these records and the module.
fn device(header: &str, records: &[&str]) -> Flash {
    let golden = golden();
    let mut bytes = vec![0xFF; DEVICE.size as usize];
    let slot = if header == "header/signed" { B } else { 0 };
    let mut put =
        |at: usize, new: &[u8]| bytes[slot + at..slot + at + new.len()].copy_from_slice(new);
    put(0, &golden[header]);
    put(MODULE, &module());
    for (number, name) in records.iter().enumerate() {
        put(RECORDS + 16 * number, &golden[&*format!("record/{name}")]);
    }
    Flash::with(DEVICE, bytes)
}

#[test]
fn these_bytes_are_read() {
    let whole = ["written", "trial", "attempt", "attempt/second", "confirmed"];
    let states = [
        State::Writing,
        State::Written,
        State::Trial { attempts: 0, of: 3 },
        State::Trial { attempts: 1, of: 3 },
        State::Trial { attempts: 2, of: 3 },
        State::Confirmed,
    ];
    for (count, state) in states.into_iter().enumerate() {
        let mut flash = device("header/unsigned", &whole[..count]);
        let mut slots = Slots::open(&mut flash, options()).unwrap();
        let held = slots.held(Slot::A).unwrap();
        assert_eq!((held.state, held.generation, held.length), (state, 1, 1_000));
        assert_eq!(held.digest, digest(&module()));
        assert_eq!(slots.boot().run.module().is_some(), count > 1, "{state:?}");
    }
}

#[test]
fn a_record_of_another_place_or_generation_says_nothing() {
    // The record's place in the list is not where it says.
    let mut flash = device("header/unsigned", &["trial"]);
    let slots = Slots::open(&mut flash, options()).unwrap();
    assert_eq!(slots.held(Slot::A).unwrap().state, State::Writing);
    let mut flash =
        device("header/signed", &["written", "trial", "attempt", "attempt/second", "confirmed"]);
    let keys = public();
    let options = Options { trust: Trust::signed(&keys), ..options() };
    let mut slots = Slots::open(&mut flash, options).unwrap();
    let held = slots.held(Slot::B).unwrap();
    assert_eq!((held.state, held.key), (State::Writing, Some(signature().key)));
    assert_eq!(
        slots.boot().passed_over,
        [Some(PassedOver::NoModule), Some(PassedOver::Unfinished)]
    );
    assert_eq!((slots.erases(Slot::A), slots.erases(Slot::B)), (1, 1));
}

#[test]
fn the_page_shows_these_bytes() {
    let page = include_str!("../../../../../docs/unit/slots.md");
    let shown = page.split_once("## Golden bytes").unwrap().1;
    let blocks: Vec<String> = shown
        .split("```text\n")
        .skip(1)
        .map(|block| block.split("```").next().unwrap().replace('\n', ""))
        .collect();
    let names: Vec<&str> = shown
        .lines()
        .filter_map(|line| line.strip_prefix('`')?.strip_suffix('`'))
        .filter(|name| !name.is_empty() && !name.starts_with('`'))
        .collect();
    let shown: Vec<String> =
        names.iter().zip(&blocks).map(|(name, hex)| format!("{name} {hex}")).collect();
    let frozen: Vec<&str> = TEXT.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(shown, frozen);
    assert_eq!(frozen.len(), 16);
}
