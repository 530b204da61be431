//! The sender: set-up, block, acknowledgement, and the attempts at each.

use crate::Layer;
use crate::cause::*;
use crate::frame::{DLE, Encoder, NAK, STX, holds_end, holds_wider};
use crate::job::Stage;
use crate::machine::{Machine, NEVER, Owner};
use crate::phase::Phase;
use crate::queue::{Meant, Part, Run, Runs};

use softplug_plugin::{Context, JobId, JobStart};

/// Place of `send` in the manifest's list of jobs.
const SEND: u16 = 0;
/// Output that a block leaves free: a long one takes two rounds, so that none
/// uses up a host's patience.
const KEPT_OUTPUT: usize = 2_048;
/// Room that a block leaves free for control characters.
const KEPT_ROOM: u32 = 8;

impl Machine {
    pub(crate) fn job_begin(&mut self, link: &mut Context<'_>, start: &JobStart<'_>) {
        self.job.begin(start.job, start.kind);
        let begun = match (self.options.layer, start.kind) {
            (Layer::None, SEND) => self.begin_send(link, start.size),
            (Layer::Rk512, kind) if kind != SEND => self.begin_telegram(link, start),
            _ => Err(NOT_SUPPORTED),
        };
        self.took(link, begun);
    }

    fn begin_send(&mut self, link: &mut Context<'_>, size: Option<u64>) -> Result<(), Cause> {
        let is_longer = |size: u64| size > self.options.block_size as u64;
        if !self.options.split && size.is_some_and(is_longer) {
            return Err(JOB_TOO_LONG);
        }
        self.want_block(link);
        Ok(())
    }

    /// Asks for a block, and for one byte more where there must be no more.
    fn want_block(&mut self, link: &mut Context<'_>) {
        let more = u32::from(!self.options.split);
        link.want(self.job.id, self.options.block_size as u32 + more);
    }

    pub(crate) fn job_data(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        if self.job.stage == Stage::Filling {
            let fits = self.job.block.extend(bytes) == bytes.len();
            let taken = match self.options.layer {
                Layer::Rk512 => self.telegram_data(),
                Layer::None => self.block_data(fits),
            };
            self.took(link, taken);
        }
    }

    fn block_data(&mut self, fits: bool) -> Result<(), Cause> {
        let length = self.job.block.len() as i64;
        if !fits || length > self.options.block_size {
            return Err(JOB_TOO_LONG);
        }
        if self.options.split && length == self.options.block_size {
            return self.block_ready();
        }
        Ok(())
    }

    /// The block, or the telegram, may be sent.
    pub(crate) fn block_ready(&mut self) -> Result<(), Cause> {
        if !self.options.doubling && holds_end(self.job.block.as_slice()) {
            return Err(END_IN_DATA);
        }
        // The line would carry another byte, and the check would agree.
        if holds_wider(self.job.block.as_slice(), self.data_bits) || self.needs_wide_follow_up() {
            return Err(TOO_WIDE);
        }
        self.job.stage = Stage::Ready;
        Ok(())
    }

    pub(crate) fn job_end(&mut self, link: &mut Context<'_>) {
        self.job.ended = true;
        if self.job.stage == Stage::Filling {
            let ended = match self.options.layer {
                Layer::Rk512 => self.telegram_end(),
                // Not the first block, and there is no other.
                Layer::None if self.job.sent > 0 && self.job.block.is_empty() => {
                    self.job.done(link);
                    Ok(())
                }
                Layer::None => self.block_ready(),
            };
            self.took(link, ended);
        }
    }

    /// What the host gave was taken, or the job fails; nothing of it was sent then.
    #[inline(never)]
    fn took(&mut self, link: &mut Context<'_>, taken: Result<(), Cause>) {
        if let Err(cause) = taken {
            self.job.failed(link, cause);
        }
        self.begin_block(link);
    }

    pub(crate) fn set_paused(&mut self, link: &mut Context<'_>, paused: bool) {
        self.job.paused = paused;
        self.begin_block(link);
    }

