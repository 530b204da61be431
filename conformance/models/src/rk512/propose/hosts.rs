//! Answers of the host.

use super::value;
use crate::dice::Dice;
use crate::model::HostRequest;
use crate::rk512::series::Request;
use crate::rk512::telegram::Kind;
use softplug_abi::Failure;

/// Failures, those with a number of their own first.
const FAILURES: &[Failure] = &[
    Failure::NotFound,
    Failure::Denied,
    Failure::Busy,
    Failure::NotSupported,
    Failure::BadJob,
    Failure::TooLong,
    Failure::Aborted,
    Failure::NoAnswer,
    Failure::Refused,
    Failure::Protocol,
    Failure::LinkDown,
    Failure::Internal,
    Failure::NoBuffer,
    Failure::UnsupportedCharacter,
];

/// What was asked for.
pub(super) fn good(request: &Request) -> HostRequest {
    let length = if request.kind == Kind::Fetch { request.part } else { 0 };
    HostRequest::Answer(id_of(request), Ok(vec![0x11; length]))
}

/// No host answers before it has seen a request.
fn id_of(request: &Request) -> u32 {
    request.id.unwrap_or_default()
}

/// An answer, mostly one that fits.
pub(super) fn answer(request: &Request, dice: &mut Dice) -> HostRequest {
    let id = id_of(request) + u32::from(dice.one_in(100));
    if dice.one_in(8) {
        return HostRequest::Answer(id, Err(*dice.pick(FAILURES)));
    }
    let length = match (request.kind, dice.below(30)) {
        (Kind::Send, 0) => dice.below(10) as usize,
        (Kind::Send, _) | (Kind::Fetch, 0) => 0,
        (Kind::Fetch, 1) => request.part + 1,
        (Kind::Fetch, 2) => request.part - 1,
        (Kind::Fetch, 3) => dice.length(20_000),
        (Kind::Fetch, _) => request.part,
    };
    HostRequest::Answer(id, Ok((0..length).map(|_| value(dice)).collect()))
}
