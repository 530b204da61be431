//! The job: its data as blocks, their marks and repeats.

use crate::block::{CALL, Data, EOT, HEADER, LONG, NAK, SHORT, SOH, STX, check};
use crate::settings::{Mode, Settings};
use crate::stage::Stage;
use softplug_plugin::{Context, Failure, JobId, JobStart, MarkId, MarkState, State, copy};

/// A rest of so many bytes, or fewer, goes in short blocks.
const SHORT_REST: usize = LONG - SHORT;
/// A long block that was sent again so often makes those behind it short.
const TOO_LONG: u32 = 2;
/// Bytes given to the link at a time.
const PIECE: usize = 64;

#[derive(Copy, Clone, Debug, State)]
pub(crate) struct Sender {
    /// Id of the job; 0: none.
    job: JobId,
    /// Why the job fails, once it is known how much of it has left.
    pub(crate) stopping: Option<Failure>,
    /// The host has aborted it; the block under way still leaves.
    pub(crate) is_aborted: bool,
    pub(crate) is_paused: bool,
    is_crc: bool,
    /// Blocks are long as far as there is enough for them.
    is_long: bool,
    has_ended: bool,
    /// A block has been acknowledged.
    pub(crate) is_answered: bool,
    /// What was given last can have left.
    has_left: bool,
    /// The latest character was CAN.
    pub(crate) can_heard: bool,
    /// Data that is not acknowledged.
    data: Data,
    /// Where the block under way begins in it, and how many bytes of a block it is; 0: none yet.
    #[state(within = 0..=LONG as u16)]
    at: u16,
    #[state(within = 0..=LONG as u16)]
    length: u16,
    /// Characters of the block that the link has taken: its room may be smaller.
    given: u16,
    /// The number of the block under way.
    pub(crate) number: u8,
    wanted: u32,
    pub(crate) repeats: u32,
    /// The mark of what was given last.
    mark: MarkId,
    /// Bytes queued for the job.
    queued: u64,
}

impl Sender {
    pub(crate) const fn new(mark: MarkId) -> Self {
        Self {
            job: JobId::NONE,
            stopping: None,
            is_aborted: false,
            is_paused: false,
            is_crc: false,
            is_long: false,
            data: Data::new(),
            at: 0,
            length: 0,
            wanted: 0,
            has_ended: false,
            number: 1,
            is_answered: false,
            given: 0,
            repeats: 0,
            mark,
            has_left: false,
            queued: 0,
            can_heard: false,
        }
    }

    /// A job; one that cannot be taken fails at once.
    pub(crate) fn begin(&mut self, link: &mut Context<'_>, job: &JobStart<'_>) -> bool {
        if self.job != JobId::NONE || job.kind != 0 {
            let why = if self.job == JobId::NONE { Failure::NotSupported } else { Failure::Busy };
            link.job_failed(job.job, why, 0, 0);
            return false;
        }
        *self = Self::new(self.mark);
        self.job = job.job;
        true
    }

    /// Whether there is a job to send.
    pub(crate) fn is_waiting(&self) -> bool {
        self.job != JobId::NONE && self.stopping.is_none()
    }

    /// The receiver calls, with C or NAK: whether we begin.
    pub(crate) fn is_called(&mut self, settings: &Settings, byte: u8) -> bool {
        let is_crc = byte == CALL;
        let is_call = match settings.mode {
            Mode::Checksum => byte == NAK,
            Mode::Crc => is_crc,
            Mode::Auto | Mode::Long => true,
        };
        self.is_crc = is_crc;
        self.is_long = is_crc && settings.mode == Mode::Long;
        is_call
    }

    /// Whether the character asks for the block again.
    pub(crate) fn is_refusal(&self, byte: u8) -> bool {
        byte == NAK || (byte == CALL && self.is_crc && !self.is_answered)
    }

