//! The sender: feeds a program and obeys the partner.

use crate::byte_set::ByteSet;
use crate::codes::Codes;
use crate::lines::{Lines, Piece};
use crate::state::Name;
use crate::{ControlInData, HELD, LineEnd, Settings};
use softplug_plugin::{Context, Failure, JobId, JobStart, MarkId, Micros, Pass, State};

/// Data that may be under way to us: what it grows to fits the output buffer.
const MOST_WANTED: u32 = 3_072;

/// What the sender is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Stage {
    /// No job.
    #[default]
    Idle,
    /// Looking at the data of a job, sending nothing.
    Checking,
    /// Feeding.
    Feeding,
    /// All data was given; the feed's strings are not wholly queued.
    Closing,
    /// All is queued; waiting until the last byte has left.
    Draining,
    /// The queue is being dropped; the job then fails.
    Stopping,
}

impl Stage {
    /// Whether the job has bytes to send.
    fn is_feeding(self) -> bool {
        matches!(self, Self::Feeding | Self::Closing | Self::Draining)
    }
}

#[derive(Clone, Debug, Default, State)]
#[state(check = Self::is_sound)]
pub(crate) struct Sender {
    stage: Stage,
    /// Why the job is being stopped.
    failure: Option<Failure>,
    job: JobId,
    /// Asked for and not yet given.
    wanted: u32,
    /// Bytes queued for the job.
    queued: u64,
    /// Bytes of the feed's strings that found no room yet.
    unqueued: u32,
    lines: Lines,
    /// Place in the program, for the check.
    line: u32,
    column: u32,
    mark: MarkId,
    /// The partner has sent XOFF, and no XON since.
    held: bool,
    /// The first XON of the job has not come yet.
    waits_for_xon: bool,
    paused: bool,
    /// Whether the queue is held for any of these reasons.
    holding: bool,
    held_until: Option<Micros>,
    /// What follows from control bytes is done behind the last of their event, of which
    /// there may be a thousand.
    #[state(skip)]
    is_hearing: bool,
    /// Bytes of a program are sent as they are, but for control bytes.
    #[state(skip)]
    plain: bool,
    /// Bytes of a program that are not sent.
    #[state(skip)]
    drops: ByteSet,
}

impl Sender {
    pub(crate) fn prepare(&mut self, settings: &Settings) {
        self.plain = settings.send_line_end == LineEnd::Keep
            && settings.send_drop.as_slice().is_empty()
            && !settings.transparent;
        self.drops = ByteSet::of(settings.send_drop.as_slice());
    }

    pub(crate) fn is_sending(&self) -> bool {
        self.stage != Stage::Idle
    }

    /// What people are told, if there is a job.
    #[inline(always)]
    pub(crate) fn state(&self) -> Option<Name> {
        let state = match self.stage {
            Stage::Idle => return None,
            Stage::Checking => Name::Checking,
            Stage::Stopping => Name::Stopping,
            _ if self.held => Name::Held,
            _ if self.waits_for_xon => Name::WaitingForXon,
            _ if self.paused => Name::Paused,
            Stage::Feeding | Stage::Closing | Stage::Draining => Name::Sending,
        };
        Some(state)
    }

    /// Control bytes may come. Returns what [`has_heard`](Self::has_heard) wants.
    #[inline(always)]
    pub(crate) fn hears(&mut self) -> Option<Micros> {
        self.is_hearing = true;
        self.held_until
    }

    /// The event is over.
    #[inline(always)]
    pub(crate) fn has_heard(&mut self, link: &mut Context<'_>, held_until: Option<Micros>) {
        self.is_hearing = false;
        self.update_hold(link);
        if self.held_until != held_until {
            match self.held_until {
                Some(until) => link.set_timer(HELD, until),
                None => link.cancel_timer(HELD),
            }
        }
    }

    pub(crate) fn xoff(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.held {
            return;
        }
        self.held = true;
        self.update_hold(link);
        self.watch_hold(link, settings);
    }

    pub(crate) fn xon(&mut self, link: &mut Context<'_>) {
        self.forget_hold(link);
    }

    /// The partner no longer holds us, whatever it said.
    pub(crate) fn forget_hold(&mut self, link: &mut Context<'_>) {
        self.waits_for_xon = false;
        self.released(link);
    }

    /// The partner's hold is over. A job still waits for its first XON.
    pub(crate) fn released(&mut self, link: &mut Context<'_>) {
        self.held = false;
        if self.held_until.take().is_some() && !self.is_hearing {
            link.cancel_timer(HELD);
        }
        self.update_hold(link);
    }

    pub(crate) fn set_paused(&mut self, link: &mut Context<'_>, paused: bool) {
        self.paused = paused;
        self.update_hold(link);
    }

