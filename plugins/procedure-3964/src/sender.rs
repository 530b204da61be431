//! The sender: set-up, block, acknowledgement, and the attempts at each.

use crate::Layer;
use crate::cause::*;
use crate::frame::{DLE, ETX, Encoder, NAK, STX};
use crate::job::Stage;
use crate::machine::{Machine, NEVER, Owner, put};
use crate::phase::Phase;

use softplug_plugin::{Context, JobStart};

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
            let fits = self.job.block.extend(bytes);
            let taken = match self.options.layer {
                Layer::Rk512 => self.telegram_data(),
                Layer::None => self.block_data(fits),
            };
            self.took(link, taken);
        }
    }

    fn block_data(&mut self, fits: bool) -> Result<(), Cause> {
        let length = i64::from(self.job.block.len());
        if !fits || length > self.options.block_size {
            return Err(JOB_TOO_LONG);
        }
        if self.options.split && length == self.options.block_size {
            return self.block_ready();
        }
        Ok(())
    }

    fn block_ready(&mut self) -> Result<(), Cause> {
        let holds_end = |data: &[u8]| data.windows(2).any(|pair| matches!(pair, [DLE, ETX]));
        if !self.options.doubling && holds_end(self.job.block.as_slice()) {
            return Err(END_IN_DATA);
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
        self.settle(link);
    }

    pub(crate) fn set_paused(&mut self, link: &mut Context<'_>, paused: bool) {
        self.job.paused = paused;
        self.settle(link);
    }

    /// Aborts the job. Only a reception that it waits for goes on undisturbed.
    pub(crate) fn abort(&mut self, link: &mut Context<'_>, job: u32) {
        // A delivery under way is what a job reads.
        if self.has_job() && (job != 0 || self.rk512.is_delivering()) {
            let is_on_line = self.phase.is_sender() && self.owner == Owner::Job;
            if is_on_line {
                self.drop_queue(link);
                self.idle();
            }
            let is_told = self.phase == Phase::Idle;
            if is_on_line || (self.job.sent > 0 && is_told) {
                put(link, NAK);
                if is_on_line && !self.options.handshake {
                    // The partner does not answer STX, and takes one for data while
                    // it is still in the block.
                    self.departure.watch();
                }
            }
            self.fail_job(link, ABORTED);
        }
        self.settle(link);
    }

    /// The job fails, if there is one: at once, or when it is known how much
    /// left for it.
    pub(crate) fn fail_job(&mut self, link: &mut Context<'_>, cause: Cause) {
        if !self.has_job() || self.job.failing.is_some() {
            return;
        }
        self.end_reading(link, Some(cause));
        if self.discards == 0 {
            self.job.failed(link, cause);
        } else {
            self.job.stage = Stage::Failing;
            self.job.failing = Some(cause);
        }
    }

    #[inline(never)]
    pub(crate) fn drop_queue(&mut self, link: &mut Context<'_>) {
        link.discard();
        self.discards = self.discards.saturating_add(1);
        self.discards_job = self.phase.is_sender() && self.owner == Owner::Job;
        self.departure.forget();
    }

    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.discards = self.discards.saturating_sub(1);
        if self.discards_job {
            self.job.sent = self.job.sent.saturating_sub(bytes.into());
        }
        if self.discards == 0
            && let Some(cause) = self.job.failing
        {
            self.job.failed(link, cause);
        }
        self.finish(link);
    }

    /// Begins what may be sent, if the line is idle.
    pub(crate) fn begin_block(&mut self, link: &mut Context<'_>) {
        let is_quiet = self.deadline == NEVER && !self.departure.is_watching();
        if self.phase != Phase::Idle || !is_quiet {
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
        self.send(link, STX);
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
        if self.phase != Phase::Sending || self.encoder.is_at_end() {
            return false;
        }
        while link.output_room() > KEPT_OUTPUT && link.transmit_room() > KEPT_ROOM {
            let data = match self.owner {
                Owner::Job => self.job.block.as_slice(),
                Owner::Reaction => self.rk512.reaction.as_slice(),
            };
            let Some(byte) = self.encoder.next(&self.options, data) else { break };
            self.send(link, byte);
        }
        if self.encoder.is_at_end() {
            self.departure.watch();
            return false;
        }
        link.output_room() <= KEPT_OUTPUT
    }

    /// A byte that counts as sent for its job.
    fn send(&mut self, link: &mut Context<'_>, byte: u8) {
        if put(link, byte) && self.owner == Owner::Job {
            self.job.sent += 1;
        }
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
        put(link, NAK);
        self.end_block(link, cause);
    }

    /// Our block has failed for good.
    pub(crate) fn end_block(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.idle();
        match self.owner {
            Owner::Job => self.fail_job(link, cause),
            Owner::Reaction => self.rk512.reaction_ended(),
        }
    }

    pub(crate) fn acknowledged(&mut self, link: &mut Context<'_>) {
        self.idle();
        if self.owner == Owner::Reaction {
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
