//! The memory of a front-end unit: two slots for plug-ins in a flash memory or EEPROM.
//!
//! A plug-in comes into the slot that is not needed, is looked at, run on trial and confirmed, or the unit goes
//! back to the one before. Whenever power fails, also in the middle of a write or an erasure, the unit finds the old
//! plug-in or the new one afterwards, whole and sound. `docs/unit/slots.md` has every byte of it.
//!
//! [`Slots`] is all of it. It needs a [`Device`], no allocator, and about two kilobytes of stack beside what
//! the verification of a signature takes.
#![no_std]
#![cfg_attr(not(feature = "std"), forbid(unsafe_code))]
// With `std` one file has some, and says why: mtd.rs.

#[cfg(feature = "std")]
extern crate std;

mod access;
mod adapt;
mod crc;
mod device;
mod error;
#[cfg(feature = "std")]
mod file;
mod header;
mod layout;
#[cfg(all(feature = "std", target_os = "linux"))]
mod mtd;
mod ram;
mod record;
mod scan;
mod signature;
mod slot;
mod slots;
mod trust;

pub use self::adapt::{Eeprom, Flash, FlashError};
pub use self::device::{Device, Geometry, LARGEST_GRANULE};
pub use self::error::{Doing, Error, Fault, Refusal, SetUpError};
#[cfg(feature = "std")]
pub use self::file::FileDevice;
pub use self::header::FORMAT;
#[cfg(all(feature = "std", target_os = "linux"))]
pub use self::mtd::MtdDevice;
pub use self::ram::{Misuse, Ram};
pub use self::record::{Failure, MOST_ATTEMPTS, State};
pub use self::scan::{Content, Held};
pub use self::signature::Signature;
pub use self::slot::{LEAST_ROOM, LONGEST_MODULE, Slot};
pub use self::slots::{Begun, Boot, Module, Options, PassedOver, Run, Slots, Unfit};
pub use self::trust::{PAYLOAD_TYPE, ToBeSigned, Trust, key_id};
