//! The feed: sends a program to the control, which lets it flow by DC1 and DC3.

mod holds;
mod queue;

use crate::reason::Reason;
use crate::state::State;
use crate::tape::{Encoder, MOST_PER_BYTE, Setup};
use crate::timer::Timer;
use queue::PIECE;
use softplug_plugin::{Context, Failure, JobId, JobStart, MarkId, MarkState, Pass};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Timer: no DC1 since the job began, DC3 for too long, or no final DC3.
pub(crate) const WAIT: u8 = 0;

/// Bytes asked for at a time: what they become fits the output buffer, and work on
/// them a call's fuel.
const MOST_WANTED: u32 = 2_048;

/// What the feed is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
enum Stage {
    /// No job.
    Idle,
    /// Looking at the data of a job, sending nothing.
    Checking,
    /// Leader and program.
    Feeding,
    /// All data was given; what it became is not wholly queued.
    Closing,
    /// The trailer.
    Trailing,
    /// All is queued; waiting until the last byte has left.
    Draining,
    /// All has left; waiting for the final DC3.
    Waiting,
    /// The queue is being dropped; then the job fails, or is done.
    Stopping,
}

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Feed {
    timer: Timer,
    /// Bytes queued for the job.
    queued: u64,
    job: u32,
    /// The job whose check was good: its block to begin with is there.
    checked: u32,
    /// Asked for and not yet given.
    wanted: u32,
    /// NULs of the leader or trailer still to be queued.
    nuls: u32,
    /// The mark on the program's last byte; that on the trailer's is one more.
    mark: u32,
    /// Why the job fails that is being stopped.
    failure: Reason,
    stage: Stage,
    /// The program's last byte can have left: a DC3 is the final one.
    is_read: bool,
    /// DC1 was the last that the control said.
    pub(crate) is_ready: bool,
    /// The control has said DC1 for this job.
    is_started: bool,
    is_paused: bool,
    /// Whether the queue is held for any of these reasons.
    is_holding: bool,
    /// In the remote buffer's mode it is the packets' while they have the job.
    pub(crate) encoder: Encoder,
}

impl Feed {
    /// Whether there is a job.
    pub(crate) fn is_busy(&self) -> bool {
        self.stage != Stage::Idle
    }

    /// Whether the control reads: it has said DC1 for the job under way.
    pub(crate) fn is_sending(&self) -> bool {
        self.is_started
    }

    /// Whether the control takes characters of the job now.
    pub(crate) fn is_reading(&self) -> bool {
        self.is_started && self.is_ready
    }

    /// What people are told, if there is a job.
    pub(crate) fn state(&self) -> Option<State> {
        let state = match self.stage {
            Stage::Idle => return None,
            Stage::Checking => State::Checking,
            Stage::Stopping => State::Stopping,
            Stage::Waiting => State::Ending,
            _ if !self.is_started => State::WaitingForDc1,
            _ if !self.is_ready => State::Held,
            _ if self.is_paused => State::Paused,
            _ => State::Sending,
        };
        Some(state)
    }

    /// A job begins, for the check or for good.
    pub(crate) fn job_begin(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        job: &JobStart<'_>,
    ) {
        let is_check = job.pass == Pass::Check;
        let refusal = if self.is_busy() {
            Some(Failure::Busy)
        } else if job.kind != 0 {
            Some(Failure::NotSupported)
        } else {
            self.encoder.begin(&job.fields).err()
        };
        let status = refusal.map_or(0, |failure| self.encoder.status(failure));
        // Without a check it would be known too late that the block is not there.
        let is_blind = !is_check && self.encoder.seeks() && self.checked != job.job.0;
        if let Some(failure) = refusal.or(is_blind.then_some(Failure::BadJob)) {
            if is_check {
                link.check_failed_with(job.job, failure, status, 0, 0);
            } else {
                link.job_failed(job.job, failure, status, 0);
            }
            return;
        }
        self.job = job.job.0;
        self.wanted = 0;
        if is_check {
            self.stage = Stage::Checking;
        } else {
            self.stage = Stage::Feeding;
            self.queued = 0;
            self.nuls = settings.leader as u32;
            self.is_started = self.is_ready;
            self.is_read = false;
            self.update_hold(link);
            self.watch(link, settings);
        }
        self.go_on(link, settings);
    }

