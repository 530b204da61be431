//! Sessions that nobody judges: made of the steps of others, changed without regard to what
//! makes sense. Two modules that do the same in all of them are hardly different.

use crate::dice::Dice;
use crate::drive::Step;
use crate::model::{Broken, Effect, Given, HostRequest, LineInput, Model, Proposal};
use softplug_abi::{Failure, LineErrorKind, LinkDownReason, Micros};

/// Most steps of one.
const MOST: usize = 600;

/// Steps of `own`, some of `other`'s among them, more, fewer and at other times.
pub(crate) fn crossed(
    own: &[(Micros, Step)],
    other: &[(Micros, Step)],
    special: &[u8],
    dice: &mut Dice,
) -> Vec<(Micros, Step)> {
    let (mut steps, other) = (waits(own), waits(other));
    for _ in 0..dice.between(1, 8) {
        change(&mut steps, &other, special, dice);
        steps.truncate(MOST);
    }
    let mut jobs = 0;
    let mut now = Micros::ZERO;
    for (wait, step) in &mut steps {
        now = now + *wait;
        *wait = now;
        number(step, &mut jobs);
    }
    steps
}

/// Steps, each with the time since the one before.
fn waits(steps: &[(Micros, Step)]) -> Vec<(Micros, Step)> {
    let mut last = Micros::ZERO;
    let wait =
        |(at, step): &(Micros, Step)| (*at - std::mem::replace(&mut last, *at), step.clone());
    steps.iter().map(wait).collect()
}

/// No id is used twice; what was asked of a job is asked of the last one.
fn number(step: &mut Step, jobs: &mut u32) {
    match step {
        Step::Given(Given::Host(HostRequest::Job { id, .. })) => {
            *jobs += 1;
            *id = *jobs;
        }
        Step::Given(Given::Host(
            HostRequest::Pause(id) | HostRequest::Resume(id) | HostRequest::Abort(id),
        )) if *id > 0 => *id = (*jobs).max(1),
        Step::Given(_) | Step::Swap => {}
    }
}

fn change(
    steps: &mut Vec<(Micros, Step)>,
    other: &[(Micros, Step)],
    special: &[u8],
    dice: &mut Dice,
) {
    // The first one opens the link.
    let at = 1 + dice.below(steps.len().saturating_sub(1) as u64) as usize;
    let end = (at + dice.length(20).max(1)).min(steps.len());
    match dice.below(12) {
        0 => {
            let from = dice.below(other.len() as u64) as usize;
            steps.truncate(at);
            steps.extend_from_slice(&other[from..]);
        }
        1 => {
            let from = dice.below(other.len() as u64) as usize;
            let to = (from + dice.length(30).max(1)).min(other.len());
            steps.splice(at.min(steps.len())..at.min(steps.len()), other[from..to].to_vec());
        }
        2 if at < end => drop(steps.drain(at..end)),
        3 if at < end => {
            let part = vec![steps[at..end].to_vec(); dice.between(1, 4) as usize].concat();
            steps.splice(at..at, part);
        }
        4 if at < end => {
            let wait = Micros(*dice.pick(&[0, 0, 1, 100]));
            steps[at..end].iter_mut().for_each(|(own, _)| *own = wait);
        }
        5 if at < end => {
            let wait = *dice.pick(&[1_000, 50_000, 250_000, 1_000_000, 5_000_000, 600_000_000]);
            steps[at].0 = Micros(wait + dice.between(-1, 1));
        }
        6 => join(steps, at),
        7 => part(steps, at, special, dice),
        8 | 9 => {
            if let Some((_, step)) = steps.get_mut(at) {
                spoil(step, special, dice);
            }
        }
        _ => {
            let wait = Micros(*dice.pick(&[0, 0, 1, 300, 20_000]));
            steps.insert(at.min(steps.len()), (wait, intrusion(special, dice)));
        }
    }
}

/// What came apart comes in one event.
fn join(steps: &mut Vec<(Micros, Step)>, at: usize) {
    let Some((_, Step::Given(Given::Line(LineInput::Bytes(second))))) = steps.get(at) else {
        return;
    };
    let second = second.clone();
    let before = steps.get_mut(at.wrapping_sub(1)).map(|(_, step)| step);
    if let Some(Step::Given(Given::Line(LineInput::Bytes(first)))) = before {
        first.extend(second);
        steps.remove(at);
    }
}

/// What came together comes apart, with something between.
fn part(steps: &mut Vec<(Micros, Step)>, at: usize, special: &[u8], dice: &mut Dice) {
    let Some((_, Step::Given(Given::Line(LineInput::Bytes(bytes))))) = steps.get_mut(at) else {
        return;
    };
    let rest = bytes.split_off(dice.below(bytes.len() as u64) as usize);
    let wait = Micros(*dice.pick(&[0, 1, 1_000]));
    steps.insert(at + 1, (wait, intrusion(special, dice)));
    steps.insert(at + 2, (wait, Step::Given(Given::Line(LineInput::Bytes(rest)))));
}

