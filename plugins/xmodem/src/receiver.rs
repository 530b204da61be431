//! The file that is received: its blocks, its padding, what went wrong in a row.

use crate::block::{CALL, NAK, Reader};
use crate::settings::{Mode, Padding, Settings};
use softplug_plugin::{Context, DeliveryId, Failure, JobId, State};

/// So many calls with C come before one with NAK.
const CALLS: u32 = 4;
/// What has so many characters and is no good block may have been one.
const MAY_BE_BLOCK: u16 = 64;
/// Padding delivered at a time.
const PIECE: usize = 64;

#[derive(Copy, Clone, Debug, State)]
#[state(check = Self::is_sound)]
pub(crate) struct Receiver {
    pub(crate) reader: Reader,
    delivery: DeliveryId,
    /// Since the last transfer.
    calls: u32,
    /// How often in a row something was refused.
    refusals: u32,
    /// A delivery is under way: a block was good.
    pub(crate) is_open: bool,
    /// The call that was said last asked for CRC.
    pub(crate) is_crc: bool,
    /// What was no good block may have been one, and it has not come again.
    pub(crate) is_missing: bool,
    /// An EOT has been answered by NAK.
    pub(crate) is_end_refused: bool,
    /// CANs go out when the line is clear.
    pub(crate) is_cancelling: bool,
    /// An EOT that comes again is acknowledged.
    pub(crate) lingers: bool,
    /// The number of the next block.
    pub(crate) expected: u8,
    /// Why something was refused the last time.
    why: Option<Failure>,
    /// Characters of what was no good block.
    run: u16,
    /// Padding at the end of the block before, which is data if another block comes.
    held: u16,
    /// How much of `held` and then of the block has been delivered.
    delivered: u16,
}

impl Receiver {
    pub(crate) const fn new() -> Self {
        Self {
            reader: Reader::new(),
            delivery: DeliveryId::NONE,
            is_open: false,
            is_crc: false,
            calls: 0,
            expected: 1,
            refusals: 0,
            why: None,
            run: 0,
            is_missing: false,
            is_end_refused: false,
            is_cancelling: false,
            lingers: false,
            held: 0,
            delivered: 0,
        }
    }

    /// What was before is over.
    pub(crate) fn forget(&mut self) {
        *self = Self { delivery: self.delivery, ..Self::new() };
    }

    /// The next call.
    pub(crate) fn call(&mut self, settings: &Settings) -> u8 {
        let turn = self.calls % (CALLS + 1);
        self.calls = self.calls.wrapping_add(1);
        self.is_crc = match settings.mode {
            Mode::Checksum => false,
            Mode::Crc | Mode::Long => true,
            Mode::Auto => turn < CALLS,
        };
        self.same_call()
    }

    /// Whether a block can answer a call: there was one since the last transfer.
    pub(crate) fn has_called(&self) -> bool {
        self.calls > 0
    }

    /// The call that was said last.
    pub(crate) fn same_call(&self) -> u8 {
        if self.is_crc { CALL } else { NAK }
    }

    /// The number of the next block, and whether it is that of the one before.
    pub(crate) fn is_expected(&self) -> bool {
        self.reader.number == self.expected
    }

    pub(crate) fn is_again(&self) -> bool {
        self.is_open && self.reader.number == self.expected.wrapping_sub(1)
    }

    pub(crate) fn begin(&mut self, link: &mut Context<'_>) {
        if !self.is_open {
            self.is_open = true;
            self.delivery = self.delivery.next();
            link.delivery_begin(self.delivery, JobId::NONE);
        }
    }

    /// Delivers what there is room for. Whether that was the last of the block.
    pub(crate) fn deliver(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let pad = settings.pad as u8;
        while self.delivered < self.held {
            let count = usize::from(self.held - self.delivered).min(PIECE);
            let count = count.min(link.delivery_room() as usize);
            if count == 0 {
                return false;
            }
            link.deliver(self.delivery, [pad; PIECE].get(..count).unwrap_or_default());
            self.delivered += count as u16;
        }
        let data = self.reader.data.as_slice();
        let padding = match settings.padding {
            Padding::Keep => 0,
            Padding::Strip => data.iter().rev().take_while(|byte| **byte == pad).count(),
        };
        let begin = usize::from(self.delivered - self.held);
        let rest = data.get(begin..data.len() - padding).unwrap_or_default();
        let count = rest.len().min(link.delivery_room() as usize);
        if count > 0 {
            link.deliver(self.delivery, rest.get(..count).unwrap_or_default());
            self.delivered += count as u16;
        }
        let is_whole = count == rest.len();
        if is_whole {
            self.held = padding as u16;
            self.delivered = 0;
            self.expected = self.expected.wrapping_add(1);
        }
        is_whole
    }

    /// A good block has come, or one that had come before.
    pub(crate) fn went_well(&mut self) {
        self.refusals = 0;
        self.is_missing = false;
        self.is_end_refused = false;
    }

    /// So many characters were no good block.
    pub(crate) fn add_to_run(&mut self, count: u16) {
        self.run = self.run.saturating_add(count);
        self.is_missing |= self.run >= MAY_BE_BLOCK;
    }

    pub(crate) fn begin_run(&mut self, count: u16, why: Failure) {
        self.run = 0;
        self.add_to_run(count);
        self.why = Some(why);
    }

    /// Whether what was to come may be asked for once more.
    pub(crate) fn refuses(&mut self, most: i64) -> bool {
        self.refusals += 1;
        i64::from(self.refusals) <= most
    }

    /// Why it was refused the last time.
    pub(crate) fn why(&self) -> Failure {
        self.why.unwrap_or(Failure::NoAnswer)
    }

    pub(crate) fn end(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        if self.is_open {
            link.delivery_end(self.delivery, failure, 0);
        }
        self.forget();
    }

    fn is_sound(&self) -> bool {
        usize::from(self.delivered) <= usize::from(self.held) + self.reader.data.len()
    }
}
