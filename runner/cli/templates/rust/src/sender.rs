//! Sends a job line by line, and waits for the answer to each.

use crate::buffer::Buffer;
use crate::{ACK, LF, NAK, Settings};
use softplug_plugin::{Context, Failure, MarkState, Micros, StateError, StateReader, StateWriter};

/// The only timer: no answer has come.
const ANSWER_TIME: u8 = 0;
/// Marks of lines count up from here.
const FIRST_MARK: u32 = 2;

/// What a job waits for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Stage {
    /// Nothing: there is no job.
    Idle,
    /// A whole line of its data.
    Filling,
    /// Room to transmit the rest of the line.
    Sending,
    /// The line's last byte to leave.
    Leaving,
    /// The answer.
    Answer,
    /// To be told how much of it never left.
    Stopping(Failure),
}

#[derive(Debug)]
pub(crate) struct Sender {
    answer_time: Micros,
    repeats: u8,
    stage: Stage,
    job: u32,
    /// The line that is on its way, and data behind it.
    text: Buffer,
    /// Bytes of data that the host was asked for and has not given yet.
    asked: usize,
    /// The host has no more data.
    has_ended: bool,
    is_paused: bool,
    /// Bytes of the line that were transmitted.
    transmitted: usize,
    /// How often the line was refused.
    refusals: u8,
    /// Mark of the line's last byte.
    mark: u32,
    /// Until when the answer must have come.
    deadline: Option<Micros>,
    /// Bytes transmitted for this job.
    sent: u64,
}

