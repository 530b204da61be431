//! The job: its check, its lines as blocks, their marks and repeats.

use crate::frame::{DC1, EOT, ETB, ETX, LINE, STX, Text, block_check, is_control};
use crate::line::spoken;
use crate::name_of;
use crate::settings::Settings;
use crate::stage::Stage;
use softplug_plugin::parts::Block;
use softplug_plugin::{Context, Failure, JobStart, MarkState, Pass, State};

/// Data that may wait here.
const PENDING: usize = 256;

#[derive(Copy, Clone, Debug, State)]
pub(crate) struct Sender {
    /// Id of the job; 0: none.
    job: u32,
    is_checking: bool,
    /// Why the job fails, once it is known how much of it has left; saved with the stage.
    #[state(skip)]
    pub(crate) stopping: Option<Failure>,
    pub(crate) is_paused: bool,
    /// The name that the control must ask for.
    name: Text,
    has_name: bool,
    /// Data that belongs to later lines.
    pending: Block<PENDING>,
    wanted: u32,
    has_ended: bool,
    /// The line of the block under way, and whether it is whole.
    text: Text,
    is_whole: bool,
    /// Characters of the block that the link has taken: its room may be smaller.
    #[state(since = 2)]
    given: u16,
    repeats: u32,
    /// The mark of the latest block; whether it can have left.
    mark: u32,
    has_left: bool,
    /// Bytes queued for the job.
    queued: u64,
    /// Place in the program, for the check.
    line: u32,
    column: u32,
    after_cr: bool,
}

impl Default for Sender {
    fn default() -> Self {
        Self {
            job: 0,
            is_checking: false,
            stopping: None,
            is_paused: false,
            name: Text::default(),
            has_name: false,
            pending: Block::new(),
            wanted: 0,
            has_ended: false,
            text: Text::default(),
            is_whole: false,
            given: 0,
            repeats: 0,
            mark: 0,
            has_left: false,
            queued: 0,
            line: 1,
            column: 0,
            after_cr: false,
        }
    }
}

impl Sender {
    /// A job to check or to send; one that cannot be taken fails at once.
    pub(crate) fn begin(
        &mut self,
        link: &mut Context<'_>,
        job: &JobStart<'_>,
        name_field: u16,
    ) -> bool {
        if self.job != 0 || job.kind != 0 {
            let why = if self.job == 0 { Failure::NotSupported } else { Failure::Busy };
            link.job_failed(job.job, why, 0, 0);
            return false;
        }
        *self = Self { job: job.job, mark: self.mark, ..Self::default() };
        self.is_checking = job.pass == Pass::Check;
        if let Some(name) = name_of(&job.fields, name_field) {
            self.has_name = true;
            for byte in name.bytes() {
                self.name.push(byte);
            }
        }
        true
    }

    pub(crate) fn is_checking(&self) -> bool {
        self.is_checking
    }

    /// Whether there is a job to send.
    pub(crate) fn is_waiting(&self) -> bool {
        self.job != 0 && !self.is_checking && self.stopping.is_none()
    }

    /// Whether the job may go where this name was asked for.
    pub(crate) fn fits(&self, asked: &[u8]) -> bool {
        !self.has_name || self.name.as_slice() == asked
    }

    /// Asks for data, if none is under way.
    pub(crate) fn ask(&mut self, link: &mut Context<'_>) {
        if self.wanted == 0 && !self.has_ended {
            self.wanted = PENDING as u32;
            link.want(self.job, self.wanted);
        }
    }

