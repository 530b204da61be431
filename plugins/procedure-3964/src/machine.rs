//! The state machine that sender and receiver share: one character, one mark or
//! one timer at a time.

mod rk512;

pub(crate) use rk512::LARGEST_DATA;

use crate::cause::*;
use crate::departure::Departure;
use crate::frame::{DLE, Decoder, Encoder, NAK, STX};
use crate::job::{BLOCK, Job, Stage};
use crate::phase::Phase;
use crate::queue::{Meant, Runs};
use crate::{Layer, Options, Priority};
use rk512::{LARGEST_TELEGRAM, Rk512, timeout_at};
use softplug_plugin::parts::{Block, TimerName, Timers};
use softplug_plugin::{
    Context, DeliveryId, LineErrorKind, MarkId, MarkState, Micros, NoteLevel, Opening, State,
    Unread, timers,
};

timers! {
    /// What time is kept for.
    pub(crate) enum Timer {
        /// QVZ, ZVZ, BWZ or the wait for a buffer, whichever is running.
        Procedure,
        /// The reaction to our telegram.
        Reaction,
        /// The host's answer to the partner's telegram.
        Request,
    }
}

/// Most that one character can put out: a block that is delivered, and what
/// follows from it.
const MOST_OUTPUT: usize = 1_600;

/// A wait that has no end. Waits end later than at the clock's start.
pub(crate) const NEVER: Micros = Micros::ZERO;

/// The end of a wait that begins now.
#[inline(never)]
pub(crate) fn after(link: &Context<'_>, millis: i64) -> Micros {
    // The settings bound it to minutes.
    link.now() + Micros(millis * 1_000)
}

/// Whose block is on the line.
#[derive(Copy, Clone, PartialEq, Eq, Debug, State)]
pub(crate) enum Owner {
    Job,
    /// The reaction to a telegram of the partner.
    Reaction,
}

/// Sender and receiver.
#[derive(Debug, State)]
pub(crate) struct Machine {
    #[state(skip)]
    pub(crate) options: Options,
    /// Bits of a character of the line.
    #[state(skip)]
    pub(crate) data_bits: u8,
    pub(crate) phase: Phase,
    /// When the wait of this phase is over.
    pub(crate) deadline: Micros,
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
    /// A discard is not answered; of what it is meant, and whether a NAK follows where
    /// something of the job has left.
    pub(crate) discards: bool,
    pub(crate) meant: Meant,
    pub(crate) owes_nak: bool,
    /// What was queued last.
    pub(crate) queued: Runs,
    /// What waits for a discard's answer, or for room.
    pub(crate) waiting: Runs,
    // Receiver.
    pub(crate) decoder: Decoder,
    pub(crate) block: Block<BLOCK>,
    /// Most data bytes of a block.
    pub(crate) limit: u16,
    /// Blocks that were refused since the first STX.
    pub(crate) refused: u8,
    pub(crate) first_error: Kept,
    /// There was an error in this block.
    pub(crate) is_faulty: bool,
    /// We withdrew an STX of our own for this block.
    pub(crate) withdrew: bool,
    pub(crate) buffer_until: Micros,
    pub(crate) last_delivery: DeliveryId,
    /// Characters of this block, as far as they are counted.
    pub(crate) heard: u8,
    /// Set again from the deadlines after each event.
    #[state(skip)]
    pub(crate) timers: Timers<Timer, 3>,
    /// Bytes of this instant that had to wait for space in the output.
    #[state(skip)]
    unread: Unread,
    #[state(skip)]
    named: Phase,
}

impl Machine {
    pub(crate) fn new(options: Options) -> Self {
        Self {
            options,
            data_bits: 8,
            phase: Phase::Idle,
            deadline: NEVER,
            departure: Departure::default(),
            job: const { Job::none() },
            rk512: const { Rk512::new() },
            owner: Owner::Job,
            encoder: Encoder::default(),
            setups: 0,
            transmissions: 0,
            stx_seen: false,
            discards: false,
            meant: Meant::default(),
            owes_nak: false,
            queued: const { Runs::new() },
            waiting: const { Runs::new() },
            decoder: Decoder::default(),
            block: const { Block::new() },
            limit: 0,
            refused: 0,
            first_error: Kept(None),
            is_faulty: false,
            withdrew: false,
            heard: 0,
            buffer_until: Micros::ZERO,
            last_delivery: DeliveryId::NONE,
            timers: Timers::new(),
            unread: const { Unread::new() },
            named: Phase::Idle,
        }
    }

