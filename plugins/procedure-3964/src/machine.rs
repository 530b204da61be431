//! The state machine that sender and receiver share: one character, one mark or
//! one timer at a time.

use crate::block::Block;
use crate::cause::*;
use crate::departure::Departure;
use crate::frame::{DLE, Decoder, Encoder, NAK, STX};
use crate::job::{BLOCK, Job, Stage};
use crate::phase::Phase;
use crate::rk512::{LARGEST_DATA, LARGEST_TELEGRAM, Rk512};
use crate::{Layer, Options, Priority};
use softplug_plugin::{
    Context, LineErrorKind, MarkState, Micros, Opening, StateError, StateReader, StateWriter,
};

/// Timer: QVZ, ZVZ, BWZ or the wait for a buffer, whichever is running.
const PROCEDURE: u8 = 0;
/// Timer: the reaction to our telegram.
const REACTION: u8 = 1;
/// Timer: the host's answer to the partner's telegram.
const REQUEST: u8 = 2;

/// Most bytes of one event.
const INPUT: usize = 1_040;
/// Most that one character can put out: a block that is delivered, and what
/// follows from it.
const MOST_OUTPUT: usize = 1_600;

/// Whose block is on the line.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Owner {
    Job,
    /// The reaction to a telegram of the partner.
    Reaction,
}

#[derive(Debug)]
pub(crate) struct Machine {
    pub(crate) options: Options,
    pub(crate) phase: Phase,
    /// When the wait of this phase is over.
    pub(crate) deadline: Option<Micros>,
    pub(crate) departure: Departure,
    pub(crate) job: Job,
    pub(crate) rk512: Rk512,
    // Sender.
    pub(crate) owner: Owner,
    pub(crate) encoder: Encoder,
    pub(crate) setups: u8,
    pub(crate) transmissions: u8,
    /// The partner's STX came while we, with high priority, waited for DLE.
    pub(crate) stx_seen: bool,
    /// Discards whose answer has not come, and whether they were the job's.
    pub(crate) discards: u16,
    pub(crate) discards_job: bool,
    // Receiver.
    pub(crate) decoder: Decoder,
    pub(crate) block: Block<BLOCK>,
    /// Most data bytes of a block, and the room that must be free for it.
    pub(crate) limit: u16,
    pub(crate) needed_room: u32,
    /// Blocks that were refused since the first STX.
    pub(crate) refused: u8,
    pub(crate) first_error: Option<Cause>,
    /// There was an error in this block.
    pub(crate) is_faulty: bool,
    /// We withdrew an STX of our own for this block.
    pub(crate) withdrew: bool,
    pub(crate) buffer_until: Micros,
    pub(crate) last_delivery: u32,
    // What follows lives within one event, or follows from the above.
    /// Bytes of this instant that had to wait for space in the output.
    rest: Block<INPUT>,
    armed: [Option<Micros>; 3],
    named: Option<Phase>,
}

impl Machine {
    pub(crate) fn new(options: Options) -> Self {
        Self {
            options,
            phase: Phase::Idle,
            deadline: None,
            departure: Departure::default(),
            job: Job::none(),
            rk512: Rk512::new(),
            owner: Owner::Job,
            encoder: Encoder::default(),
            setups: 0,
            transmissions: 0,
            stx_seen: false,
            discards: 0,
            discards_job: false,
            decoder: Decoder::default(),
            block: Block::new(),
            limit: options.block_size,
            needed_room: 0,
            refused: 0,
            first_error: None,
            is_faulty: false,
            withdrew: false,
            buffer_until: Micros::ZERO,
            last_delivery: 0,
            rest: Block::new(),
            armed: [None; 3],
            named: None,
        }
    }

