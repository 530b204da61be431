//! Numbers of reactions, and what they mean.

use softplug_abi::Failure;

pub(super) const GOOD: u8 = 0x00;
pub(super) const HEADER: u8 = 0x10;
pub(super) const COMMAND: u8 = 0x16;
pub(super) const AREA: u8 = 0x0C;
pub(super) const LENGTH: u8 = 0x34;
pub(super) const SEQUENCE: u8 = 0x36;
pub(super) const STOP: u8 = 0x2A;

/// Why a job has failed.
pub(super) fn failure(number: u8) -> Option<Failure> {
    Some(match number {
        0x0A | 0x0C | 0x12 | 0x34 => Failure::BadJob,
        0x10 | 0x16 => Failure::NotSupported,
        0x14 => Failure::NotFound,
        0x2A | 0x32 => Failure::Refused,
        0x36 => Failure::Protocol,
        // The page has no others, and does not say as what they fail.
        _ => return None,
    })
}

/// As what a number may fail that the page does not have.
pub(super) const UNKNOWN: &[Failure] =
    &[Failure::Protocol, Failure::Refused, Failure::BadJob, Failure::NotSupported];

/// What the partner is told of a refusal.
pub(super) fn of_refusal(failure: Failure) -> u8 {
    match failure {
        Failure::NotFound => 0x14,
        Failure::Denied => 0x0A,
        Failure::Busy => 0x32,
        Failure::NotSupported => HEADER,
        Failure::BadJob | Failure::TooLong => LENGTH,
        // All else.
        _ => STOP,
    }
}