    pub(crate) fn update_hold(&mut self, link: &mut Context<'_>) {
        let holding = self.held || self.waits_for_xon || self.paused;
        if holding == self.holding || self.is_hearing {
            return;
        }
        self.holding = holding;
        if holding { link.hold() } else { link.release() }
    }

    /// A hold is timed only while there is a job to fail.
    fn watch_hold(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.held && self.stage.is_feeding() && settings.held_timeout > 0 {
            let until = link.now() + Micros::from_millis(settings.held_timeout);
            self.held_until = Some(until);
            if !self.is_hearing {
                link.set_timer(HELD, until);
            }
        }
    }

    pub(crate) fn set_timers(&self, link: &mut Context<'_>) {
        if let Some(until) = self.held_until {
            link.set_timer(HELD, until);
        }
    }

    pub(crate) fn begin(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        job: &JobStart<'_>,
    ) {
        if self.is_sending() {
            link.job_failed(job.job, Failure::Busy, 0, 0);
            return;
        }
        if job.kind != 0 {
            link.job_failed(job.job, Failure::NotSupported, 0, 0);
            return;
        }
        self.job = job.job;
        self.wanted = 0;
        self.queued = 0;
        self.lines = Lines::default();
        self.line = 1;
        self.column = 0;
        if job.pass == Pass::Check {
            self.stage = Stage::Checking;
        } else {
            self.stage = Stage::Feeding;
            self.waits_for_xon = settings.wait_for_xon;
            self.update_hold(link);
            self.watch_hold(link, settings);
            self.unqueued = settings.feed_start.as_slice().len() as u32;
        }
        self.go_on(link, settings);
    }

    /// Does what there is room for.
    pub(crate) fn go_on(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.unqueued == 0 || self.queue_strings(link, settings) {
            self.ask(link, settings);
        }
    }

    /// Queues of the strings around the program what there is room for; whether that was all.
    #[inline(never)]
    fn queue_strings(&mut self, link: &mut Context<'_>, settings: &Settings) -> bool {
        let start = settings.feed_start.as_slice();
        let is_closing = self.stage == Stage::Closing;
        let end = if is_closing { settings.feed_end.as_slice() } else { &[] };
        let all = start.len() + end.len();
        // Of a state that was saved under other settings too much may wait.
        self.unqueued = self.unqueued.min(all as u32);
        let mut queued = all - self.unqueued as usize;
        for string in [start, end] {
            let rest = string.get(queued..).unwrap_or_default();
            queued = queued.saturating_sub(string.len());
            let fitting = rest.get(..link.transmit_room() as usize).unwrap_or(rest);
            self.unqueued -= fitting.len() as u32;
            self.queue(link, fitting);
        }
        if self.unqueued == 0 && is_closing {
            self.mark = self.mark.next();
            link.transmit_marked(self.mark, &[]);
            self.stage = Stage::Draining;
        }
        self.unqueued == 0
    }

    /// Asks for as much as can be queued whatever it grows to, with the feed's
    /// end kept in reserve.
    fn ask(&mut self, link: &mut Context<'_>, settings: &Settings) {
        let most = match self.stage {
            Stage::Checking => MOST_WANTED,
            Stage::Feeding => {
                let reserve = settings.feed_end.as_slice().len() as u32;
                let room = link.transmit_room().saturating_sub(reserve);
                let room = room.min(MOST_WANTED);
                if self.plain { room } else { room / growth(settings) }
            }
            _ => return,
        };
        // Small requests would make many small events.
        if most > self.wanted && (most - self.wanted >= most / 4 || self.wanted == 0) {
            link.want(self.job, most - self.wanted);
            self.wanted = most;
        }
    }

