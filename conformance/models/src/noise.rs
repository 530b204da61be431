//! What goes wrong on a line and what hosts do in between.

use crate::dice::Dice;
use crate::drive::Step;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use softplug_abi::{LineErrorKind, LinkDownReason, Micros};
use std::collections::VecDeque;

/// Characters that one event can hold in a plug-in of the SDK.
const EVENT: usize = 1_040;

/// How much of it there is in a session.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    /// One step in so many is disturbed; 0: none.
    rate: u64,
    /// The plug-in is swapped at one step in so many; 0: never.
    pub(crate) swaps: u64,
    /// The link goes at one step in so many and comes back; 0: never.
    pub(crate) cycles: u64,
    /// One of so many times the host closes it; 0: never.
    pub(crate) closes: u64,
    /// A timer is met at one step in so many; 0: never.
    timers: u64,
    special: &'static [u8],
    /// The last job that was begun, or the first that will be.
    job: u32,
    /// Come before what the model proposes next.
    next: VecDeque<Proposal>,
    /// The next swap is at the instant of what was given last, and so is what follows it.
    swaps_now: bool,
}

impl Noise {
    /// Little of it in a long session.
    pub(crate) fn draw(dice: &mut Dice, special: &'static [u8], is_long: bool) -> Self {
        let rate = *dice.pick(if is_long { &[0, 0, 2_000] } else { &[0, 0, 50, 20, 6] });
        let swaps = *dice.pick(if is_long { &[0, 500] } else { &[0, 3, 17] });
        let cycles = if !is_long && dice.one_in(40) { 4 } else { 0 };
        let closes = *dice.pick(&[0, 0, 4, 1]);
        // Something very long does not go on behind a timer that has run out.
        let timers = if is_long { *dice.pick(&[0, 10_000]) } else { 24 };
        Self {
            rate,
            swaps,
            cycles,
            closes,
            timers,
            special,
            job: 1,
            next: VecDeque::new(),
            swaps_now: false,
        }
    }

    /// What is really given: what was proposed, or something else. `deadline` is
    /// when the model is due next.
    pub(crate) fn disturb(
        &mut self,
        proposal: Proposal,
        now: Micros,
        deadline: Option<Micros>,
        dice: &mut Dice,
    ) -> (Micros, Step) {
        if std::mem::take(&mut self.swaps_now) {
            return (Micros::ZERO, Step::Swap);
        }
        let is_rest = self.next.front().is_some_and(|next| next.wait == Micros::ZERO);
        let mut proposal = self.next.pop_front().unwrap_or(proposal);
        if is_rest {
            return (Micros::ZERO, Step::Given(proposal.given));
        }
        if let Given::Host(HostRequest::Job { id, .. }) = &proposal.given {
            self.job = *id;
        }
        if self.swaps > 0 && dice.one_in(self.swaps) {
            if let Given::Line(LineInput::Bytes(bytes)) = &mut proposal.given
                && bytes.len() > 1
                && dice.one_in(2)
            {
                let rest = bytes.split_off(dice.between(1, bytes.len() as i64 - 1) as usize);
                let given = Given::Line(LineInput::Bytes(rest));
                self.next.push_front(Proposal { wait: Micros::ZERO, given });
                self.swaps_now = true;
                return (proposal.wait.max(Micros(1)), Step::Given(proposal.given));
            }
            self.next.push_front(proposal);
            return (Micros(1), Step::Swap);
        }
        if self.cycles > 0 && dice.one_in(self.cycles) {
            return self.cycle(proposal, dice);
        }
        if self.rate > 0 && dice.one_in(self.rate) {
            proposal = self.disturbed(proposal, dice);
        }
        // Timers are met exactly, a tick early and a tick late.
        if let Some(deadline) = deadline.filter(|_| self.timers > 0 && dice.one_in(self.timers)) {
            let wait = (deadline - now).0 + dice.between(-1, 1);
            proposal.wait = Micros(wait);
        }
        (proposal.wait.max(Micros(1)), Step::Given(proposal.given))
    }

