//! Makes a failing session short.

use crate::drive::{Ran, Step};
use crate::model::{Given, HostRequest, LineInput};
use softplug_abi::Micros;

/// Runs that are tried at most.
const RUNS: usize = 600;
/// Steps and effects of all of them, at most: a long session is not made as short as can be.
const WORK: usize = 4_000_000;

/// Leaves out as many steps as it can, then bytes, as long as the session fails in
/// the same way.
pub(crate) fn shrink(ran: Ran, mut run: impl FnMut(&[(Micros, Step)], Micros) -> Ran) -> Ran {
    let Some(finding) = ran.finding.clone() else { return ran };
    let mut best = ran;
    let (mut left, mut work) = (RUNS, 0);
    let mut try_steps = |steps: &[(Micros, Step)], best: &mut Ran| {
        if left == 0 || work > WORK {
            return false;
        }
        left -= 1;
        let ran = run(steps, best.end);
        work += ran.steps.len() + ran.observed.len();
        let fails = ran.finding.as_ref().is_some_and(|other| other.is_like(&finding));
        if fails {
            *best = ran;
        }
        fails
    };
    // The first step opens the link.
    let mut size = best.steps.len() / 2;
    while size > 0 {
        let mut at = 1;
        while at < best.steps.len() {
            let to = (at + size).min(best.steps.len());
            let steps = [&best.steps[..at], &best.steps[to..]].concat();
            if !try_steps(&steps, &mut best) {
                at = to;
            }
        }
        size /= 2;
    }
    let mut at = 1;
    while at < best.steps.len() {
        let mut steps = best.steps.clone();
        let is_shorter = bytes_of(&mut steps[at].1).is_some_and(|bytes| {
            let length = bytes.len();
            bytes.truncate(length / 2);
            length > 1
        });
        if !(is_shorter && try_steps(&steps, &mut best)) {
            at += 1;
        }
    }
    best
}

fn bytes_of(step: &mut Step) -> Option<&mut Vec<u8>> {
    match step {
        Step::Given(
            Given::Line(LineInput::Bytes(bytes))
            | Given::Host(HostRequest::Job { data: bytes, .. }),
        ) => Some(bytes),
        _ => None,
    }
}
