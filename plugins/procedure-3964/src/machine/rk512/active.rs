//! Our commands: a job in telegrams, each answered by a reaction.

use super::header::{FETCH, FOLLOW_UP, Header};
use super::{HEADER, LARGEST_DATA, SHORT_HEADER};
use crate::cause::*;
use crate::frame::holds_wider;
use crate::job::Stage;
use crate::machine::{Machine, NEVER, after};
use softplug_plugin::{Context, DeliveryId, Failure, JobStart, copy};

/// Place of `read` in the manifest's list of jobs.
const READ: u16 = 2;

impl Machine {
    pub(crate) fn begin_telegram(
        &mut self,
        link: &mut Context<'_>,
        start: &JobStart<'_>,
    ) -> Result<(), Cause> {
        let is_read = start.kind == READ;
        let header = Header::from_fields(is_read, &start.fields).ok_or(BAD_JOB)?;
        self.rk512.to_do = 0;
        self.job.block.extend(&header.0);
        if is_read {
            self.rk512.to_do = header.size();
            return self.block_ready();
        }
        match start.size {
            Some(size) => {
                self.set_size(u32::try_from(size).unwrap_or(u32::MAX))?;
                self.want_piece(link);
            }
            None => {
                // One byte more shows that it is longer than one telegram.
                link.want(self.job.id, u32::from(LARGEST_DATA) + 1);
            }
        }
        Ok(())
    }

    fn set_size(&mut self, size: u32) -> Result<(), Cause> {
        let words = size / 2;
        let is_odd = !size.is_multiple_of(2);
        if is_odd || words == 0 {
            return Err(BAD_LENGTH);
        }
        let words = u16::try_from(words).map_err(|_| JOB_TOO_LONG)?;
        let count = self.job.block.as_mut_slice().get_mut(6..8).unwrap_or_default();
        // A job may say how many words it has, and then it has so many.
        let is_told = *count != [0, 0];
        if is_told && *count != words.to_be_bytes() {
            return Err(BAD_JOB);
        }
        copy(count, &words.to_be_bytes());
        self.rk512.to_do = size;
        Ok(())
    }

    fn want_piece(&mut self, link: &mut Context<'_>) {
        link.want(self.job.id, self.piece());
    }

    /// Data bytes of the telegram under way.
    fn piece(&self) -> u32 {
        self.rk512.to_do.min(LARGEST_DATA.into())
    }

    fn piece_start(&self) -> usize {
        if self.is_follow_up() { SHORT_HEADER } else { HEADER }
    }

    pub(crate) fn telegram_data(&mut self) -> Result<(), Cause> {
        let length = self.job.block.len() - self.piece_start();
        if self.rk512.to_do == 0 {
            return if length > LARGEST_DATA.into() { Err(BAD_LENGTH) } else { Ok(()) };
        }
        if length == self.piece() as usize { self.block_ready() } else { Ok(()) }
    }

    pub(crate) fn telegram_end(&mut self) -> Result<(), Cause> {
        if self.rk512.to_do > 0 {
            return Err(BAD_LENGTH);
        }
        self.set_size((self.job.block.len() - HEADER) as u32)?;
        self.block_ready()
    }

    pub(crate) fn is_reading(&self) -> bool {
        self.has_job() && self.job.block.as_slice().get(2) == Some(&FETCH)
    }

    fn is_follow_up(&self) -> bool {
        self.job.block.as_slice().first() == Some(&FOLLOW_UP)
    }

    /// Whether a follow-up, which begins with FF, would be needed on a line that cannot carry it.
    pub(crate) fn needs_wide_follow_up(&self) -> bool {
        self.rk512.to_do > LARGEST_DATA.into() && holds_wider(&[FOLLOW_UP], self.data_bits)
    }

    /// The partner has the telegram.
    pub(crate) fn await_reaction(&mut self, link: &mut Context<'_>) {
        self.job.stage = Stage::Awaiting;
        self.rk512.reaction_until = after(link, self.options.reaction_timeout);
    }

    pub(crate) fn reaction_late(&mut self, link: &mut Context<'_>) {
        self.rk512.reaction_until = NEVER;
        if self.job.stage == Stage::Awaiting {
            self.fail_job(link, NO_REACTION);
        }
    }

    /// A reaction came; one that nobody waits for is the repetition of an
    /// earlier one whose acknowledgement was lost.
    pub(super) fn reaction(&mut self, link: &mut Context<'_>) {
        if self.job.stage != Stage::Awaiting {
            self.warn(link, 0);
            return;
        }
        self.rk512.reaction_until = NEVER;
        if let Err(cause) = self.take_reaction(link) {
            self.fail_job(link, cause);
        }
    }

    fn take_reaction(&mut self, link: &mut Context<'_>) -> Result<(), Cause> {
        let first = if self.is_follow_up() { FOLLOW_UP } else { 0 };
        let bytes = self.block.as_slice();
        let Some(([got, 0, 0, error], data)) = bytes.split_first_chunk::<SHORT_HEADER>() else {
            return Err(WRONG_REACTION);
        };
        if *error != 0 {
            return Err(cause_of(*error));
        }
        let piece = self.piece();
        let expected = if self.is_reading() { piece as usize } else { 0 };
        let is_other = *got != first;
        let is_short = data.len() != expected;
        if is_other || is_short || expected > link.delivery_room() as usize {
            return Err(WRONG_REACTION);
        }
        if expected > 0 {
            if self.rk512.reading == DeliveryId::NONE {
                self.last_delivery = self.last_delivery.next();
                self.rk512.reading = self.last_delivery;
                link.delivery_begin(self.rk512.reading, self.job.id);
            }
            link.deliver(self.rk512.reading, data);
        }
        self.rk512.to_do -= piece;
        if self.rk512.to_do == 0 {
            self.end_reading(link, None);
            self.job.done(link);
            return Ok(());
        }
        // A follow-up repeats command and area.
        copy(self.job.block.as_mut_slice(), &[FOLLOW_UP]);
        self.job.block.truncate(SHORT_HEADER);
        if expected > 0 {
            self.job.stage = Stage::Ready;
        } else {
            self.job.stage = Stage::Filling;
            self.want_piece(link);
        }
        Ok(())
    }

    /// Ends the delivery of what is read, if there is one.
    pub(crate) fn end_reading(&mut self, link: &mut Context<'_>, cause: Option<Cause>) {
        self.rk512.reaction_until = NEVER;
        if self.rk512.reading != DeliveryId::NONE {
            let status = cause.map_or(0, Cause::status);
            link.delivery_end(self.rk512.reading, cause.map(Cause::failure), status);
            self.rk512.reading = DeliveryId::NONE;
        }
    }
}

/// What the partner's error number means for the job.
fn cause_of(error: u8) -> Cause {
    let failure = match error {
        0x0A | 0x0C | 0x12 | 0x34 => Failure::BadJob,
        0x14 => Failure::NotFound,
        0x10 | 0x16 => Failure::NotSupported,
        0x2A | 0x32 => Failure::Refused,
        _ => Failure::Protocol,
    };
    cause(failure, error.into())
}