/// Other bytes on the line or in a program.
fn spoil(step: &mut Step, special: &[u8], dice: &mut Dice) {
    let bytes = match step {
        Step::Given(Given::Line(LineInput::Bytes(bytes))) => bytes,
        Step::Given(Given::Host(HostRequest::Job { data, .. })) => data,
        Step::Given(_) | Step::Swap => return,
    };
    if bytes.is_empty() {
        bytes.push(*dice.pick(special));
        return;
    }
    let at = dice.below(bytes.len() as u64) as usize;
    match dice.below(6) {
        0 => bytes[at] = *dice.pick(special),
        1 => bytes[at] = dice.byte(),
        2 => bytes.truncate(at),
        3 => bytes.insert(at, *dice.pick(special)),
        4 => drop(bytes.remove(at)),
        _ => {
            let more = bytes[at..].repeat(dice.between(1, 3) as usize);
            bytes.extend(more);
        }
    }
}

fn intrusion(special: &[u8], dice: &mut Dice) -> Step {
    let damaged = |kind, byte, span| LineInput::Damaged { kind, byte, span };
    let line = |input| Step::Given(Given::Line(input));
    let host = |request| Step::Given(Given::Host(request));
    match dice.below(20) {
        0..=3 => line(LineInput::Bytes(vec![*dice.pick(special)])),
        4 => line(LineInput::Bytes((0..dice.length(40)).map(|_| *dice.pick(special)).collect())),
        5 => line(damaged(LineErrorKind::Parity, Some(*dice.pick(special)), 0)),
        6 => line(damaged(LineErrorKind::Break, None, 0)),
        7 => line(damaged(LineErrorKind::Overrun, None, 0)),
        8 => line(LineInput::Down(LinkDownReason::Unplugged)),
        9 => line(LineInput::Up),
        10 => host(HostRequest::Close),
        11 => host(HostRequest::Open),
        12 => host(HostRequest::Pause(1)),
        13 => host(HostRequest::Resume(1)),
        14 => host(HostRequest::Abort(1)),
        15 => host(HostRequest::Abort(0)),
        16 => host(HostRequest::ForceResume),
        17 => host(HostRequest::Keep),
        18 => match dice.below(3) {
            0 => host(HostRequest::PutAllAway),
            1 => host(HostRequest::PutAway(dice.length(3_000) as u32)),
            _ => host(HostRequest::Answer(1, Err(Failure::NotFound))),
        },
        _ => Step::Swap,
    }
}

/// A model that has nothing to say.
pub(crate) struct Silent;

impl Model for Silent {
    fn line(&mut self, _at: Micros, _input: &LineInput) {}

    fn left(&mut self, _at: Micros, _byte: u8) {}

    fn due(&mut self, _at: Micros) {}

    fn host(&mut self, _at: Micros, _request: &HostRequest) {}

    fn seen(&mut self, _at: Micros, _effect: &Effect) -> Result<(), Broken> {
        Ok(())
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        Ok(())
    }

    fn next(&self) -> Option<Micros> {
        None
    }

    fn propose(&self, _now: Micros, _dice: &mut Dice) -> Proposal {
        Proposal { wait: Micros(1), given: Given::Nothing }
    }

    fn fork(&self) -> Box<dyn Model> {
        Box::new(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(text: &str) -> Step {
        Step::Given(Given::Line(LineInput::Bytes(text.into())))
    }

    #[test]
    fn crossed_sessions_open_first_go_forward_and_use_no_job_twice() {
        let open = Step::Given(Given::Host(HostRequest::Open));
        let job = |id| {
            let (kind, data) = ("send".to_owned(), b"G1 X1".to_vec());
            Step::Given(Given::Host(HostRequest::Job { id, kind, fields: Vec::new(), data }))
        };
        let own = [(Micros(0), open.clone()), (Micros(5), job(1)), (Micros(9), bytes("AB"))];
        let other = [(Micros(0), open.clone()), (Micros(2), job(1)), (Micros(7), bytes("C"))];
        for number in 0..500 {
            let mut dice = Dice::new(1, "xon-xoff", number);
            let steps = crossed(&own, &other, &[0x11, 0x13], &mut dice);
            assert_eq!(steps[0], (Micros(0), open.clone()));
            assert!(steps.is_sorted_by_key(|(at, _)| *at), "{steps:?}");
            let jobs = steps.iter().filter_map(|(_, step)| match step {
                Step::Given(Given::Host(HostRequest::Job { id, .. })) => Some(*id),
                _ => None,
            });
            assert!(
                jobs.eq(1..=steps
                    .iter()
                    .filter(|(_, step)| {
                        matches!(step, Step::Given(Given::Host(HostRequest::Job { .. })))
                    })
                    .count() as u32)
            );
        }
    }
}
