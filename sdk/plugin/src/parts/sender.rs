//! A job that goes in blocks.

use super::{Block, Part, PartEvent};
use crate::{Context, Failure, JobId, MarkId, MarkState, State};

/// Marks from here on are free for other uses: a sender counts below.
pub const OWN_MARKS: u32 = 0x8000_0000;

/// Most bytes of a frame in each of the two pieces that stand before an answer. The smallest queue, of 64 bytes,
/// has room for both and for some answers: so a frame is cut into the same pieces in each.
const SHORT_PIECE: usize = 24;
/// Bytes of output that the records around a block's bytes take, and what else an event brings.
const HEADS: usize = 128;
/// Pieces of a frame with the link.
const AHEAD: u8 = 2;
/// Most marks that are not settled: a link takes 64 of all kinds.
const UNSETTLED: u8 = 32;

/// A job that goes in blocks, each answered by the partner: pulls the job's data from the host, gives a
/// block to the link as far as there is room, knows when it has left, and counts how often it was
/// repeated. What a block looks like, and what is an answer, is the converter's business; so is time, for
/// which there are [`Timers`](super::Timers).
///
/// `DATA` bytes of the job wait here at most.
///
/// 1. [`begin`](Self::begin) takes the job of [`Converter::job_begin`](crate::Converter::job_begin).
/// 2. [`want`](Self::want) asks for data; it comes with the [events](crate::Converter::parts), and stands in
///    [`data`](Self::data) until it is [acknowledged](Self::acknowledged).
/// 3. [`give`](Self::give) gives the block to the link, again after each event until it says that it was the
///    last of it. Then the answer is awaited: it counts once the block [can have left](Self::has_left), and its time from
///    the mark on ([`is_latest`](Self::is_latest), with [`MarkState::SurelyLeft`]).
/// 4. [`done`](Self::done), or [`stop`](Self::stop): the job fails when it is known how much of it has left.
///
/// ```
/// use softplug_plugin::bench::{Bench, Observed};
/// use softplug_plugin::parts::BlockSender;
/// use softplug_plugin::{Context, Converter, Failure, JobId, JobStart, parts};
///
/// const ACK: u8 = 0x06;
/// const NAK: u8 = 0x15;
/// /// Bytes of a block; the last one has fewer.
/// const BLOCK: usize = 4;
///
/// /// Sends blocks of four bytes, each up to three times.
/// struct Fours {
///     sender: BlockSender<BLOCK>,
///     awaits_answer: bool,
/// }
///
/// impl Converter for Fours {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "fours", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Blocks of four.",
///         "jobs": [{"name": "send", "text": "Sends."}]}"#;
///
///     fn new((): ()) -> Self {
///         Self { sender: BlockSender::new(), awaits_answer: false }
///     }
///
///     parts!(sender);
///
///     fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
///         self.sender.begin(link, job.job);
///     }
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         for byte in bytes {
///             if !self.awaits_answer || !self.sender.has_left() {
///                 continue;
///             }
///             match *byte {
///                 ACK => self.sender.acknowledged(BLOCK),
///                 NAK if self.sender.repeats(2) => {}
///                 NAK => self.sender.stop(link, Failure::AttemptsUsedUp),
///                 _ => continue,
///             }
///             self.awaits_answer = false;
///         }
///     }
///
///     fn after(&mut self, link: &mut Context<'_>) {
///         if self.awaits_answer || !self.sender.is_active() || self.sender.is_paused() {
///             return;
///         }
///         let data = *self.sender.data();
///         if data.room() > 0 && !self.sender.has_ended() {
///             self.sender.want(link, data.room());
///         } else if data.is_empty() {
///             self.sender.done(link);
///         } else {
///             self.awaits_answer = self.sender.give(link, &[data.as_slice()]);
///         }
///     }
/// }
///
/// let mut bench = Bench::<Fours>::new().open();
/// bench.send(b"G1 X10");
/// for answer in [NAK, ACK, ACK] {
///     bench.run_for_millis(20);
///     bench.receive(&[answer]);
/// }
/// bench.run_for_millis(20);
/// assert_eq!(bench.sent(), b"G1 XG1 X10");
/// let done = Observed::Done { job: JobId(1), sent: 10 };
/// assert!(bench.observed().iter().any(|(_, seen)| *seen == done));
/// ```
#[derive(Copy, Clone, Debug, State)]
pub struct BlockSender<const DATA: usize> {
    /// Id of the job; 0: none.
    job: JobId,
    /// Why the job fails, once it is known how much of it has left.
    stopping: Option<Failure>,
    /// What the link has still leaves before it does.
    is_cut: bool,
    is_paused: bool,
    /// Nothing leaves.
    is_down: bool,
    data: Block<DATA>,
    /// Bytes that the host was asked for and has not given.
    wanted: u32,
    has_ended: bool,
    /// Bytes of the block under way that the link has taken: its room may be smaller.
    given: u16,
    repeats: u32,
    /// The mark of what was given last; whether it can have left.
    mark: MarkId,
    has_left: bool,
    /// Bytes given for the job.
    sent: u64,
    /// Blocks and pieces with the link that cannot have left yet, and those that have not for certain.
    ahead: u8,
    unsettled: u8,
}

impl<const DATA: usize> BlockSender<DATA> {
    /// Without a job.
    #[allow(clippy::new_without_default, reason = "it is below, and this is const")]
    pub const fn new() -> Self {
        Self {
            job: JobId::NONE,
            stopping: None,
            is_cut: false,
            is_paused: false,
            is_down: false,
            data: Block::new(),
            wanted: 0,
            has_ended: false,
            given: 0,
            repeats: 0,
            mark: MarkId::NONE,
            has_left: false,
            sent: 0,
            ahead: 0,
            unsettled: 0,
        }
    }

    /// Takes a job. While there is another one it fails as busy, and this is `false`.
    pub fn begin(&mut self, link: &mut Context<'_>, job: JobId) -> bool {
        let is_free = self.job == JobId::NONE;
        if is_free {
            self.forget();
            self.job = job;
        } else {
            link.job_failed(job, Failure::Busy, 0, 0);
        }
        is_free
    }

    /// The job's id; 0: there is none.
    pub fn job(&self) -> JobId {
        self.job
    }

    /// Whether there is a job, and it has not failed.
    pub fn is_active(&self) -> bool {
        self.job != JobId::NONE && self.stopping.is_none()
    }

    /// Why the job fails, as soon as it is known how much of it has left.
    pub fn stopping(&self) -> Option<Failure> {
        self.stopping
    }

    /// Whether the host has paused the job, and it is between two blocks.
    pub fn is_paused(&self) -> bool {
        self.is_paused && self.given == 0
    }

    /// The data that has come and is not acknowledged.
    pub fn data(&self) -> &Block<DATA> {
        &self.data
    }

    /// Takes data as it is to be sent; what does not fit is left out, so that a converter that makes more of
    /// data asks for less. Data of [events](crate::Converter::parts) is taken by itself.
    pub fn take(&mut self, bytes: &[u8]) {
        self.data.extend(bytes);
    }

    /// So many bytes have come of those that were asked for.
    pub fn came(&mut self, bytes: usize) {
        self.wanted = self.wanted.saturating_sub(bytes as u32);
    }

    /// Whether the host has no more data.
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Asks the host for so many bytes, unless it was asked already or has no more.
    pub fn want(&mut self, link: &mut Context<'_>, bytes: usize) {
        if self.wanted == 0 && !self.has_ended {
            self.wanted = bytes as u32;
            link.want(self.job, self.wanted);
        }
    }

    /// Gives the link what it takes of a block, at most 65,535 bytes, whose parts stand in `block` one behind
    /// the other. Whether that was the last of it; its mark is set then.
    pub fn give(&mut self, link: &mut Context<'_>, block: &[&[u8]]) -> bool {
        if self.given == 0 && self.unsettled >= UNSETTLED {
            return false;
        }
        let mut gone = usize::from(self.given);
        for part in block {
            let rest = part.get(gone..).unwrap_or_default();
            gone = gone.saturating_sub(part.len());
            let room = link.output_room().saturating_sub(HEADS).min(link.transmit_room() as usize);
            let count = rest.len().min(room);
            if count > 0 {
                link.transmit(rest.get(..count).unwrap_or_default());
                self.given += count as u16;
                self.sent += count as u64;
            }
            if count < rest.len() {
                if link.transmit_room() > 0 {
                    // There is more room than one event's output has.
                    link.again();
                }
                return false;
            }
        }
        self.next_mark();
        link.transmit_marked(self.mark, &[]);
        self.given = 0;
        true
    }

    /// Gives the link a frame of `length` bytes, at most 65,535, in short pieces that end between two
    /// symbols: `symbol` tells how many bytes from a place on must stay together, 1 to 24. An answer that is
    /// [said](super::Answers::say) meanwhile stands between two symbols, behind at most two pieces, 48 bytes.
    /// Whether that was the last of it.
    ///
    /// Not while answers [wait](super::Answers::owes_nothing).
    pub fn give_symbols(
        &mut self,
        link: &mut Context<'_>,
        length: usize,
        byte: impl Fn(usize) -> u8,
        symbol: impl Fn(usize) -> usize,
    ) -> bool {
        while usize::from(self.given) < length {
            if self.ahead >= AHEAD || self.unsettled >= UNSETTLED {
                return false;
            }
            let begin = usize::from(self.given);
            let most = SHORT_PIECE.min(length - begin);
            let mut count = 0;
            while count < most {
                let whole = symbol(begin + count).clamp(1, SHORT_PIECE).min(length - begin - count);
                if count + whole > most {
                    break;
                }
                count += whole;
            }
            if count > link.transmit_room() as usize {
                return false;
            }
            let mut piece = [0; SHORT_PIECE];
            for (place, own) in (begin..).zip(piece.iter_mut().take(count)) {
                *own = byte(place);
            }
            self.given += count as u16;
            self.sent += count as u64;
            self.next_mark();
            link.transmit_marked(self.mark, piece.get(..count).unwrap_or_default());
        }
        self.given = 0;
        true
    }

    fn next_mark(&mut self) {
        self.mark = MarkId(((self.mark.0 + 1) % OWN_MARKS).max(1));
        self.has_left = false;
        // A restored state may say anything.
        self.ahead = self.ahead.wrapping_add(1);
        self.unsettled = self.unsettled.wrapping_add(1);
    }

    /// Whether a block is with the link in part: where the partner must not see half of one, it has to become whole.
    pub fn is_given_in_part(&self) -> bool {
        self.given > 0
    }

    /// Whether a mark is that of the latest block.
    pub fn is_latest(&self, mark: MarkId) -> bool {
        mark == self.mark
    }

    /// Whether the latest block can have left: an answer that comes before is none.
    pub fn has_left(&self) -> bool {
        self.has_left
    }

    /// The block is with the partner: so many bytes of [`data`](Self::data) are not needed any more.
    pub fn acknowledged(&mut self, bytes: usize) {
        self.data.drop_first(bytes);
        self.repeats = 0;
    }

    /// Counts a repeat of the block; whether it may be sent once more, with `most` repeats.
    pub fn repeats(&mut self, most: i64) -> bool {
        self.repeats += 1;
        i64::from(self.repeats) <= most
    }

    /// How often the block was repeated.
    pub fn repeated(&self) -> u32 {
        self.repeats
    }

    /// Drops what waits in the queue, also of a job that is [cut](Self::cut). The job fails when it is known how much
    /// that was. Answers that wait in the queue are dropped too, and a frame may end anywhere: where that matters,
    /// `cut`.
    pub fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.is_active() {
            link.discard();
            self.stopping = Some(failure);
        } else {
            self.drop_cut(link);
        }
    }

    /// Gives nothing more. What the link has of a frame that was [given in symbols](Self::give_symbols) leaves, and so do
    /// answers; the frame ends between two symbols. The job fails when all has left; where the link is down, or goes down, the rest is dropped.
    pub fn cut(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.is_down {
            self.stop(link, failure);
        } else if self.is_active() {
            if self.given > 0 && self.unsettled == 0 {
                // What was given by `give` has no mark yet.
                self.next_mark();
                link.transmit_marked(self.mark, &[]);
            }
            self.stopping = Some(failure);
            self.is_cut = true;
            self.settle(link);
        }
    }

    /// What is cut need not leave any more.
    fn drop_cut(&mut self, link: &mut Context<'_>) {
        if core::mem::take(&mut self.is_cut) {
            link.discard();
        }
    }

    fn settle(&mut self, link: &mut Context<'_>) {
        if self.unsettled == 0
            && let Some(failure) = self.stopping
        {
            self.fail(link, failure);
        }
    }

    /// The job is done.
    pub fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(self.job, self.sent);
        self.forget();
    }

    /// The job fails at once, if there is one.
    pub fn fail(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.job != JobId::NONE {
            link.job_failed(self.job, failure, 0, self.sent);
            self.forget();
        }
    }

    /// So many bytes never left, of those that were given for the job.
    pub fn dropped(&mut self, bytes: u32) {
        self.sent = self.sent.saturating_sub(u64::from(bytes));
    }

    /// The job is over without a word here, as one that was only to be checked.
    #[inline(never)]
    pub fn forget(&mut self) {
        let Self { is_down, mark, ahead, unsettled, .. } = *self;
        *self = Self { is_down, mark, ahead, unsettled, ..Self::new() };
    }

    fn hear_mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        match state {
            MarkState::MaybeLeft => {
                self.ahead = self.ahead.saturating_sub(1);
                self.has_left |= mark == self.mark;
            }
            MarkState::SurelyLeft => {
                self.unsettled = self.unsettled.saturating_sub(1);
                if self.is_cut {
                    self.settle(link);
                }
            }
            // How much of the job that was follows.
            MarkState::Dropped => {
                self.ahead = self.ahead.saturating_sub(1);
                self.unsettled = self.unsettled.saturating_sub(1);
            }
        }
    }
}

impl<const DATA: usize> Default for BlockSender<DATA> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const DATA: usize> Part for BlockSender<DATA> {
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn hear(&mut self, link: &mut Context<'_>, event: &PartEvent<'_>) {
        match *event {
            PartEvent::Mark { mark, state } if mark < MarkId(OWN_MARKS) => {
                self.hear_mark(link, mark, state);
            }
            PartEvent::Discarded { bytes } => {
                if let Some(failure) = self.stopping {
                    self.dropped(bytes);
                    self.fail(link, failure);
                }
            }
            PartEvent::JobData(bytes) => {
                self.came(bytes.len());
                self.take(bytes);
            }
            PartEvent::JobEnd => {
                self.has_ended = true;
                self.wanted = 0;
            }
            PartEvent::Paused(is_paused) => self.is_paused = is_paused,
            PartEvent::LinkDown => {
                self.is_down = true;
                self.drop_cut(link);
            }
            PartEvent::LinkUp => self.is_down = false,
            _ => {}
        }
    }
}
