//! The remote buffer of FANUC's controls with protocol A, from
//! `docs/protocols/fanuc-rs232.md`: messages instead of DC1 and DC3.
//!
//! Protocol B is the reader's way and no part of this model.

mod blame;
mod dialogue;
mod job;
mod message;
mod parity;
mod propose;
mod rules;
mod tape;
mod wire;

use crate::demands::Demands;
use crate::dice::Dice;
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model, Proposal};
use blame::BLAME;
use job::{Dialogue, Job};
use message::Incoming;
use parity::Character;
use propose::Partner;
use rules::Rules;
use softplug_abi::{Failure, LineParameters, Micros, ModemLines};
use std::cell::RefCell;
use tape::{Refused, encode};
use wire::Wire;

/// `None` unless the settings select the packets of a remote buffer.
pub(crate) fn start(conditions: &Conditions) -> Option<Box<dyn Model>> {
    let (known, on) = conditions.modem_lines.unwrap_or_default();
    Some(Box::new(RemoteBuffer {
        rules: Rules::new(conditions)?,
        line: conditions.line,
        wire: Wire::new(conditions.depth, conditions.transmit_room),
        incoming: Incoming::default(),
        dialogue: Dialogue::default(),
        job: None,
        jobs: 0,
        demands: Demands::default(),
        modem_lines: known,
        dsr: on.0 & ModemLines::DSR.0 != 0,
        is_open: false,
        is_down: false,
        is_unsure: false,
        partner: RefCell::new(Partner::new(conditions.long)),
    }))
}

/// The host's side of a remote buffer.
#[derive(Clone, Debug)]
struct RemoteBuffer {
    rules: Rules,
    line: LineParameters,
    wire: Wire,
    incoming: Incoming,
    dialogue: Dialogue,
    job: Option<Job>,
    /// The last job's id.
    jobs: u32,
    demands: Demands,
    modem_lines: ModemLines,
    dsr: bool,
    is_open: bool,
    is_down: bool,
    /// The plug-in differs in a way that is not followed: from here on nothing is judged.
    is_unsure: bool,
    partner: RefCell<Partner>,
}

impl RemoteBuffer {
    fn character(&mut self, at: Micros, character: Character) {
        self.heard(at);
        if let Some(message) = self.incoming.take(character, self.rules.end) {
            self.message(message);
        }
    }

    /// The job's check, then its run.
    fn begin(&mut self, at: Micros, id: u32, fields: &[(String, String)], data: &[u8]) {
        if self.job.is_some() {
            let failed = Effect::Failed { job: id, failure: Failure::Busy, status: 0, sent: 0 };
            return self.demands.add(failed, "fanuc-rs232.feed.one-job");
        }
        self.jobs = id;
        let encoded = encode(&self.rules.tape, data, fields);
        let refused = encoded.as_ref().err().cloned();
        let clause = refused.as_ref().map_or("fanuc-rs232.tape.unsupported", |own| own.clause);
        let Refused { failure, status, line, column, .. } = refused.unwrap_or_default();
        self.demands.add(Effect::Checked { job: id, failure, status, line, column }, clause);
        let Ok(tape) = encoded else { return };
        self.wire.count_anew();
        self.job = Some(Job::new(id, tape));
        self.heard(at);
        if !self.dialogue.is_ready {
            self.initialise();
        }
    }

    /// When silence has lasted too long: it counts when nothing of ours has to leave.
    fn deadline(&self) -> Option<Micros> {
        let counts = self.job.is_some() && self.wire.is_empty();
        counts.then_some(self.dialogue.heard + self.rules.poll_time)
    }

    /// Nothing is left of what was before.
    fn forget(&mut self) {
        self.incoming = Incoming::default();
        self.dialogue = Dialogue { heard: self.dialogue.heard, ..Dialogue::default() };
    }