    pub(crate) fn check(&mut self, link: &mut Context<'_>, settings: &Settings, bytes: &[u8]) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        for byte in bytes {
            let failure = self.check_byte(settings, *byte);
            if let Some(failure) = failure {
                link.check_failed(self.job, failure, self.line, self.column);
                self.over();
                return;
            }
        }
        self.ask(link);
    }

    fn check_byte(&mut self, settings: &Settings, byte: u8) -> Option<Failure> {
        self.column += 1;
        let follows_cr = core::mem::take(&mut self.after_cr);
        if byte == b'\n' {
            self.line += 1;
            self.column = 0;
            return None;
        }
        self.after_cr = byte == b'\r';
        let most = LINE - u32::from(settings.bcc_space);
        let is_text = (0x20..0x7F).contains(&byte) || self.after_cr;
        if follows_cr || !is_text {
            // A CR inside of a line is found out behind it.
            self.column -= u32::from(follows_cr);
            return Some(Failure::UnsupportedCharacter);
        }
        (self.column > most && !self.after_cr).then_some(Failure::TooLong)
    }

    pub(crate) fn checked(&mut self, link: &mut Context<'_>) {
        if self.after_cr {
            link.check_failed(self.job, Failure::UnsupportedCharacter, self.line, self.column);
        } else {
            link.check_good(self.job);
        }
        self.over();
    }

    pub(crate) fn data(&mut self, bytes: &[u8]) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        self.pending.extend(bytes);
    }

    pub(crate) fn data_ended(&mut self) {
        self.has_ended = true;
        self.wanted = 0;
    }

    /// Sends the next block or the end, if line, room and host allow it.
    pub(crate) fn next(&mut self, link: &mut Context<'_>, settings: &Settings) -> Stage {
        if !self.is_whole {
            self.gather();
        }
        if !self.is_whole && !self.has_ended {
            self.ask(link);
            return Stage::Filling;
        }
        // A block that has begun is not paused.
        if self.is_paused && self.given == 0 {
            return Stage::Filling;
        }
        let is_given = if self.is_whole {
            self.block(link, settings)
        } else {
            self.give(link, settings, &[ETX, EOT], 0, true)
        };
        match (is_given, self.is_whole) {
            (false, _) => Stage::Filling,
            (true, true) => Stage::Answer,
            (true, false) => Stage::Ending,
        }
    }

    /// Takes data up to the end of a line. What stands behind the last one is a line too.
    fn gather(&mut self) {
        let mut taken = 0;
        for byte in self.pending.as_slice() {
            taken += 1;
            if *byte == b'\n' {
                self.is_whole = true;
                break;
            }
            self.text.push(*byte);
        }
        self.pending.drop_first(taken);
        if self.has_ended && self.pending.is_empty() && !self.text.is_empty() {
            self.is_whole = true;
        }
        if self.is_whole && self.text.as_slice().last() == Some(&b'\r') {
            self.text.drop_last();
        }
    }

    /// Gives the link what it takes of the block. Whether that was the last of it.
    fn block(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let mut check = block_check(STX, self.text.as_slice());
        let mut tail = Text::default();
        if settings.bcc_space && is_control(check) {
            tail.push(b' ');
            check ^= b' ';
        }
        tail.push(ETB);
        tail.push(check);
        if settings.dc1 {
            tail.push(DC1);
        }
        let text = self.text;
        self.give(link, settings, &[STX], 0, false)
            && self.give(link, settings, text.as_slice(), 1, false)
            && self.give(link, settings, tail.as_slice(), 1 + text.as_slice().len(), true)
    }

    /// Gives the link these characters, of which the first is the block's `first`th, as
    /// far as it has not taken them and has room. Whether it has taken the last.
    fn give(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        bytes: &[u8],
        first: usize,
        is_end: bool,
    ) -> bool {
        let taken = usize::from(self.given).saturating_sub(first);
        for byte in bytes.iter().skip(taken) {
            if link.transmit_room() == 0 {
                return false;
            }
            link.transmit(&[spoken(settings, *byte)]);
            self.given += 1;
            self.queued += 1;
        }
        if is_end {
            self.given = 0;
            self.mark = self.mark.wrapping_add(1).max(1);
            self.has_left = false;
            link.transmit_marked(self.mark, &[]);
        }
        true
    }

    /// Whether the mark is that of the latest block.
    pub(crate) fn left(&mut self, mark: u32, state: MarkState) -> bool {
        let is_latest = mark == self.mark && state != MarkState::Dropped;
        self.has_left |= is_latest;
        is_latest
    }

    pub(crate) fn has_left(&self) -> bool {
        self.has_left
    }

    pub(crate) fn acknowledged(&mut self) {
        self.text.clear();
        self.is_whole = false;
        self.repeats = 0;
    }

    /// Whether the block may be sent once more.
    pub(crate) fn repeats(&mut self, most: i64) -> bool {
        self.repeats += 1;
        i64::from(self.repeats) <= most
    }

    pub(crate) fn dropped(&mut self, bytes: u32) {
        self.queued = self.queued.saturating_sub(u64::from(bytes));
    }

    pub(crate) fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(self.job, self.queued);
        self.over();
    }

    pub(crate) fn fail(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.job != 0 {
            link.job_failed(self.job, failure, 0, self.queued);
            self.over();
        }
    }

    /// What belonged to the job alone ends with it.
    fn over(&mut self) {
        *self = Self { mark: self.mark, ..Self::default() };
    }
}