    pub(crate) fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if !opening.resumed {
            self.set_limits(opening);
            if self.options.nak_at_start {
                self.put(link, NAK);
            }
        }
        self.finish(link);
    }

    fn set_limits(&mut self, opening: &Opening) {
        if self.options.layer == Layer::Rk512 {
            self.limit = LARGEST_TELEGRAM;
            self.needed_room = opening.delivery_room.min(LARGEST_DATA.into());
            if self.options.reaction_timeout == Micros::ZERO {
                self.options.reaction_timeout = crate::rk512::timeout_at(opening.line.baud);
            }
            self.rk512.timeout = self.options.reaction_timeout;
        } else {
            self.needed_room = opening.delivery_room.min(self.limit.into());
            self.limit = self.needed_room as u16;
        }
    }

    pub(crate) fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        while link.output_room() >= MOST_OUTPUT
            && let Some((byte, after)) = rest.split_first()
        {
            self.character(link, Some(*byte), Some(*byte));
            rest = after;
        }
        self.rest.clear();
        self.rest.extend(rest);
        self.finish(link);
    }

    /// Goes on with what the output had no space for.
    pub(crate) fn more(&mut self, link: &mut Context<'_>) {
        let rest = self.rest.clone();
        self.received(link, rest.as_slice());
    }

    pub(crate) fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
        if kind == LineErrorKind::Break {
            warn(link, BREAK.status, "BREAK");
            self.break_off(link);
        } else if span == 0 {
            self.character(link, None, byte);
        } else if self.phase == Phase::Receiving {
            // One of the last characters, which have been taken already.
            self.fault(link, DAMAGED);
        } else {
            warn(link, DAMAGED.status, "damaged character");
        }
        self.begin_block(link);
        self.finish(link);
    }

    /// One character: `good` if it is undamaged, `raw` as it was read.
    fn character(&mut self, link: &mut Context<'_>, good: Option<u8>, raw: Option<u8>) {
        match self.phase {
            Phase::Idle => match good {
                Some(STX) => self.set_up_asked(link, false),
                Some(NAK) => {}
                None => warn(link, DAMAGED.status, "damaged character in idle"),
                Some(_) => self.garbage(link),
            },
            Phase::Garbage | Phase::Disturbed => self.wait(link, self.options.zvz),
            Phase::BufferWait if good == Some(STX) => {}
            Phase::BufferWait => self.fault(link, TOO_EARLY),
            Phase::Receiving => self.receive(link, good, raw),
            Phase::RepetitionWait => {
                if good == Some(STX) {
                    self.set_up_asked(link, true);
                }
            }
            Phase::DleWait => match (good, self.options.priority) {
                (Some(DLE), _) if !self.departure.is_pending() => self.send_block(),
                (Some(STX), Priority::High) => self.stx_seen = true,
                (Some(STX), Priority::Low) => self.withdraw(link),
                _ => self.repeat_set_up(link, SET_UP_REFUSED),
            },
            Phase::Sending => {
                self.drop_queue(link);
                if good == Some(NAK) {
                    self.repeat_block(link, STOPPED);
                } else {
                    warn(link, DISTURBED.status, "character while sending");
                    self.phase = Phase::Disturbed;
                    self.wait(link, self.options.zvz);
                }
            }
            Phase::AcknowledgementWait => {
                if good == Some(DLE) {
                    self.acknowledged(link);
                } else {
                    self.repeat_block(link, END_REFUSED);
                }
            }
        }
        self.begin_block(link);
    }

    /// Anything but STX in idle.
    fn garbage(&mut self, link: &mut Context<'_>) {
        if self.options.nak_on_garbage {
            warn(link, IDLE_GARBAGE, "character in idle");
            self.phase = Phase::Garbage;
            self.wait(link, self.options.zvz);
        }
    }

    pub(crate) fn timer(&mut self, link: &mut Context<'_>, id: u8) {
        if let Some(armed) = self.armed.get_mut(usize::from(id)) {
            *armed = None;
        }
        match id {
            PROCEDURE => self.waited(link),
            REACTION => self.reaction_late(link),
            REQUEST => self.answer_late(link),
            _ => {}
        }
        self.begin_block(link);
        self.finish(link);
    }

    /// The wait of this phase is over.
    fn waited(&mut self, link: &mut Context<'_>) {
        self.deadline = None;
        match self.phase {
            Phase::Idle | Phase::Sending => {}
            Phase::Garbage => {
                self.put(link, NAK);
                self.idle();
            }
            Phase::BufferWait => self.look_for_buffer(link),
            Phase::Receiving => self.silence(link),
            Phase::RepetitionWait => self.end_reception(link, SILENCE),
            Phase::DleWait => {
                let cause = if self.stx_seen { BOTH_HIGH } else { SET_UP_UNANSWERED };
                self.repeat_set_up(link, cause);
            }
            Phase::Disturbed => {
                if self.has_attempts() {
                    self.put(link, NAK);
                }
                self.repeat_block(link, DISTURBED);
            }
            Phase::AcknowledgementWait => self.repeat_block(link, END_UNANSWERED),
        }
    }

    pub(crate) fn mark(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {
        match (self.phase, self.departure.reported(mark, state)) {
            (Phase::Sending, Some(MarkState::MaybeLeft)) => {
                self.phase = Phase::AcknowledgementWait;
                if self.owner == Owner::Reaction {
                    self.rk512.advance();
                }
            }
            (Phase::DleWait | Phase::AcknowledgementWait, Some(MarkState::SurelyLeft)) => {
                self.wait(link, self.options.qvz);
            }
            (Phase::Receiving, Some(MarkState::SurelyLeft)) => self.wait(link, self.options.zvz),
            (Phase::RepetitionWait, Some(MarkState::SurelyLeft)) => {
                self.wait(link, self.options.bwz);
            }
            _ => {}
        }
        self.finish(link);
    }

    pub(crate) fn link_down(&mut self, link: &mut Context<'_>) {
        self.drop_queue(link);
        if self.phase.is_receiver() {
            self.end_reception(link, LINK_DOWN);
        }
        self.idle();
        self.fail_job(link, LINK_DOWN);
        self.rk512.forget_partner(link);
        self.finish(link);
    }

    /// BREAK leads to idle from every state.
    fn break_off(&mut self, link: &mut Context<'_>) {
        if self.phase.is_receiver() {
            self.end_reception(link, BREAK);
        } else if self.phase.is_sender() {
            self.drop_queue(link);
            self.end_block(link, BREAK);
        }
        self.idle();
    }

    pub(crate) fn idle(&mut self) {
        self.phase = Phase::Idle;
        self.deadline = None;
        self.departure.forget();
    }

    /// This phase is over after so long a time from now.
    pub(crate) fn wait(&mut self, link: &Context<'_>, span: Micros) {
        self.deadline = Some(link.now() + span);
    }

    /// Sends a control character; nothing else is queued then. Where the host
    /// has no room for one byte, the partner's time-out has to do.
    pub(crate) fn put(&mut self, link: &mut Context<'_>, byte: u8) -> bool {
        let has_room = link.transmit_room() > 0;
        if has_room {
            link.transmit(&[byte]);
        }
        has_room
    }

    /// What each event ends with: the rest of the output, the mark, the timers.
    pub(crate) fn finish(&mut self, link: &mut Context<'_>) {
        let is_cut = self.pump(link);
        if is_cut || !self.rest.is_empty() {
            link.again();
        }
        self.departure.set_mark(link);
        let deadlines = [self.deadline, self.rk512.reaction_until, self.rk512.answer_until];
        for (id, (deadline, armed)) in (0..).zip(deadlines.into_iter().zip(&mut self.armed)) {
            if *armed == deadline {
                continue;
            }
            *armed = deadline;
            match deadline {
                Some(deadline) => link.set_timer(id, deadline),
                None => link.cancel_timer(id),
            }
        }
        if self.named != Some(self.phase) {
            self.named = Some(self.phase);
            link.state(self.phase.name());
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.phase as u8);
        state.deadline(self.deadline);
        self.departure.save(state);
        self.job.save(state);
        self.rk512.save(state);
        state.bool(self.owner == Owner::Reaction);
        self.encoder.save(state);
        state.u8(self.setups);
        state.u8(self.transmissions);
        state.bool(self.stx_seen);
        state.u16(self.discards);
        state.bool(self.discards_job);
        self.decoder.save(state);
        self.block.save(state);
        state.u16(self.limit);
        state.u32(self.needed_room);
        state.u8(self.refused);
        Cause::save(self.first_error, state);
        state.bool(self.is_faulty);
        state.bool(self.withdrew);
        state.micros(self.buffer_until);
        state.u32(self.last_delivery);
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.phase = Phase::restore(state)?;
        self.deadline = state.deadline();
        self.departure = Departure::restore(state)?;
        self.job.restore(state)?;
        self.rk512.restore(state)?;
        self.owner = if state.bool() { Owner::Reaction } else { Owner::Job };
        self.encoder = Encoder::restore(state)?;
        self.setups = state.u8();
        self.transmissions = state.u8();
        self.stx_seen = state.bool();
        self.discards = state.u16();
        self.discards_job = state.bool();
        self.decoder = Decoder::restore(state)?;
        self.block.restore(state)?;
        self.limit = state.u16();
        self.needed_room = state.u32();
        self.refused = state.u8();
        self.first_error = Cause::restore(state);
        self.is_faulty = state.bool();
        self.withdrew = state.bool();
        self.buffer_until = state.micros();
        self.last_delivery = state.u32();
        Ok(())
    }

    pub(crate) fn has_job(&self) -> bool {
        self.job.stage != Stage::None
    }
}