    pub(crate) fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if self.options.reaction_timeout == 0 {
            self.options.reaction_timeout = timeout_at(opening.line.baud);
        }
        self.data_bits = opening.line.data_bits;
        if !opening.resumed {
            self.limit = match self.options.layer {
                Layer::Rk512 => LARGEST_TELEGRAM,
                // A host that takes no deliveries has no buffer for any block.
                Layer::None if opening.delivery_room == 0 => self.options.block_size as u16,
                Layer::None => opening.delivery_room.min(self.options.block_size as u32) as u16,
            };
            if self.options.nak_at_start {
                self.put(link, NAK);
            }
        }
        self.name(link);
    }

    pub(crate) fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        while link.output_room() >= MOST_OUTPUT
            && let Some((byte, after)) = rest.split_first()
        {
            self.character(link, Some(*byte), Some(*byte));
            rest = after;
        }
        self.unread.keep(link, rest);
    }

    /// Goes on with what the output had no space for.
    pub(crate) fn more(&mut self, link: &mut Context<'_>) {
        let unread = self.unread;
        self.received(link, unread.bytes());
    }

    pub(crate) fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
        if kind == LineErrorKind::Break {
            self.warn(link, BREAK.status());
            self.break_off(link);
        } else if span == 0 {
            self.character(link, None, byte);
        } else if self.phase == Phase::Receiving {
            // One of the last characters, which have been taken already.
            self.fault(link, DAMAGED);
        } else {
            self.warn(link, DAMAGED.status());
        }
        self.begin_block(link);
    }

    /// One character: `good` if it is undamaged, `raw` as it was read.
    fn character(&mut self, link: &mut Context<'_>, good: Option<u8>, raw: Option<u8>) {
        match self.phase {
            Phase::Idle => match good {
                Some(STX) => self.set_up_asked(link, false),
                Some(NAK) => {}
                None => self.warn(link, DAMAGED.status()),
                Some(_) => self.garbage(link),
            },
            Phase::Garbage | Phase::Disturbed => self.wait(link, self.options.zvz),
            Phase::BufferWait if good == Some(STX) => {}
            Phase::BufferWait => self.not_waiting(link),
            Phase::Receiving => self.receive(link, good, raw),
            Phase::RepetitionWait => {
                if good == Some(STX) {
                    self.set_up_asked(link, true);
                }
            }
            Phase::DleWait => match (good, self.options.priority) {
                (Some(DLE), _) if !self.departure.is_pending() => self.send_block(),
                (Some(STX), Priority::High) => {
                    self.stx_seen = true;
                }
                (Some(STX), Priority::Low) => self.withdraw(link),
                // No answer to an STX that cannot have left.
                _ if self.departure.is_pending() => {}
                _ => self.repeat_set_up(link, SET_UP_REFUSED),
            },
            Phase::Sending => {
                self.drop_queue(link);
                if good == Some(NAK) {
                    self.repeat_block(link, STOPPED);
                } else {
                    self.warn(link, DISTURBED.status());
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
    pub(crate) fn garbage(&mut self, link: &mut Context<'_>) {
        if self.options.nak_on_garbage {
            self.warn(link, IDLE_GARBAGE);
            self.phase = Phase::Garbage;
            self.wait(link, self.options.zvz);
        }
    }

    pub(crate) fn timer(&mut self, link: &mut Context<'_>, id: u8) {
        match Timer::from_id(id) {
            Some(Timer::Procedure) => self.waited(link),
            Some(Timer::Reaction) => self.reaction_late(link),
            Some(Timer::Request) => self.answer_late(link),
            None => {}
        }
        self.begin_block(link);
    }

    /// The wait of this phase is over.
    fn waited(&mut self, link: &mut Context<'_>) {
        self.deadline = NEVER;
        match self.phase {
            Phase::Idle | Phase::Sending => {}
            Phase::Garbage => {
                self.put(link, NAK);
                self.idle();
            }
            Phase::BufferWait => self.look_for_buffer(link),
            Phase::Receiving => self.silence(link),
            Phase::RepetitionWait => {
                self.end_reception(link, SILENCE);
            }
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
            Phase::AcknowledgementWait => {
                self.repeat_block(link, END_UNANSWERED);
            }
        }
    }

    pub(crate) fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        match (self.phase, self.departure.reported(mark, state)) {
            (Phase::Sending, Some(MarkState::MaybeLeft)) => {
                self.phase = Phase::AcknowledgementWait;
                if self.owner == Owner::Reaction {
                    self.rk512.reaction_left();
                }
            }
            (Phase::DleWait | Phase::AcknowledgementWait, Some(MarkState::SurelyLeft)) => {
                let qvz = match (self.options.qvz, self.options.bcc) {
                    (0, true) => 2_000,
                    (0, false) => 550,
                    (qvz, _) => qvz,
                };
                self.wait(link, qvz);
            }
            (Phase::Receiving | Phase::Idle, Some(MarkState::SurelyLeft)) => {
                self.wait(link, self.options.zvz);
            }
            (Phase::RepetitionWait, Some(MarkState::SurelyLeft)) => {
                self.wait(link, self.options.bwz);
            }
            _ => {}
        }
    }

    pub(crate) fn link_down(&mut self, link: &mut Context<'_>) {
        self.discard(link, Meant::ALL);
        if self.phase.is_receiver() {
            self.end_reception(link, LINK_DOWN);
        }
        self.idle();
        self.fail_job(link, LINK_DOWN);
        self.rk512.forget_partner(link);
    }

    /// BREAK leads to idle from every state.
    fn break_off(&mut self, link: &mut Context<'_>) {
        if self.phase == Phase::Idle {
            return;
        }
        if self.phase.is_receiver() {
            self.take_grant_back(link);
            self.end_reception(link, BREAK);
        } else if self.phase.is_sender() {
            self.drop_queue(link);
            self.end_block(link, BREAK);
        }
        self.idle();
    }

    /// A line for the log: what happened by its number, and the state in which it did.
    /// It is left out where the output has no space for all there might be to say.
    #[inline(never)]
    pub(crate) fn warn(&self, link: &mut Context<'_>, status: u16) {
        if link.output_room() > MOST_OUTPUT {
            let is_news = status == FIRST_REPETITION || status == NAK_SENT;
            let level = if is_news { NoteLevel::Info } else { NoteLevel::Warning };
            link.note(level, status, self.phase.name());
        }
    }

    #[inline(never)]
    pub(crate) fn idle(&mut self) {
        self.phase = Phase::Idle;
        self.deadline = NEVER;
        self.departure.forget();
    }

    /// This phase is over after so long a time from now.
    #[inline(never)]
    pub(crate) fn wait(&mut self, link: &Context<'_>, millis: i64) {
        self.deadline = after(link, millis);
    }

    /// What each event ends with: the rest of the output, the mark, the timers.
    pub(crate) fn finish(&mut self, link: &mut Context<'_>) {
        let is_cut = self.queue_waiting(link) || self.pump(link);
        if is_cut {
            link.again();
        }
        if self.is_all_queued() {
            self.departure.set_mark(link);
        }
        self.arm(link, Timer::Procedure, self.deadline);
        self.arm(link, Timer::Reaction, self.rk512.reaction_until);
        self.arm(link, Timer::Request, self.rk512.answer_until);
        if self.named != self.phase {
            self.name(link);
        }
    }

    fn name(&mut self, link: &mut Context<'_>) {
        self.named = self.phase;
        link.state(self.phase.name());
    }

    #[inline(never)]
    fn arm(&mut self, link: &mut Context<'_>, timer: Timer, deadline: Micros) {
        self.timers.set(link, timer, (deadline != NEVER).then_some(deadline));
    }

    pub(crate) fn has_job(&self) -> bool {
        self.job.stage != Stage::None
    }
}
