//! 3964R, 3964 and simplified 3964R: one station, as the page tells it.
//!
//! A [`Station`] is in one [`State`] of the page's two diagrams. `sender` has what it
//! does with a job, `receiver` what it does with a block of the partner, `partner`
//! what a partner and a host could do next.

mod awaited;
mod frame;
mod layer;
mod outgoing;
mod parameters;
mod partner;
mod profiles;
mod receiver;
pub(crate) mod room;
mod rules;
mod sender;
mod state;

pub(crate) use layer::Report;
pub(crate) use partner::{Partner, Upper, bytes, host, line, nothing, soon};
pub(crate) use profiles::{PLAIN_3964, R3964, SIMPLIFIED};

use crate::dice::Dice;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Proposal};
use awaited::Awaited;
use frame::{NAK, STX};
use outgoing::{Outgoing, Part};
use parameters::Parameters;
use partner::Plain;
use room::Room;
use rules::{Procedure, Rule};
use softplug_abi::{Failure, LineErrorKind, Micros};
use state::{Job, Reception, State};
use std::cell::RefCell;

/// Why something failed: the failure, its status number and where that stands.
type Fault = (Failure, u16, Rule);

/// A character from the line.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Character {
    Good(u8),
    Damaged(Option<u8>),
}

/// One station of the two.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Station {
    parameters: Parameters,
    out: Outgoing,
    room: Room,
    state: State,
    job: Option<Job>,
    reception: Option<Reception>,
    /// Simplified without handshake: no STX before this after an abort.
    quiet: Quiet,
    /// A layer on top has no room for what may come.
    is_full: bool,
    /// A block that gave way has begun again, which a layer on top was not told.
    begun_again: bool,
    deliveries: u32,
    /// The last id of a job.
    jobs: u32,
    is_open: bool,
    is_down: bool,
    awaited: Awaited,
    partner: RefCell<Partner>,
}

/// Whether an STX has to wait after an abort.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Quiet {
    No,
    /// Our NAK with this mark has not left.
    Nak(u64),
    Until(Micros),
}

impl Station {
    fn start(procedure: Procedure, conditions: &Conditions) -> Option<Box<dyn Model>> {
        Some(Box::new(Self::new(procedure, conditions, conditions.delivery_room)?))
    }

    fn new(procedure: Procedure, conditions: &Conditions, room: u32) -> Option<Self> {
        let parameters = Parameters::new(procedure, conditions)?;
        Some(Self {
            out: Outgoing::new(conditions.line, conditions.depth),
            room: Room::new(room),
            parameters,
            state: State::Idle,
            job: None,
            reception: None,
            quiet: Quiet::No,
            is_full: false,
            begun_again: false,
            deliveries: 0,
            jobs: 0,
            is_open: false,
            is_down: false,
            awaited: Awaited::default(),
            partner: RefCell::new(Partner::new(conditions)),
        })
    }

    fn clause(&self) -> impl Fn(Rule) -> &'static str + use<> {
        let procedure = self.parameters.procedure;
        move |rule| procedure.clause(rule)
    }

    fn broken(&self, rule: Rule, message: impl Into<String>) -> Broken {
        Broken::new(self.parameters.procedure.clause(rule), message)
    }

    fn character(&mut self, at: Micros, character: Character) {
        match self.state {
            State::Idle => self.in_idle(at, character),
            State::WaitingForDle { .. } => self.instead_of_dle(at, character),
            State::Sending { .. } => self.while_sending(at, character),
            State::Disturbed { .. } => {
                self.state = State::Disturbed { silence: at + self.parameters.zvz }
            }
            State::WaitingForAcknowledgement { .. } => self.behind_the_block(character),
            State::WaitingForBuffer { .. } => self.without_buffer(at, character),
            State::TurnedAway { .. } => {
                self.state = State::TurnedAway { silence: at + self.parameters.zvz }
            }
            State::Granting { .. } => self.before_dle_has_left(at, character),
            State::Receiving { .. } => self.in_block(at, character),
            State::WaitingForRepetition { .. } => self.for_repetition(at, character),
            State::Garbage { .. } => {
                self.state = State::Garbage { silence: at + self.parameters.zvz }
            }
        }
    }

    fn in_idle(&mut self, at: Micros, character: Character) {
        match character {
            Character::Good(STX) => self.begin_reception(at),
            Character::Good(NAK) | Character::Damaged(_) => {}
            Character::Good(_) if self.parameters.nak_on_garbage => {
                // Its silence is also that behind an abort.
                self.quiet = Quiet::No;
                self.state = State::Garbage { silence: at + self.parameters.zvz };
            }
            Character::Good(_) => {}
        }
    }

    /// Idle, unless a job waits.
    fn go_idle(&mut self) {
        self.state = State::Idle;
        self.begin_job();
    }

    /// BREAK leads to idle from every state without an answer.
    fn break_comes(&mut self) {
        if self.state == State::Idle {
            return;
        }
        let fault = (Failure::Break, 0x080D, Rule::Break);
        if let Some(reception) = self.reception.take() {
            self.out.take_part_back(Part::Grant);
            self.deliver_failed(reception, fault);
        }
        if self.state.is_of_sender() {
            self.out.take_part_back(Part::Job);
            self.fail_job(fault);
        }
        // A job that waits, or gave way, is not on the line.
        self.go_idle();
    }

    fn go_down(&mut self) {
        self.is_down = true;
        self.out.take_all_back();
        self.out.set_gone(true);
        self.state = State::Idle;
        self.quiet = Quiet::No;
        self.fail_all((Failure::LinkDown, 0, Rule::Down));
    }

    /// Reception and job have failed.
    fn fail_all(&mut self, fault: Fault) {
        if let Some(reception) = self.reception.take() {
            self.deliver_failed(reception, fault);
        }
        self.fail_job(fault);
    }

    fn open(&mut self) {
        self.is_open = true;
        self.is_down = false;
        self.out.set_gone(false);
        self.room.open();
        self.deliveries = 0;
        if self.parameters.nak_at_start {
            self.out.send(&[NAK], Part::Answer, Rule::StartNak);
        }
    }

    fn close(&mut self) {
        self.is_open = false;
        self.out.take_all_back();
        self.state = State::Idle;
        self.quiet = Quiet::No;
        self.reception = None;
        if let Some(job) = self.job.take() {
            let failure = Failure::Interrupted;
            let effect = Effect::Failed { job: job.id, failure, status: 0, sent: 0 };
            self.awaited.push(Rule::Close, effect);
        }
    }

    /// The rule that a character breaks which nothing had to send.
    fn idle_rule(&self) -> Rule {
        match self.state {
            State::Idle if self.quiet != Quiet::No => Rule::AfterAbort,
            State::Idle if self.job.is_some() => Rule::Pause,
            State::Idle => Rule::Ignored,
            State::WaitingForDle { stx_seen: true, .. } => Rule::ConflictHigh,
            State::WaitingForDle { qvz: None, .. } => Rule::LateDle,
            State::WaitingForDle { .. } => Rule::SetUp,
            State::Sending { .. } => Rule::Frame,
            State::Disturbed { .. } => Rule::StopOnOther,
            State::WaitingForAcknowledgement { .. } => Rule::Qvz,
            State::WaitingForBuffer { .. } | State::TurnedAway { .. } => Rule::NoBuffer,
            State::Granting { .. } => Rule::SecondStx,
            State::Receiving { .. } if !self.parameters.handshake => Rule::RxNoHandshake,
            State::Receiving { .. } => Rule::Transparent,
            State::WaitingForRepetition { .. } => Rule::Repetition,
            State::Garbage { .. } => Rule::Garbage,
        }
    }

    /// The rule that this breaks, as nothing asked for it.
    fn unasked(&self, effect: &Effect) -> Rule {
        match effect {
            Effect::Done { .. } => Rule::NoFalseSuccess,
            Effect::Failed { .. } => self.idle_rule(),
            Effect::Delivered { failure: None, .. } => Rule::Deliver,
            Effect::Delivered { .. } => Rule::FirstError,
            _ => Rule::Frame,
        }
    }
}