    /// Something is said, the link goes, and it comes back.
    fn cycle(&mut self, proposal: Proposal, dice: &mut Dice) -> (Micros, Step) {
        let ends: [(Given, Given); 2] = [
            (Given::Line(LineInput::Down(LinkDownReason::Unplugged)), Given::Line(LineInput::Up)),
            (Given::Host(HostRequest::Close), Given::Host(HostRequest::Open)),
        ];
        let (goes, comes) = ends[usize::from(self.closes > 0 && dice.one_in(self.closes))].clone();
        let mut soon = |given| Proposal { wait: Micros(dice.between(1, 5_000)), given };
        let steps = [soon(goes), soon(comes), proposal];
        steps.into_iter().rev().for_each(|step| self.next.push_front(step));
        // What stands first stops and lets go.
        let first = if dice.one_in(2) { self.special.len().min(4) } else { self.special.len() };
        let said = Given::Line(LineInput::Bytes(vec![*dice.pick(&self.special[..first])]));
        (Micros(dice.between(1, 20_000)), Step::Given(said))
    }

    fn disturbed(&mut self, proposal: Proposal, dice: &mut Dice) -> Proposal {
        if let Given::Line(LineInput::Bytes(bytes)) = &proposal.given
            && !bytes.is_empty()
            && !dice.one_in(3)
        {
            let given = damaged(bytes.clone(), dice);
            return Proposal { wait: proposal.wait, given };
        }
        let wait = Micros(dice.between(1, 20_000));
        let given = self.intrusion(dice);
        if given == Given::Line(LineInput::Down(LinkDownReason::Unplugged)) {
            let wait = Micros(dice.between(1, 5_000_000));
            self.next.push_front(Proposal { wait, given: Given::Line(LineInput::Up) });
        } else if given == Given::Host(HostRequest::Close) {
            let wait = Micros(dice.between(1, 5_000_000));
            self.next.push_front(Proposal { wait, given: Given::Host(HostRequest::Open) });
        } else {
            self.next.push_front(proposal);
        }
        Proposal { wait, given }
    }

    /// An error of one of the last characters, which were given already.
    fn of_given(&self, dice: &mut Dice) -> LineInput {
        let byte = if dice.one_in(2) { Some(*dice.pick(self.special)) } else { None };
        let kind = if dice.one_in(5) { LineErrorKind::Overrun } else { *dice.pick(&DAMAGE) };
        LineInput::Damaged { kind, byte, span: dice.between(1, 40) as u32 }
    }

    fn intrusion(&self, dice: &mut Dice) -> Given {
        let line = |input| Given::Line(input);
        let host = |request| Given::Host(request);
        if dice.one_in(40) {
            return line(LineInput::Bytes(burst(&[*dice.pick(self.special)], dice)));
        }
        if dice.one_in(30) {
            return line(self.of_given(dice));
        }
        match dice.below(16) {
            0..=3 => line(LineInput::Bytes(vec![*dice.pick(self.special)])),
            4 => line(LineInput::Bytes(vec![dice.byte()])),
            5 => line(LineInput::Bytes((0..dice.length(80)).map(|_| dice.byte()).collect())),
            6 => line(LineInput::Damaged { kind: LineErrorKind::Break, byte: None, span: 0 }),
            7 => line(LineInput::Damaged { kind: LineErrorKind::Overrun, byte: None, span: 0 }),
            8 => line(LineInput::Down(LinkDownReason::Unplugged)),
            9 => host(HostRequest::Close),
            10 => host(HostRequest::Pause(self.job)),
            11 | 12 => host(HostRequest::Resume(self.job)),
            13 => host(HostRequest::Abort(self.job)),
            14 => host(HostRequest::Abort(0)),
            _ => host(HostRequest::ForceResume),
        }
    }
}

/// What a port says of a damaged character.
const DAMAGE: [LineErrorKind; 3] =
    [LineErrorKind::Parity, LineErrorKind::Framing, LineErrorKind::ParityOrFraming];

/// The same again and again, up to all that one event can hold.
fn burst(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    let length = *dice.pick(&[EVENT, EVENT, EVENT / 2, EVENT / 8]);
    bytes.repeat((length / bytes.len()).max(1))
}

/// Characters as a bad line brings them: a bit turned, one lost, one twice, or one
/// that the port saw was bad; or all of them again and again.
fn damaged(mut bytes: Vec<u8>, dice: &mut Dice) -> Given {
    if dice.one_in(40) {
        return Given::Line(LineInput::Bytes(burst(&bytes, dice)));
    }
    let at = dice.below(bytes.len() as u64) as usize;
    match dice.below(5) {
        0 => bytes[at] ^= 1 << dice.below(8),
        1 => drop(bytes.remove(at)),
        2 => bytes.insert(at, bytes[at]),
        3 => bytes.truncate(at),
        _ => {
            let kind = *dice.pick(&DAMAGE);
            return Given::Line(LineInput::Damaged { kind, byte: Some(bytes[at]), span: 0 });
        }
    }
    Given::Line(LineInput::Bytes(bytes))
}