impl Sender {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            answer_time: Micros::from_millis(settings.answer_time),
            repeats: settings.repeats as u8,
            stage: Stage::Idle,
            job: 0,
            text: Buffer::new(),
            asked: 0,
            has_ended: false,
            is_paused: false,
            transmitted: 0,
            refusals: 0,
            mark: FIRST_MARK,
            deadline: None,
            sent: 0,
        }
    }

    pub(crate) fn begin(&mut self, link: &mut Context<'_>, job: u32) {
        self.job = job;
        self.text.clear();
        self.asked = 0;
        self.has_ended = false;
        self.is_paused = false;
        self.transmitted = 0;
        self.refusals = 0;
        self.sent = 0;
        self.stage = Stage::Filling;
        link.state("sending");
        self.go_on(link);
    }

    /// Data of the job, never more than was asked for.
    pub(crate) fn take(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.asked -= bytes.len();
        for byte in bytes {
            // The other side would take it for an answer.
            if matches!(*byte, ACK | NAK) {
                return self.stop(link, Failure::UnsupportedCharacter);
            }
            self.text.push(*byte);
        }
        self.go_on(link);
    }

    /// The last line gets its LF if it has none.
    pub(crate) fn data_ended(&mut self, link: &mut Context<'_>) {
        self.has_ended = true;
        self.asked = 0;
        let is_whole = matches!(self.text.as_slice(), [] | [.., LF]);
        if !is_whole && !self.text.push(LF) {
            return self.stop(link, Failure::TooLong);
        }
        self.go_on(link);
    }

    /// Does what can be done now.
    pub(crate) fn go_on(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Filling && !self.is_paused {
            match self.line_length() {
                Some(_) => self.stage = Stage::Sending,
                None if self.has_ended => self.done(link),
                None if self.text.room() == 0 => self.stop(link, Failure::TooLong),
                None => self.ask(link),
            }
        }
        if self.stage == Stage::Sending {
            self.transmit(link);
        }
    }

    /// The other side has taken the line.
    pub(crate) fn acknowledged(&mut self, link: &mut Context<'_>) {
        // An answer before the line can have left is none.
        if self.stage != Stage::Answer {
            return;
        }
        self.cancel_timer(link);
        self.text.drop_front(self.line_length().unwrap_or_default());
        self.transmitted = 0;
        self.refusals = 0;
        self.stage = Stage::Filling;
        self.go_on(link);
    }

    /// The other side wants the line again.
    pub(crate) fn refused(&mut self, link: &mut Context<'_>) {
        if self.stage != Stage::Answer {
            return;
        }
        self.cancel_timer(link);
        if self.refusals == self.repeats {
            return self.stop(link, Failure::AttemptsUsedUp);
        }
        self.refusals += 1;
        self.transmitted = 0;
        self.stage = Stage::Sending;
        self.go_on(link);
    }

    /// News of a line's last byte. It is first known that it may have left, then that it has.
    pub(crate) fn line_left(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {
        if mark != self.mark {
            return;
        }
        match state {
            MarkState::MaybeLeft if self.stage == Stage::Leaving => self.stage = Stage::Answer,
            MarkState::SurelyLeft if self.stage == Stage::Answer => {
                self.deadline = Some(link.now() + self.answer_time);
                self.set_timer_again(link);
            }
            _ => {}
        }
    }

    /// Ends the job as soon as it is known how much of it has left.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        if matches!(self.stage, Stage::Idle | Stage::Stopping(_)) {
            return;
        }
        self.cancel_timer(link);
        link.discard();
        self.stage = Stage::Stopping(failure);
    }

    /// So many bytes were dropped: they never left.
    pub(crate) fn stopped(&mut self, link: &mut Context<'_>, dropped: u32) {
        if let Stage::Stopping(failure) = self.stage {
            self.stage = Stage::Idle;
            link.job_failed(self.job, failure, 0, self.sent - u64::from(dropped));
            link.state("idle");
        }
    }

    /// A pause takes effect between two lines.
    pub(crate) fn set_paused(&mut self, link: &mut Context<'_>, is_paused: bool) {
        self.is_paused = is_paused;
        self.go_on(link);
    }

    pub(crate) fn set_timer_again(&self, link: &mut Context<'_>) {
        if let Some(deadline) = self.deadline {
            link.set_timer(ANSWER_TIME, deadline);
        }
    }

    fn cancel_timer(&mut self, link: &mut Context<'_>) {
        if self.deadline.take().is_some() {
            link.cancel_timer(ANSWER_TIME);
        }
    }

    /// Length of the first line, its LF included, if it is there as a whole.
    fn line_length(&self) -> Option<usize> {
        let end = self.text.as_slice().iter().position(|byte| *byte == LF)?;
        Some(end + 1)
    }

    fn ask(&mut self, link: &mut Context<'_>) {
        if self.asked == 0 {
            self.asked = self.text.room();
            link.want(self.job, self.asked as u32);
        }
    }

    /// As much of the line as there is room for.
    fn transmit(&mut self, link: &mut Context<'_>) {
        let end = self.line_length().unwrap_or_default();
        let rest = &self.text.as_slice()[self.transmitted..end];
        let piece = &rest[..rest.len().min(link.transmit_room() as usize)];
        self.sent += piece.len() as u64;
        self.transmitted += piece.len();
        if self.transmitted < end {
            link.transmit(piece);
            return;
        }
        self.mark = self.mark.wrapping_add(1).max(FIRST_MARK);
        link.transmit_marked(self.mark, piece);
        self.stage = Stage::Leaving;
    }

    fn done(&mut self, link: &mut Context<'_>) {
        self.stage = Stage::Idle;
        link.job_done(self.job, self.sent);
        link.state("idle");
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        let (stage, failure) = match self.stage {
            Stage::Idle => (0, None),
            Stage::Filling => (1, None),
            Stage::Sending => (2, None),
            Stage::Leaving => (3, None),
            Stage::Answer => (4, None),
            Stage::Stopping(failure) => (5, Some(failure)),
        };
        state.u8(stage);
        state.failure(failure);
        state.u32(self.job);
        self.text.save(state);
        state.u16(self.asked as u16);
        state.bool(self.has_ended);
        state.bool(self.is_paused);
        state.u16(self.transmitted as u16);
        state.u8(self.refusals);
        state.u32(self.mark);
        state.deadline(self.deadline);
        state.u64(self.sent);
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.stage = match (state.u8(), state.failure()) {
            (0, None) => Stage::Idle,
            (1, None) => Stage::Filling,
            (2, None) => Stage::Sending,
            (3, None) => Stage::Leaving,
            (4, None) => Stage::Answer,
            (5, Some(failure)) => Stage::Stopping(failure),
            _ => return Err(StateError::DAMAGED),
        };
        self.job = state.u32();
        self.text.restore(state)?;
        self.asked = usize::from(state.u16());
        self.has_ended = state.bool();
        self.is_paused = state.bool();
        self.transmitted = usize::from(state.u16());
        self.refusals = state.u8();
        self.mark = state.u32();
        self.deadline = state.deadline();
        self.sent = state.u64();
        let is_sound = self.asked <= self.text.room()
            && self.transmitted <= self.line_length().unwrap_or_default();
        if is_sound { Ok(()) } else { Err(StateError::DAMAGED) }
    }
}