    pub(crate) fn job_data(&mut self, link: &mut Context<'_>, settings: &Setup, bytes: &[u8]) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        match self.stage {
            Stage::Checking => {
                for byte in bytes {
                    if let Err(failure) = self.encoder.push(settings, *byte) {
                        let place = self.encoder.position();
                        return self.checked(link, Err(failure), place);
                    }
                    if let Err(failure) = self.skip_preamble(settings) {
                        // Of the block behind it, unless it is the preamble itself.
                        let is_of_file = failure == Failure::UnsupportedCharacter;
                        let place = if is_of_file { self.encoder.position() } else { (0, 0) };
                        return self.checked(link, Err(failure), place);
                    }
                }
            }
            Stage::Feeding => {
                for byte in bytes {
                    if let Err(failure) = self.encoder.push(settings, *byte) {
                        return self.stop(link, failure);
                    }
                    if self.encoder.output.len() > PIECE - MOST_PER_BYTE {
                        self.flush(link);
                    }
                }
            }
            _ => return,
        }
        self.go_on(link, settings);
    }

    pub(crate) fn job_end(&mut self, link: &mut Context<'_>, settings: &Setup) {
        match self.stage {
            Stage::Checking => {
                let mut finished = self.encoder.finish(settings);
                if self.encoder.is_waiting() {
                    finished = self.skip_preamble(settings);
                    finished = finished.and_then(|()| self.encoder.finish(settings));
                }
                self.checked(link, finished, (0, 0));
            }
            Stage::Feeding => {
                self.stage = Stage::Closing;
                self.go_on(link, settings);
            }
            _ => {}
        }
    }

    fn skip_preamble(&mut self, settings: &Setup) -> Result<(), Failure> {
        while self.encoder.is_waiting() {
            self.encoder.next(settings)?;
        }
        Ok(())
    }

    /// The check has ended; a fault has a line and column, or 0 for both.
    fn checked(
        &mut self,
        link: &mut Context<'_>,
        result: Result<(), Failure>,
        (line, column): (u32, u32),
    ) {
        self.stage = Stage::Idle;
        match result {
            Ok(()) => {
                self.checked = self.job;
                link.check_good(JobId(self.job));
            }
            Err(failure) => {
                let status = self.encoder.status(failure);
                link.check_failed_with(JobId(self.job), failure, status, line, column);
            }
        }
    }

    /// Does all that there is room for: leader, program, trailer.
    pub(crate) fn go_on(&mut self, link: &mut Context<'_>, settings: &Setup) {
        match self.stage {
            // What the encoder gives is the packets'.
            Stage::Idle => return,
            Stage::Checking => return self.ask(link, MOST_WANTED),
            _ => {}
        }
        if !self.queue_nuls(link) || !self.flush(link) {
            return;
        }
        while self.encoder.is_waiting() && matches!(self.stage, Stage::Feeding | Stage::Closing) {
            if let Err(failure) = self.encoder.next(settings) {
                return self.stop(link, failure);
            }
            if !self.flush(link) {
                return;
            }
        }
        if self.stage == Stage::Feeding {
            if !self.encoder.is_ended() {
                let most = self.most(link, settings);
                return self.ask(link, most);
            }
            self.stage = Stage::Closing;
        }
        if self.stage == Stage::Closing {
            if let Err(failure) = self.encoder.finish(settings) {
                return self.stop(link, failure);
            }
            if self.encoder.is_waiting() {
                return self.go_on(link, settings);
            }
            if !self.flush(link) {
                return;
            }
            self.mark = self.mark.wrapping_add(2).max(2);
            link.transmit_marked(MarkId(self.mark), &[]);
            self.nuls = settings.trailer as u32;
            self.stage = Stage::Trailing;
        }
        if self.stage == Stage::Trailing && self.queue_nuls(link) {
            link.transmit_marked(MarkId(self.mark.wrapping_add(1)), &[]);
            self.stage = Stage::Draining;
        }
    }

    /// As much data as can be taken whatever it becomes, with the output empty.
    fn most(&self, link: &Context<'_>, settings: &Setup) -> u32 {
        if self.encoder.will_wait() {
            return 1;
        }
        let room = link.transmit_room().min(MOST_WANTED);
        (room + (PIECE - MOST_PER_BYTE) as u32).checked_div(settings.growth()).unwrap_or_default()
    }

    fn ask(&mut self, link: &mut Context<'_>, most: u32) {
        // Small requests would make many small events.
        if most > self.wanted && (most - self.wanted >= most / 4 || self.wanted == 0) {
            link.want(JobId(self.job), most - self.wanted);
            self.wanted = most;
        }
    }

    /// News of a marked byte: the program's last one, the trailer's, or one of a job
    /// that is over.
    pub(crate) fn mark(
        &mut self,
        link: &mut Context<'_>,
        settings: &Setup,
        mark: MarkId,
        state: MarkState,
    ) {
        let is_queued = matches!(self.stage, Stage::Trailing | Stage::Draining);
        if mark == MarkId(self.mark) && is_queued && state == MarkState::MaybeLeft {
            self.is_read = true;
        }
        let is_last = mark == MarkId(self.mark.wrapping_add(1)) && self.stage == Stage::Draining;
        if !is_last || state != MarkState::SurelyLeft {
            return;
        }
        if settings.end_wait == 0 {
            self.end(link);
        } else {
            self.stage = Stage::Waiting;
            self.watch(link, settings);
        }
    }

    /// The program has been read; what is left of the trailer nobody wants.
    fn end(&mut self, link: &mut Context<'_>) {
        self.drop_rest(link, None);
    }

    /// Stops at once. The job fails when it is known how much was sent.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.drop_rest(link, Some(failure));
    }

    fn drop_rest(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        match self.stage {
            Stage::Idle | Stage::Stopping => {}
            Stage::Checking => {
                self.stage = Stage::Idle;
                link.job_failed(JobId(self.job), failure.unwrap_or(Failure::Internal), 0, 0);
            }
            _ => {
                self.stage = Stage::Stopping;
                self.failure = Reason::new(failure);
                self.nuls = 0;
                self.encoder.output.clear();
                link.discard();
                // Nothing that the control said for this job counts for the next; what it
                // says from here on, also in the same event, does.
                self.is_read = false;
                self.is_ready = false;
                self.is_started = false;
            }
        }
    }

    /// So many of the bytes that were queued were not sent.
    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, settings: &Setup, bytes: u32) {
        if self.stage != Stage::Stopping {
            return;
        }
        let sent = self.queued.saturating_sub(u64::from(bytes));
        match self.failure.failure() {
            Some(failure) => link.job_failed(JobId(self.job), failure, 0, sent),
            None => link.job_done(JobId(self.job), sent),
        }
        self.stage = Stage::Idle;
        self.is_paused = false;
        self.update_hold(link);
        self.watch(link, settings);
    }
}