    pub(crate) fn data(&mut self, bytes: &[u8]) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        self.data.extend(bytes);
    }

    pub(crate) fn data_ended(&mut self) {
        self.has_ended = true;
        self.wanted = 0;
    }

    /// Sends the next block, the one under way, or the end, if line, room and host allow it.
    pub(crate) fn next(&mut self, link: &mut Context<'_>, settings: &Settings) -> Stage {
        if self.length == 0 && !self.choose(link) {
            return Stage::Filling;
        }
        // A block that has begun is not paused.
        if self.is_paused && self.given == 0 {
            return Stage::Filling;
        }
        match (self.length, self.give(link, settings)) {
            (_, false) => Stage::Filling,
            (0, true) => Stage::Ending,
            (_, true) => Stage::Answer,
        }
    }

    /// Chooses what goes next: a block, or EOT. `false`: there is not enough data to know.
    fn choose(&mut self, link: &mut Context<'_>) -> bool {
        let rest = self.data.len().saturating_sub(usize::from(self.at));
        if rest == 0 {
            self.data.clear();
            self.at = 0;
        }
        let unit = if self.is_long { LONG } else { SHORT };
        let has_begun = self.at > 0 || rest >= unit;
        if !has_begun && !self.has_ended {
            if self.wanted == 0 {
                self.wanted = (unit - rest) as u32;
                link.want(self.job, self.wanted);
            }
            return false;
        }
        self.length = match rest {
            0 => 0,
            rest if self.is_long && rest > SHORT_REST => LONG as u16,
            _ => SHORT as u16,
        };
        true
    }

    /// Gives the link what it takes of the block, or of EOT. Whether that was the last of it.
    fn give(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let length = usize::from(self.length);
        let begin = usize::from(self.at);
        let there = self.data.as_slice().get(begin..).unwrap_or_default();
        let there = there.get(..length).unwrap_or(there);
        let pad = settings.pad as u8;
        let mut tail = ([0; 2], 0);
        if length > 0 {
            let mut block = [pad; LONG];
            copy(&mut block, there);
            tail = check(block.get(..length).unwrap_or_default(), self.is_crc);
        }
        let first = if length == LONG { STX } else { SOH };
        let header = [first, self.number, !self.number];
        let total = if length == 0 { 1 } else { HEADER + length + tail.1 };
        let byte = |place: usize| {
            let in_data = place.wrapping_sub(HEADER);
            match header.get(place) {
                _ if length == 0 => EOT,
                Some(byte) => *byte,
                None if in_data < length => there.get(in_data).copied().unwrap_or(pad),
                None => tail.0.get(in_data - length).copied().unwrap_or_default(),
            }
        };
        let mut given = usize::from(self.given);
        while given < total {
            let count = (total - given).min(PIECE).min(link.transmit_room() as usize);
            if count == 0 {
                break;
            }
            let mut piece = [0; PIECE];
            for (place, own) in (given..).zip(piece.iter_mut().take(count)) {
                *own = byte(place);
            }
            link.transmit(piece.get(..count).unwrap_or_default());
            given += count;
            self.queued += count as u64;
        }
        self.given = given as u16;
        let is_whole = given == total;
        if is_whole {
            self.given = 0;
            self.mark = self.mark.next();
            self.has_left = false;
            link.transmit_marked(self.mark, &[]);
        }
        is_whole
    }

    /// Whether a block is with the link in part: it has to become whole.
    pub(crate) fn is_given_in_part(&self) -> bool {
        self.given > 0
    }

    /// Whether the mark is that of what was given last.
    pub(crate) fn left(&mut self, mark: MarkId, state: MarkState) -> bool {
        let is_latest = mark == self.mark && state != MarkState::Dropped;
        self.has_left |= is_latest;
        is_latest
    }

    pub(crate) fn has_left(&self) -> bool {
        self.has_left
    }

    /// The block is with the receiver.
    pub(crate) fn acknowledged(&mut self) {
        if usize::from(self.length) == LONG && self.repeats >= TOO_LONG {
            self.is_long = false;
        }
        self.at += self.length;
        self.length = 0;
        self.number = self.number.wrapping_add(1);
        self.is_answered = true;
        self.repeats = 0;
    }

    /// Whether block or EOT may be sent once more.
    pub(crate) fn repeats(&mut self, most: i64) -> bool {
        self.repeats += 1;
        i64::from(self.repeats) <= most
    }

    pub(crate) fn dropped(&mut self, bytes: u32) {
        self.queued = self.queued.saturating_sub(u64::from(bytes));
    }

    pub(crate) fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(self.job, self.queued);
        *self = Self::new(self.mark);
    }

    pub(crate) fn fail(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.job != JobId::NONE {
            link.job_failed(self.job, failure, 0, self.queued);
            *self = Self::new(self.mark);
        }
    }
}
