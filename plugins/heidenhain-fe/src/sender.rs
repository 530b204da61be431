//! The job: its check, its lines as blocks.

use crate::frame::{DC1, EOT, ETB, ETX, LINE, STX, Text, block_check, is_control};
use crate::line::spoken;
use crate::name_of;
use crate::settings::Settings;
use crate::stage::Stage;
use softplug_plugin::parts::{Block, BlockSender};
use softplug_plugin::{Context, Failure, JobId, JobStart, Pass, State};

/// Data that may wait here; a block is shorter.
const PENDING: usize = 256;

#[derive(Copy, Clone, Debug, Default, State)]
pub(crate) struct Sender {
    /// Data of later lines waits here.
    pub(crate) job: BlockSender<PENDING>,
    is_checking: bool,
    /// The name that the control must ask for.
    name: Text,
    has_name: bool,
    /// The line of the block under way, and whether it is whole.
    text: Text,
    is_whole: bool,
    /// Place in the program, for the check.
    line: u32,
    column: u32,
    after_cr: bool,
}

impl Sender {
    /// A job to check or to send; one that cannot be taken fails at once.
    pub(crate) fn begin(
        &mut self,
        link: &mut Context<'_>,
        job: &JobStart<'_>,
        name_field: u16,
    ) -> bool {
        if self.job.job() == JobId::NONE && job.kind != 0 {
            link.job_failed(job.job, Failure::NotSupported, 0, 0);
            return false;
        }
        if !self.job.begin(link, job.job) {
            return false;
        }
        *self = Self { job: self.job, line: 1, ..Self::default() };
        self.is_checking = job.pass == Pass::Check;
        if let Some(name) = name_of(&job.fields, name_field) {
            self.has_name = true;
            self.name.extend(name.as_bytes());
        }
        true
    }

    /// Whether there is a job to check.
    pub(crate) fn is_checking(&self) -> bool {
        self.is_checking && self.job.job() != JobId::NONE
    }

    /// Whether there is a job to send.
    pub(crate) fn is_waiting(&self) -> bool {
        self.job.is_active() && !self.is_checking
    }

    /// Whether the job may go where this name was asked for.
    pub(crate) fn fits(&self, asked: &[u8]) -> bool {
        !self.has_name || self.name.as_slice() == asked
    }

    /// Asks for data, if none is under way.
    pub(crate) fn want(&mut self, link: &mut Context<'_>) {
        self.job.want(link, PENDING);
    }

    /// Looks at the data that has come.
    pub(crate) fn check(&mut self, link: &mut Context<'_>, settings: &Settings) {
        let data = *self.job.data();
        self.job.acknowledged(data.len());
        for byte in data.as_slice() {
            let failure = self.check_byte(settings, *byte);
            if let Some(failure) = failure {
                link.check_failed(self.job.job(), failure, self.line, self.column);
                self.job.forget();
                return;
            }
        }
        self.want(link);
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
        let job = self.job.job();
        if self.after_cr {
            link.check_failed(job, Failure::UnsupportedCharacter, self.line, self.column);
        } else {
            link.check_good(job);
        }
        self.job.forget();
    }

    /// Sends the next block or the end, if line, room and host allow it.
    pub(crate) fn next(&mut self, link: &mut Context<'_>, settings: &Settings) -> Stage {
        if !self.is_whole {
            self.gather();
        }
        if !self.is_whole && !self.job.has_ended() {
            self.want(link);
            return Stage::Filling;
        }
        // A block that has begun is not paused.
        if self.job.is_paused() {
            return Stage::Filling;
        }
        let is_given = if self.is_whole {
            self.block(link, settings)
        } else {
            self.job.give(link, &[&[ETX, EOT].map(|byte| spoken(settings, byte))])
        };
        match (is_given, self.is_whole) {
            (false, _) => Stage::Filling,
            (true, true) => Stage::Answer,
            (true, false) => Stage::Ending,
        }
    }

    /// Takes data up to the end of a line. What stands behind the last one is a line too.
    fn gather(&mut self) {
        let data = self.job.data().as_slice();
        let end = data.iter().position(|byte| *byte == b'\n');
        self.is_whole = end.is_some();
        self.text.extend(data.get(..end.unwrap_or(data.len())).unwrap_or_default());
        let taken = end.map_or(data.len(), |end| end + 1);
        self.job.acknowledged(taken);
        if self.job.has_ended() && self.job.data().is_empty() && !self.text.is_empty() {
            self.is_whole = true;
        }
        if self.is_whole && self.text.as_slice().last() == Some(&b'\r') {
            self.text.drop_last();
        }
    }

    /// Gives the link what it takes of the block. Whether that was the last of it.
    fn block(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let mut check = block_check(STX, self.text.as_slice());
        let mut block = Block::<PENDING>::new();
        block.push(STX);
        block.extend(self.text.as_slice());
        if settings.bcc_space && is_control(check) {
            block.push(b' ');
            check ^= b' ';
        }
        block.push(ETB);
        block.push(check);
        if settings.dc1 {
            block.push(DC1);
        }
        for byte in block.as_mut_slice() {
            *byte = spoken(settings, *byte);
        }
        self.job.give(link, &[block.as_slice()])
    }

    pub(crate) fn acknowledged(&mut self) {
        self.text.clear();
        self.is_whole = false;
        self.job.acknowledged(0);
    }
}