    pub(crate) fn data(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        codes: &Codes,
        bytes: &[u8],
    ) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        match self.stage {
            Stage::Checking => self.check(link, settings, codes, bytes),
            Stage::Feeding => self.feed(link, settings, codes, bytes),
            _ => return,
        }
        self.ask(link, settings);
    }

    fn check(&mut self, link: &mut Context<'_>, settings: &Settings, codes: &Codes, bytes: &[u8]) {
        for byte in bytes {
            self.column += 1;
            if self.is_refused(settings, codes, *byte) {
                let failure = Failure::UnsupportedCharacter;
                link.check_failed(self.job, failure, self.line, self.column);
                self.finish(link);
                return;
            }
            if *byte == b'\n' {
                self.line += 1;
                self.column = 0;
            }
        }
    }

    fn feed(&mut self, link: &mut Context<'_>, settings: &Settings, codes: &Codes, bytes: &[u8]) {
        if self.plain && codes.split(bytes).1.is_none() {
            self.queue(link, bytes);
            return;
        }
        for byte in bytes {
            if self.is_refused(settings, codes, *byte) {
                self.stop(link, Failure::UnsupportedCharacter);
                return;
            }
            if self.is_dropped(settings, codes, *byte) {
                continue;
            }
            match self.lines.map(settings.send_line_end, *byte) {
                Piece::Nothing => {}
                Piece::Byte(byte) => self.queue_data(link, settings, codes, &[byte]),
                Piece::End(end) => self.queue_data(link, settings, codes, end),
            }
        }
    }

    fn is_dropped(&self, settings: &Settings, codes: &Codes, byte: u8) -> bool {
        let is_control = !settings.transparent && codes.control(byte).is_some();
        let is_listed = self.drops.has(byte);
        is_listed || (is_control && settings.control_in_data == ControlInData::Drop)
    }

    fn is_refused(&self, settings: &Settings, codes: &Codes, byte: u8) -> bool {
        settings.control_in_data == ControlInData::Refuse
            && !settings.transparent
            && codes.control(byte).is_some()
            && !self.drops.has(byte)
    }

    fn queue_data(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        codes: &Codes,
        bytes: &[u8],
    ) {
        if !settings.transparent {
            self.queue(link, bytes);
            return;
        }
        for byte in bytes {
            match codes.escaped(*byte) {
                Some(pair) => self.queue(link, &pair),
                None => self.queue(link, &[*byte]),
            }
        }
    }

    fn queue(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.queued += bytes.len() as u64;
        link.transmit(bytes);
    }

    pub(crate) fn data_ended(&mut self, link: &mut Context<'_>, settings: &Settings) {
        match self.stage {
            Stage::Checking => {
                link.check_good(self.job);
                self.stage = Stage::Idle;
            }
            Stage::Feeding => {
                self.stage = Stage::Closing;
                self.unqueued += settings.feed_end.as_slice().len() as u32;
                self.queue_strings(link, settings);
            }
            _ => {}
        }
    }

    /// A marked byte has left: the job's last one, or one of a job that was stopped.
    pub(crate) fn left(&mut self, link: &mut Context<'_>, mark: MarkId) {
        if self.stage == Stage::Draining && mark == self.mark {
            link.job_done(self.job, self.queued);
            self.finish(link);
        }
    }

    /// Stops at once and drops what is queued; the job fails when it is known
    /// how much that was.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.stage == Stage::Checking {
            link.job_failed(self.job, failure, 0, 0);
            self.finish(link);
        } else if self.stage.is_feeding() {
            link.discard();
            self.unqueued = 0;
            self.stage = Stage::Stopping;
            self.failure = Some(failure);
        }
    }

    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, settings: &Settings, bytes: u32) {
        let Some(failure) = self.failure.take() else { return };
        let sent = self.queued.saturating_sub(u64::from(bytes));
        link.job_failed(self.job, failure, 0, sent);
        // What lay before the job's bytes are the last words of a job before it.
        let lost = u64::from(bytes).saturating_sub(self.queued) as usize;
        let last_words = settings.abort_send.as_slice();
        let words = if failure == Failure::Aborted {
            last_words
        } else {
            last_words.get(last_words.len().saturating_sub(lost)..).unwrap_or_default()
        };
        if words.len() as u32 <= link.transmit_room() {
            link.transmit(words);
        }
        self.finish(link);
    }

    /// What belonged to the job alone ends with it; a partner's XOFF stays.
    fn finish(&mut self, link: &mut Context<'_>) {
        self.stage = Stage::Idle;
        self.paused = false;
        self.waits_for_xon = false;
        self.wanted = 0;
        self.unqueued = 0;
        if self.held_until.take().is_some() {
            link.cancel_timer(HELD);
        }
        self.update_hold(link);
    }

    /// Why a job is stopped is known until it has failed. Strings wait of a job that feeds, and of
    /// one that closes surely.
    fn is_sound(&self) -> bool {
        let may_wait = matches!(self.stage, Stage::Feeding | Stage::Closing);
        let must_wait = self.stage == Stage::Closing;
        (self.stage == Stage::Stopping) == self.failure.is_some()
            && if self.unqueued > 0 { may_wait } else { !must_wait }
    }
}

/// How many bytes one byte of a program can become.
fn growth(settings: &Settings) -> u32 {
    let line_end = match settings.send_line_end {
        LineEnd::Keep | LineEnd::Lf | LineEnd::Cr => 1,
        LineEnd::CrLf => 2,
        LineEnd::LfCrCr => 3,
    };
    if settings.transparent { 2 * line_end } else { line_end }
}