    fn modem_lines(&mut self, named: ModemLines, on: ModemLines) {
        let dsr = ModemLines::DSR.0;
        if named.0 & dsr & self.modem_lines.0 == 0 {
            return;
        }
        let was_on = std::mem::replace(&mut self.dsr, on.0 & dsr != 0);
        // A transfer begins with the first DAT.
        let is_transfer = self.job.as_ref().is_some_and(|job| job.has_begun);
        if self.rules.watch_dsr && was_on && !self.dsr && is_transfer {
            self.fail(Failure::PartnerGone, "fanuc-rs232.feed.dsr");
        }
    }
}

impl Model for RemoteBuffer {
    fn fork(&self) -> Box<dyn Model> {
        Box::new(self.clone())
    }

    fn line(&mut self, at: Micros, input: &LineInput) {
        match input {
            LineInput::Bytes(bytes) => {
                for byte in bytes {
                    self.character(at, parity::came(&self.rules, *byte));
                }
            }
            LineInput::Damaged { byte: Some(byte), span: 0, .. } => {
                self.character(at, Character::Damaged(byte & 0x7F));
            }
            LineInput::Damaged { .. } => self.incoming.damage(),
            LineInput::ModemLines(named, on) => self.modem_lines(*named, *on),
            LineInput::Down(_) => {
                self.is_down = true;
                self.wire.set_gone(true);
                self.fail(Failure::LinkDown, "fanuc-rs232.link.down");
                self.wire.discard();
                self.forget();
            }
            LineInput::Up => {
                self.is_down = false;
                self.wire.set_gone(false);
            }
        }
    }

    fn left(&mut self, at: Micros, _byte: u8) {
        // Of a message that was dropped, the last character that the port had taken counts.
        if self.wire.left() || self.wire.is_empty() {
            self.dialogue.heard = at;
        }
    }

    fn due(&mut self, at: Micros) {
        self.wire.tell_dropped();
        self.give_data();
        if self.deadline().is_some_and(|deadline| deadline <= at) {
            self.silence();
        }
    }

    fn host(&mut self, at: Micros, request: &HostRequest) {
        match request {
            HostRequest::Open => {
                (self.is_open, self.is_down) = (true, false);
                self.wire.set_gone(false);
            }
            HostRequest::Close => {
                self.is_open = false;
                if let Some(Job { id: job, .. }) = self.job.take() {
                    let (failure, status, sent) = (Failure::Interrupted, 0, 0);
                    let failed = Effect::Failed { job, failure, status, sent };
                    self.demands.add(failed, "fanuc-rs232.link.close");
                }
                self.wire.close();
                self.forget();
            }
            HostRequest::Job { id, fields, data, .. } => self.begin(at, *id, fields, data),
            HostRequest::Pause(id) | HostRequest::Resume(id) => {
                if let Some(job) = self.job.as_mut().filter(|job| job.id == *id) {
                    job.is_paused = matches!(request, HostRequest::Pause(_));
                }
            }
            HostRequest::Abort(id) => {
                if self.job.as_ref().is_some_and(|job| job.id == *id) {
                    self.fail(Failure::Aborted, "fanuc-rs232.remote.abort");
                }
            }
            // Nobody holds anything, and nothing is delivered or asked for.
            HostRequest::ForceResume
            | HostRequest::Keep
            | HostRequest::PutAway(_)
            | HostRequest::PutAllAway
            | HostRequest::Answer(..) => {}
        }
    }

    fn seen(&mut self, _at: Micros, effect: &Effect) -> Result<(), Broken> {
        if self.is_unsure {
            return Ok(());
        }
        if let Effect::Byte(byte) = effect {
            return self.wire.begins(*byte, "fanuc-rs232.remote.initialise");
        }
        self.demands.meet(effect, &BLAME)
    }

    fn settled(&mut self, _at: Micros) -> Result<(), Broken> {
        if self.is_unsure {
            return Ok(());
        }
        self.demands.settled()?;
        if self.is_open && !self.is_down { self.wire.settled() } else { Ok(()) }
    }

    fn next(&self) -> Option<Micros> {
        if self.is_unsure { None } else { self.deadline() }
    }

    fn propose(&self, now: Micros, dice: &mut Dice) -> Proposal {
        self.partner.borrow_mut().propose(self, now, dice)
    }

    fn is_filled(&self) -> bool {
        self.partner.borrow().is_filling(self.jobs)
    }
}