    /// Aborts the job. Only a reception that it waits for goes on undisturbed.
    pub(crate) fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        // A delivery under way is what a job reads.
        if self.has_job() && (job != JobId::NONE || self.rk512.is_delivering()) {
            let is_on_line = self.phase.is_sender() && self.owner == Owner::Job;
            if is_on_line {
                self.drop_queue(link);
                self.idle();
                self.owes_nak = true;
            } else if self.job.sent > 0 && self.phase == Phase::Idle {
                self.put(link, NAK);
            } else if self.phase.is_receiver()
                && self.job.stage == Stage::Begun
                && self.owner == Owner::Job
            {
                // It gave way: its STX need not have left. That of a reaction stays.
                self.drop_queue(link);
            }
            self.fail_job(link, ABORTED);
        }
        self.begin_block(link);
    }

    /// The job fails, if there is one: at once, or when it is known how much
    /// left for it.
    pub(crate) fn fail_job(&mut self, link: &mut Context<'_>, cause: Cause) {
        if !self.has_job() || self.job.failing.0.is_some() {
            return;
        }
        self.end_reading(link, Some(cause));
        if self.discards {
            self.job.stage = Stage::Failing;
            self.job.failing.0 = Some(cause);
        } else {
            self.job.failed(link, cause);
        }
    }

    /// Nothing more of our block is sent; what answers the partner is.
    #[inline(never)]
    pub(crate) fn drop_queue(&mut self, link: &mut Context<'_>) {
        self.discard(link, Meant::BLOCK);
        if self.phase.is_sender() {
            self.departure.forget();
        } else {
            self.departure.watch_again();
        }
    }

    /// The DLE that answers STX is not sent, if the port has not been given it.
    pub(crate) fn take_grant_back(&mut self, link: &mut Context<'_>) {
        if self.phase == Phase::Receiving && self.departure.is_pending() {
            self.discard(link, Meant::GRANT);
            self.departure.forget();
        }
    }

    #[inline(never)]
    pub(crate) fn discard(&mut self, link: &mut Context<'_>, meant: Meant) {
        self.waiting.drop(meant);
        if self.discards {
            // What the discard before has taken does not come again if it is meant now.
            self.meant = self.meant.and(meant);
        } else {
            self.meant = meant;
            self.discards = true;
            link.discard();
        }
    }

    /// So many of the last characters were dropped: those that were not meant are queued
    /// again, before all that came since.
    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.discards = false;
        let mut dropped = Runs::new();
        let mut left = bytes;
        while left > 0
            && let Some(run) = self.queued.last(left)
        {
            left -= u32::from(run.count);
            if run.part.is_of_job() {
                self.job.sent = self.job.sent.saturating_sub(run.count.into());
            }
            if !self.meant.covers(run.part) && !run.part.is_block() {
                dropped.push(run);
            }
        }
        self.waiting.put_before(&dropped);
        if core::mem::take(&mut self.owes_nak) && self.job.sent > 0 {
            self.put(link, NAK);
            if !self.options.handshake {
                // The partner does not answer STX, and takes one for data while it is
                // still in the block.
                self.departure.watch();
            }
        }
        if let Some(cause) = self.job.failing.0 {
            self.job.failed(link, cause);
        }
        self.begin_block(link);
    }

    /// Sends a control character. Where it cannot be queued at once it waits.
    #[inline(never)]
    pub(crate) fn put(&mut self, link: &mut Context<'_>, byte: u8) {
        self.queue(link, byte, Part::Answer);
    }

    pub(crate) fn grant(&mut self, link: &mut Context<'_>) {
        self.queue(link, DLE, Part::Grant);
    }

    pub(crate) fn is_all_queued(&self) -> bool {
        !self.discards && self.waiting.is_empty()
    }

    #[inline(never)]
    fn queue(&mut self, link: &mut Context<'_>, byte: u8, part: Part) {
        let run = Run { count: 1, byte, part };
        if !self.is_all_queued() || link.transmit_room() == 0 {
            // Where even that has no place, the partner's time-out has to do.
            self.waiting.push(run);
            return;
        }
        link.transmit(&[byte]);
        self.queued.remember(run);
        if part.is_of_job() {
            self.job.sent += 1;
        }
    }

    /// Queues what waits; whether the output cut it short.
    pub(crate) fn queue_waiting(&mut self, link: &mut Context<'_>) -> bool {
        if self.discards || self.waiting.is_empty() {
            return false;
        }
        let mut waiting = core::mem::replace(&mut self.waiting, Runs::new());
        while link.transmit_room() > 0
            && link.output_room() > KEPT_OUTPUT
            && let Some(run) = waiting.first()
        {
            self.queue(link, run.byte, run.part);
        }
        self.waiting = waiting;
        !self.waiting.is_empty() && link.transmit_room() > 0
    }

    /// Begins what may be sent, if the line is idle.
    pub(crate) fn begin_block(&mut self, link: &mut Context<'_>) {
        let is_quiet = self.deadline == NEVER && !self.departure.is_watching();
        if self.phase != Phase::Idle || !is_quiet || self.owes_nak {
            return;
        }
        if self.rk512.reaction_ready {
            self.owner = Owner::Reaction;
        } else if self.job.may_send() {
            self.owner = Owner::Job;
            self.job.stage = Stage::Begun;
        } else {
            return;
        }
        self.transmissions = 1;
        self.setups = 1;
        self.set_up(link);
    }

    fn set_up(&mut self, link: &mut Context<'_>) {
        let part = match self.owner {
            Owner::Job => Part::JobSetUp,
            Owner::Reaction => Part::ReactionSetUp,
        };
        self.queue(link, STX, part);
        self.stx_seen = false;
        self.deadline = NEVER;
        if self.options.handshake {
            self.phase = Phase::DleWait;
            self.departure.watch();
        } else {
            self.send_block();
        }
    }

    pub(crate) fn send_block(&mut self) {
        self.phase = Phase::Sending;
        self.deadline = NEVER;
        self.departure.forget();
        self.encoder = Encoder::default();
    }

    /// Queues as much of the block as may be; whether the output cut it short.
    pub(crate) fn pump(&mut self, link: &mut Context<'_>) -> bool {
        let is_ours = self.phase == Phase::Sending && self.is_all_queued();
        if !is_ours || self.encoder.is_at_end() {
            return false;
        }
        while link.output_room() > KEPT_OUTPUT && link.transmit_room() > KEPT_ROOM {
            let data = match self.owner {
                Owner::Job => self.job.block.as_slice(),
                Owner::Reaction => self.rk512.reaction.as_slice(),
            };
            let Some(byte) = self.encoder.next(&self.options, data) else { break };
            let part = match self.owner {
                Owner::Job => Part::Job,
                Owner::Reaction => Part::Reaction,
            };
            self.queue(link, byte, part);
        }
        if self.encoder.is_at_end() {
            self.departure.watch();
            return false;
        }
        link.output_room() <= KEPT_OUTPUT
    }

    /// Low priority: the partner's block goes first.
    pub(crate) fn withdraw(&mut self, link: &mut Context<'_>) {
        self.set_up_asked(link, false);
        self.withdrew = true;
    }

    pub(crate) fn repeat_set_up(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.warn(link, cause.status());
        if i64::from(self.setups) >= self.options.setup_attempts {
            self.give_up(link, cause);
        } else {
            self.setups += 1;
            self.set_up(link);
        }
    }

    pub(crate) fn has_attempts(&self) -> bool {
        let transmissions = i64::from(self.transmissions);
        transmissions < self.options.transmission_attempts
    }

    pub(crate) fn repeat_block(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.warn(link, cause.status());
        if self.has_attempts() {
            if self.transmissions == 1 {
                self.warn(link, FIRST_REPETITION);
            }
            self.transmissions += 1;
            self.setups = 1;
            self.set_up(link);
        } else if self.options.transmission_attempts > 1 {
            self.give_up(link, ATTEMPTS_USED_UP);
        } else {
            self.give_up(link, cause);
        }
    }

    fn give_up(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.put(link, NAK);
        self.end_block(link, cause);
    }

    /// Our block has failed for good.
    pub(crate) fn end_block(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.idle();
        match self.owner {
            // One that came behind an abort of this one's job waits.
            Owner::Job if self.job.stage != Stage::Begun => {}
            Owner::Job => self.fail_job(link, cause),
            Owner::Reaction => self.rk512.reaction_ended(),
        }
    }

    pub(crate) fn acknowledged(&mut self, link: &mut Context<'_>) {
        self.idle();
        if self.owner == Owner::Reaction {
            self.rk512.advance();
            self.rk512.reaction_ended();
            return;
        }
        match self.options.layer {
            Layer::Rk512 => self.await_reaction(link),
            Layer::None if self.job.ended => self.job.done(link),
            Layer::None => {
                self.job.stage = Stage::Filling;
                self.job.block.clear();
                self.want_block(link);
            }
        }
    }
}
