//! The sender: set-up, block, acknowledgement, and the attempts at each.

use crate::Layer;
use crate::cause::*;
use crate::frame::{DLE, ETX, Encoder, NAK, STX};
use crate::job::Stage;
use crate::machine::{Machine, NEVER, Owner, put};
use crate::phase::Phase;

use softplug_plugin::{Context, JobStart, mutant};

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
            (Layer::Rk512, SEND) if mutant!("rk512.job.kinds/plain-block-sent") => {
                self.options.layer = Layer::None;
                self.begin_send(link, start.size)
            }
            (Layer::None, _) if mutant!("rk512.job.kinds/data-sent-plain") => {
                self.begin_send(link, start.size)
            }
            (Layer::None, SEND) => self.begin_send(link, start.size),
            (Layer::Rk512, kind) if kind != SEND => self.begin_telegram(link, start),
            _ => Err(NOT_SUPPORTED),
        };
        self.took(link, begun);
    }

    fn begin_send(&mut self, link: &mut Context<'_>, size: Option<u64>) -> Result<(), Cause> {
        let is_longer = |size: u64| {
            size + u64::from(mutant!("r3964.tx.too-long/one-less"))
                > self.options.block_size as u64 + u64::from(mutant!("r3964.tx.too-long/one-more"))
        };
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
        let length = i64::from(self.job.block.len()) + self.mutant_length();
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
        let is_sent = mutant!("r3964-simplified.line.no-doubling/end-in-data-sent");
        if !self.options.doubling && holds_end(self.job.block.as_slice()) && !is_sent {
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
                Layer::None
                    if (self.job.sent > 0 || mutant!("r3964.line.frame/empty-block-not-sent"))
                        && self.job.block.is_empty()
                        && !mutant!("r3964.tx.split/empty-block-behind") =>
                {
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
        let is_deaf = mutant!("rk512.job.abort/not-while-the-reaction-is-awaited")
            && self.job.stage == Stage::Awaiting;
        if self.has_job() && (job != 0 || self.rk512.is_delivering()) && !is_deaf {
            let is_on_line = self.phase.is_sender() && self.owner == Owner::Job;
            if is_on_line {
                if !mutant!("r3964.tx.abort/rest-sent") {
                    self.drop_queue(link);
                }
                self.idle();
            }
            let is_told =
                self.phase == Phase::Idle || mutant!("r3964.tx.abort/nak-though-it-gave-way");
            let is_always_told = mutant!("r3964.tx.abort/nak-though-unsent");
            if is_on_line || (self.job.sent > 0 && is_told) || is_always_told {
                if !mutant!("r3964.tx.abort/no-nak") {
                    put(link, NAK);
                }
                let is_free = mutant!("r3964-simplified.tx.abort/no-silence");
                if is_on_line && !self.options.handshake && !is_free {
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
        let is_good = mutant!("rk512.job.abort/what-came-is-good");
        self.end_reading(link, Some(cause).filter(|_| !is_good));
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
        if (self.phase != Phase::Idle || !is_quiet) && !self.is_mutant_impatient() {
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
        let gave_way = self.owner == Owner::Job && self.job.sent > 0;
        if mutant!("r3964.tx.split/without-set-up") && gave_way {
            self.send_block();
            return;
        }
        if !(mutant!("r3964.conflict.attempts-anew/blocks-counted-on") && gave_way) {
            self.transmissions = 1;
        }
        if !(mutant!("r3964.conflict.attempts-anew/set-ups-counted-on") && gave_way) {
            self.setups = 1;
        }
        self.set_up(link);
    }

    fn set_up(&mut self, link: &mut Context<'_>) {
        self.send(link, STX);
        if !mutant!("r3964.conflict.both-high/seen-in-any-attempt") {
            self.stx_seen = false;
        }
        self.deadline = NEVER;
        if self.options.handshake && !mutant!("r3964.tx.set-up/dle-not-awaited") {
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
        let seed = if mutant!("r3964.line.bcc/stx-in-a-repetition") && self.transmissions > 1 {
            STX
        } else {
            0
        };
        self.encoder = Encoder::seeded(seed);
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
        if self.is_mutant_firm(link) {
            return;
        }
        self.set_up_asked(link, false);
        self.withdrew = true;
    }

    pub(crate) fn repeat_set_up(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.warn(link, cause.status());
        if i64::from(self.setups) >= self.options.setup_attempts {
            if mutant!("r3964.tx.set-up-attempts/no-nak") {
                self.end_block(link, cause);
                return;
            }
            let is_silence = mutant!("r3964.tx.set-up-attempts/always-unanswered");
            self.give_up(link, if is_silence { SET_UP_UNANSWERED } else { cause });
        } else {
            self.setups += 1;
            self.set_up(link);
        }
    }

    pub(crate) fn has_attempts(&self) -> bool {
        if mutant!("3964.tx.repeat/not-repeated") && !self.options.bcc {
            return false;
        }
        let transmissions = i64::from(self.transmissions)
            + i64::from(mutant!("r3964.tx.transmission-attempts/one-less"))
            - i64::from(mutant!("r3964.tx.transmission-attempts/one-more"));
        transmissions < self.options.transmission_attempts
    }

    pub(crate) fn repeat_block(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.warn(link, cause.status());
        if mutant!("r3964.tx.repeat/refused-for-good") && cause == END_REFUSED {
            self.give_up(link, cause);
            return;
        }
        if self.has_attempts() {
            if self.transmissions == 1 {
                self.warn(link, FIRST_REPETITION);
            }
            self.transmissions += 1;
            if !mutant!("r3964.tx.set-up-attempts/counted-on") {
                self.setups = 1;
            }
            if mutant!("r3964.tx.repeat/without-set-up") {
                self.send_block();
                return;
            }
            self.set_up(link);
        } else if mutant!("r3964.tx.transmission-attempts/no-nak") {
            self.end_block(link, ATTEMPTS_USED_UP);
        } else if mutant!("r3964-simplified.tx.one-transmission/no-nak") {
            self.end_block(link, cause);
        } else if self.options.transmission_attempts > 1 || mutant!("r3964.tx.one-attempt/used-up")
        {
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
            Owner::Job if mutant!("rk512.send.underneath/no-reaction") => {
                self.fail_job(link, NO_REACTION);
            }
            Owner::Job => self.fail_job(link, cause),
            Owner::Reaction => self.rk512.reaction_ended(),
        }
    }

    pub(crate) fn acknowledged(&mut self, link: &mut Context<'_>) {
        let deadline = self.deadline;
        self.idle();
        if mutant!("r3964.tx.acknowledged/delay-not-cancelled") {
            self.deadline = deadline;
        }
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
