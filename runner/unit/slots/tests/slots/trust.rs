//! Whose plug-ins a unit takes.

use crate::bench::{NOR, digest, options};
use crate::flash::Flash;
use ed25519_dalek::{Signer, SigningKey};
use softplug_unit_slots::{
    Begun, Error, Options, PassedOver, Refusal, Run, SetUpError, Signature, Slots, ToBeSigned,
    Trust, Unfit, key_id,
};

fn key(number: u8) -> SigningKey {
    SigningKey::from_bytes(&[number; 32])
}

fn public(number: u8) -> [u8; 32] {
    key(number).verifying_key().to_bytes()
}

fn sign(number: u8, module: &[u8]) -> Signature {
    let signed = ToBeSigned::new(module.len() as u32, &digest(module));
    Signature {
        key: key_id(&public(number)),
        bytes: key(number).sign(signed.as_bytes()).to_bytes(),
    }
}

const MODULE: &[u8] = b"some module or other";

fn begin(
    flash: &mut Flash,
    trust: Trust<'_>,
    signature: Option<Signature>,
) -> Result<Begun, Refusal> {
    let mut slots = Slots::open(flash, Options { trust, ..options() }).unwrap();
    slots.begin(MODULE.len() as u32, digest(MODULE), signature).map_err(|error| match error {
        Error::Refused(refusal) => refusal,
        error => panic!("{error}"),
    })
}

#[test]
fn without_a_good_signature_nothing_is_written() {
    let keys = [public(1), public(2)];
    let mut flash = Flash::new(NOR);
    let other_length = {
        let signed = ToBeSigned::new(MODULE.len() as u32 + 1, &digest(MODULE));
        Signature { key: key_id(&public(1)), bytes: key(1).sign(signed.as_bytes()).to_bytes() }
    };
    let wrong_name = Signature { key: key_id(&public(2)), ..sign(1, MODULE) };
    for trust in [Trust::signed(&keys), Trust::unsigned_too(&keys)] {
        for (signature, refusal) in [
            (sign(3, MODULE), Refusal::UnknownKey),
            (sign(1, b"another module"), Refusal::Signature),
            (other_length, Refusal::Signature),
            (wrong_name, Refusal::Signature),
        ] {
            assert_eq!(begin(&mut flash, trust, Some(signature)), Err(refusal));
        }
    }
    assert_eq!(begin(&mut flash, Trust::signed(&keys), None), Err(Refusal::Unsigned));
    assert_eq!(flash.done, []);
    for number in [1, 2] {
        let mut flash = Flash::new(NOR);
        assert!(begin(&mut flash, Trust::signed(&keys), Some(sign(number, MODULE))).is_ok());
    }
    assert!(begin(&mut flash, Trust::unsigned_too(&keys), None).is_ok());
}

fn confirmed(flash: &mut Flash, trust: Trust<'_>, signature: Option<Signature>) {
    let mut slots = Slots::open(flash, Options { trust, ..options() }).unwrap();
    slots.begin(MODULE.len() as u32, digest(MODULE), signature).unwrap();
    slots.write(0, MODULE).unwrap();
    slots.finish().unwrap();
    slots.start_trial().unwrap();
    slots.boot();
    slots.confirm().unwrap();
}

#[test]
fn a_key_that_is_gone_runs_nothing_and_a_new_signature_helps() {
    let (old, new) = ([public(1)], [public(2)]);
    let mut flash = Flash::new(NOR);
    confirmed(&mut flash, Trust::signed(&old), Some(sign(1, MODULE)));
    let mut slots =
        Slots::open(&mut flash, Options { trust: Trust::signed(&new), ..options() }).unwrap();
    let boot = slots.boot();
    assert_eq!(boot.run, Run::Nothing);
    let unfit = Unfit::Refused(Refusal::UnknownKey);
    assert_eq!(boot.passed_over[0], Some(PassedOver::Unfit(unfit)));
    // The same module with a key that is known is no module that is there already.
    let begun = slots.begin(MODULE.len() as u32, digest(MODULE), Some(sign(2, MODULE))).unwrap();
    assert!(matches!(begun, Begun::Fresh { .. }), "{begun:?}");
}

#[test]
fn an_unsigned_module_does_not_run_where_signatures_are_demanded() {
    let keys = [public(1)];
    let mut flash = Flash::new(NOR);
    confirmed(&mut flash, Trust::unsigned_too(&[]), None);
    let mut slots =
        Slots::open(&mut flash, Options { trust: Trust::signed(&keys), ..options() }).unwrap();
    assert_eq!(slots.boot().run, Run::Nothing);
}

/// Somebody changes module, digest and length in the memory, and makes all check sums right.
#[test]
fn a_changed_memory_runs_nothing() {
    let keys = [public(1)];
    let mut flash = Flash::new(NOR);
    confirmed(&mut flash, Trust::signed(&keys), Some(sign(1, MODULE)));
    let header = flash.bytes[..192].to_vec();
    let area = flash.bytes.chunks(4).position(|bytes| bytes == &MODULE[..4]).unwrap() * 4;
    let mut changed = header.clone();
    flash.bytes[area] ^= 1;
    let new = digest(&flash.bytes[area..area + MODULE.len()]);
    changed[40..72].copy_from_slice(&new);
    let crc = crc32(&changed[..188]);
    changed[188..].copy_from_slice(&crc.to_le_bytes());
    flash.bytes[..192].copy_from_slice(&changed);
    let mut slots =
        Slots::open(&mut flash, Options { trust: Trust::signed(&keys), ..options() }).unwrap();
    let unfit = Unfit::Refused(Refusal::Signature);
    assert_eq!(slots.boot().passed_over[0], Some(PassedOver::Unfit(unfit)));
}

/// By the polynomial's definition, bit by bit.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        for bit in 0..8 {
            let out = (crc ^ u32::from(byte >> bit)) & 1;
            crc >>= 1;
            if out == 1 {
                crc ^= 0xEDB8_8320;
            }
        }
    }
    !crc
}

#[test]
fn keys_that_could_never_do_are_refused() {
    let mut weak = [0; 32];
    weak[0] = 1;
    // Half of all numbers are no point of the curve.
    let none = (2..99)
        .map(|number| [number; 32])
        .find(|key| ed25519_dalek::VerifyingKey::from_bytes(key).is_err());
    let (second_weak, no_point) = ([public(1), weak], [none.unwrap()]);
    let open = |trust| match Slots::open(Flash::new(NOR), Options { trust, ..options() }) {
        Err(Error::SetUp(error)) => error,
        other => panic!("{other:?}"),
    };
    assert_eq!(open(Trust::signed(&[])), SetUpError::NoKeys);
    assert_eq!(open(Trust::signed(&second_weak)), SetUpError::Key { number: 1 });
    assert_eq!(open(Trust::unsigned_too(&no_point)), SetUpError::Key { number: 0 });
}