impl Model for Station {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        match input {
            LineInput::Bytes(bytes) => {
                for byte in bytes {
                    self.character(at, Character::Good(*byte));
                }
            }
            LineInput::Damaged { kind: LineErrorKind::Break, .. } => self.break_comes(),
            LineInput::Damaged { span: 1.., .. } => self.damaged_before(),
            LineInput::Damaged { byte, .. } => self.character(at, Character::Damaged(*byte)),
            LineInput::ModemLines(..) => {}
            LineInput::Down(_) => self.go_down(),
            LineInput::Up => {
                self.is_down = false;
                self.out.set_gone(false);
            }
        }
    }

    fn left(&mut self, at: Micros, _byte: u8) {
        let mark = self.out.left();
        if mark != 0 {
            self.mark_has_left(at, mark);
        }
    }

    fn due(&mut self, at: Micros) {
        // The data of a next block come behind what came from the line.
        self.begin_job();
        while self.state.deadline().is_some_and(|deadline| deadline <= at) {
            self.run_out(at);
        }
        if matches!(self.quiet, Quiet::Until(until) if until <= at) {
            self.quiet = Quiet::No;
            self.begin_job();
        }
        self.room.tell();
    }

    fn host(&mut self, _at: Micros, request: &HostRequest) {
        match request {
            HostRequest::Open => self.open(),
            HostRequest::Close => self.close(),
            HostRequest::Job { id, kind, data, .. } => self.take_job(*id, kind, data),
            HostRequest::Pause(id) => self.pause(*id),
            HostRequest::Resume(id) => self.resume(*id),
            HostRequest::Abort(id) => self.abort(*id),
            HostRequest::Keep => self.room.keep(true),
            HostRequest::PutAway(bytes) => self.room.put_away(*bytes as usize),
            HostRequest::PutAllAway => self.room.keep(false),
            // Nobody holds a line here, and nothing is asked for.
            HostRequest::ForceResume | HostRequest::Answer(..) => {}
        }
        if self.is_open {
            self.room.tell();
        }
    }

    fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken> {
        if let Effect::Byte(byte) = effect {
            let idle = self.idle_rule();
            let clause = self.clause();
            return self.out.begins(at, *byte, idle, clause);
        }
        self.awaited.seen(effect).map_err(|wrong| match wrong {
            Some((rule, message)) => self.broken(rule, message),
            None => self.broken(self.unasked(effect), format!("nothing asked for {effect:?}")),
        })
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        if let Some((rule, message)) = self.awaited.missing() {
            return Err(self.broken(rule, message));
        }
        if !self.is_open || self.is_down {
            return Ok(());
        }
        let clause = self.clause();
        self.out.settled(clause)
    }

    fn next(&self) -> Option<Micros> {
        let quiet = match self.quiet {
            Quiet::Until(until) => Some(until),
            Quiet::No | Quiet::Nak(_) => None,
        };
        self.state.deadline().into_iter().chain(quiet).min()
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        self.partner.borrow_mut().propose(self, &Plain, now, dice)
    }

    fn is_filled(&self) -> bool {
        self.partner.borrow().is_filling()
    }
}
