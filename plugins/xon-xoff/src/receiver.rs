//! The receiver: delivers what comes and stops the partner in time.

use crate::byte_set::ByteSet;
use crate::codes::Codes;
use crate::lines::{Lines, Piece};
use crate::state::Name;
use crate::{LineEnd, OnLineError, Settings};
use softplug_plugin::parts::Timers;
use softplug_plugin::{
    Context, DeliveryId, Failure, JobId, LineErrorKind, MarkId, Micros, NoteLevel, State, timers,
};

timers! {
    /// What the receiver keeps time for.
    pub(crate) enum Timer {
        /// Silence ends the reception.
        Quiet,
        /// Nothing came since our XON, say it again.
        RepeatXon,
    }
}

/// The mark of our control bytes; the sender counts its own up from 1.
pub(crate) const OUR_CONTROL: MarkId = MarkId(u32::MAX);

/// What we say to the partner.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Said {
    #[default]
    Nothing,
    Xon,
    Xoff,
}

#[derive(Clone, Debug, Default, State)]
pub(crate) struct Receiver {
    /// Id of the delivery under way; 0: none.
    delivery: DeliveryId,
    last_delivery: DeliveryId,
    /// Why the delivery under way cannot end well.
    failure: Option<Failure>,
    escaped: bool,
    lines: Lines,
    /// How much of the end mark has been seen, and how many whole ones.
    mark_progress: u32,
    marks_seen: u32,
    /// We have sent XOFF, and no XON since.
    stopped: bool,
    /// When we sent the latest XOFF, and how many characters came since. Those of
    /// the same time do not count, so that cuts make no difference.
    xoff_at: Option<Micros>,
    after_xoff: u32,
    /// Nothing came since our XON.
    xon_unanswered: bool,
    /// The control byte of ours that has not left yet. Another waits until it has: a
    /// partner that sends faster than the line cannot make more of them wait.
    leaving: Said,
    pub(crate) timers: Timers<Timer, 2>,
    low: u32,
    high: u32,
    /// Something came in the event under way.
    #[state(skip)]
    heard: bool,
    /// What comes is delivered as it is, but for control bytes.
    #[state(skip)]
    plain: bool,
    /// Bytes that are not delivered.
    #[state(skip)]
    drops: ByteSet,
    /// Of so many bytes of the end mark: its [`longest_border`]. Found once, since each
    /// character may ask for all of them.
    #[state(skip)]
    borders: [u8; 16],
}

impl Receiver {
    pub(crate) fn state(&self) -> Name {
        match (self.delivery, self.stopped) {
            (DeliveryId::NONE, false) => Name::Idle,
            (_, true) => Name::Stopped,
            (_, false) => Name::Receiving,
        }
    }

    /// Marks must leave the host space to report room in between. They rise with the room that is
    /// known, and stay over a swap: a converter that goes on is told what is left, not the whole.
    pub(crate) fn raise_marks(&mut self, settings: &Settings, room: u32) {
        self.low = self.low.max((settings.low_mark as u32).min(room / 2));
        let high = (settings.high_mark as u32).max(self.low).min(room / 4 * 3);
        self.high = self.high.max(high);
    }

    pub(crate) fn prepare(&mut self, settings: &Settings) {
        self.plain = !settings.transparent
            && settings.receive_line_end == LineEnd::Keep
            && settings.receive_drop.as_slice().is_empty()
            && settings.end_mark.as_slice().is_empty();
        self.drops = ByteSet::of(settings.receive_drop.as_slice());
        let mark = settings.end_mark.as_slice();
        for (seen, border) in self.borders.iter_mut().enumerate().take(mark.len()) {
            *border = longest_border(mark, seen) as u8;
        }
    }

    /// Characters, none of them a control byte.
    #[inline]
    pub(crate) fn data(&mut self, link: &mut Context<'_>, settings: &Settings, bytes: &[u8]) {
        self.begin(link);
        self.count_after_xoff(link, bytes.len() as u32);
        if self.plain {
            self.deliver(link, bytes);
            return;
        }
        for byte in bytes {
            self.byte(link, settings, *byte);
        }
    }

    fn byte(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        let byte = if settings.transparent {
            if !self.escaped && byte == settings.escape as u8 {
                self.escaped = true;
                return;
            }
            let change = if self.escaped { settings.escape_xor as u8 } else { 0 };
            self.escaped = false;
            byte ^ change
        } else {
            byte
        };
        self.look_for_end(settings, byte);
        if self.drops.has(byte) {
            return;
        }
        let bytes: &[u8] = match self.lines.map(settings.receive_line_end, byte) {
            Piece::Nothing => return,
            Piece::Byte(byte) => &[byte],
            Piece::End(end) => end,
        };
        self.deliver(link, bytes);
    }

    /// A damaged character keeps its place, so that its neighbours keep theirs.
    pub(crate) fn damaged(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        kind: LineErrorKind,
        byte: Option<u8>,
    ) {
        // What is lost cannot be kept, and may have been the beginning.
        let is_lost = kind == LineErrorKind::Overrun;
        let is_nothing = !is_lost && (kind == LineErrorKind::Break || byte.is_none());
        if is_nothing && self.delivery == DeliveryId::NONE {
            return;
        }
        self.begin(link);
        if is_lost {
            self.failure = Some(Failure::Overrun);
        } else if settings.on_line_error == OnLineError::Fail {
            self.failure.get_or_insert(Failure::LineError);
        }
        // What stands around it is apart.
        self.escaped = false;
        self.lines = Lines::default();
        self.mark_progress = 0;
        if let Some(byte) = byte {
            self.count_after_xoff(link, 1);
            self.deliver(link, &[byte]);
        }
    }

    fn count_after_xoff(&mut self, link: &Context<'_>, characters: u32) {
        if self.stopped && self.xoff_at.is_some_and(|at| link.now() > at) {
            self.after_xoff = self.after_xoff.saturating_add(characters);
        }
    }

    /// After the bytes of one time: marks, repeats, silence.
    #[inline(always)]
    pub(crate) fn after_bytes(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        codes: &Codes,
    ) {
        if !core::mem::take(&mut self.heard) {
            return;
        }
        self.xon_unanswered = false;
        self.timers.set(link, Timer::RepeatXon, None);
        if settings.speak {
            let repeat = settings.xoff_repeat as u32;
            let is_full = !self.stopped && link.delivery_room() < self.low;
            let is_ignored = self.stopped && repeat > 0 && self.after_xoff >= repeat;
            if is_full || is_ignored {
                self.stopped = true;
                self.xoff_at = Some(link.now());
                self.after_xoff = 0;
                self.say(link, codes);
            }
        }
        self.await_quiet(link, settings);
    }

    /// The host has put deliveries away.
    pub(crate) fn drained(&mut self, link: &mut Context<'_>, settings: &Settings, codes: &Codes) {
        self.raise_marks(settings, link.delivery_room());
        if !self.stopped || link.delivery_room() <= self.high {
            return;
        }
        self.say_xon(link, codes);
        self.xon_unanswered = true;
        self.await_repeat(link, settings);
        self.await_quiet(link, settings);
    }

    pub(crate) fn repeat_xon(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        codes: &Codes,
    ) {
        if self.xon_unanswered && self.delivery != DeliveryId::NONE {
            self.say(link, codes);
            self.await_repeat(link, settings);
        }
    }

    pub(crate) fn quiet(&mut self, link: &mut Context<'_>, settings: &Settings) {
        let lacks_mark = !settings.end_mark.as_slice().is_empty() && !self.is_complete(settings);
        self.end(link, lacks_mark.then_some(Failure::NoEndMark));
    }

    /// Ends the delivery under way; an earlier reason to fail goes first.
    pub(crate) fn end(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        if self.delivery == DeliveryId::NONE {
            return;
        }
        link.delivery_end(self.delivery, self.failure.or(failure), 0);
        self.delivery = DeliveryId::NONE;
        self.xon_unanswered = false;
        self.timers.set(link, Timer::Quiet, None);
        self.timers.set(link, Timer::RepeatXon, None);
    }

    /// The partner is not left waiting: what it still sends is another delivery.
    pub(crate) fn abort(&mut self, link: &mut Context<'_>, codes: &Codes) {
        self.end(link, Some(Failure::Aborted));
        self.let_go(link, codes);
    }

    /// A partner that we stopped, or may have, is to go on. So after the link was
    /// down: our XOFF may have been on its way.
    pub(crate) fn let_go(&mut self, link: &mut Context<'_>, codes: &Codes) {
        if self.stopped {
            self.say_xon(link, codes);
        }
    }

    fn begin(&mut self, link: &mut Context<'_>) {
        self.heard = true;
        if self.delivery == DeliveryId::NONE {
            self.begin_delivery(link);
        }
    }

    #[cold]
    fn begin_delivery(&mut self, link: &mut Context<'_>) {
        self.last_delivery = self.last_delivery.next();
        self.delivery = self.last_delivery;
        self.failure = None;
        self.escaped = false;
        self.lines = Lines::default();
        self.mark_progress = 0;
        self.marks_seen = 0;
        link.delivery_begin(self.delivery, JobId::NONE);
    }

    /// What finds no room is lost, and the delivery says so.
    #[inline]
    fn deliver(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let fitting = bytes.get(..link.delivery_room() as usize).unwrap_or(bytes);
        link.deliver(self.delivery, fitting);
        if fitting.len() < bytes.len() {
            self.overrun(link);
        }
    }

    #[cold]
    fn overrun(&mut self, link: &mut Context<'_>) {
        if self.failure != Some(Failure::Overrun) {
            self.failure = Some(Failure::Overrun);
            link.note(NoteLevel::Error, 0, "the partner did not stop: characters are lost");
        }
    }

    fn look_for_end(&mut self, settings: &Settings, byte: u8) {
        let mark = settings.end_mark.as_slice();
        if mark.is_empty() {
            return;
        }
        let mut progress = self.mark_progress as usize;
        while progress > 0 && mark.get(progress) != Some(&byte) {
            progress = usize::from(self.borders.get(progress).copied().unwrap_or(0));
        }
        if mark.get(progress) == Some(&byte) {
            progress += 1;
        }
        if progress == mark.len() {
            self.marks_seen = self.marks_seen.saturating_add(1);
            progress = 0;
        }
        self.mark_progress = progress as u32;
    }

    fn is_complete(&self, settings: &Settings) -> bool {
        !settings.end_mark.as_slice().is_empty()
            && i64::from(self.marks_seen) >= settings.end_mark_count
    }

    fn say_xon(&mut self, link: &mut Context<'_>, codes: &Codes) {
        self.stopped = false;
        self.say(link, codes);
    }

    /// Says ahead of all else whether the partner may send, or as soon as what was
    /// said before has left.
    pub(crate) fn say(&mut self, link: &mut Context<'_>, codes: &Codes) {
        if self.leaving != Said::Nothing {
            return;
        }
        self.leaving = self.to_say();
        let byte = if self.stopped { codes.xoff } else { codes.xon };
        link.transmit_urgent_marked(MarkId(OUR_CONTROL.0), &[byte]);
    }

    fn to_say(&self) -> Said {
        if self.stopped { Said::Xoff } else { Said::Xon }
    }

    /// Our control byte has left.
    pub(crate) fn left(&mut self, link: &mut Context<'_>, codes: &Codes) {
        let left = core::mem::take(&mut self.leaving);
        if left != Said::Nothing && left != self.to_say() {
            self.say(link, codes);
        }
    }

    /// Silence counts only while the partner may send.
    #[inline(always)]
    fn await_quiet(&mut self, link: &mut Context<'_>, settings: &Settings) {
        let span =
            if self.is_complete(settings) { settings.end_quiet } else { settings.quiet_time };
        let is_timed = self.delivery != DeliveryId::NONE && !self.stopped && span > 0;
        let at = is_timed.then(|| link.now() + Micros::from_millis(span));
        self.timers.set(link, Timer::Quiet, at);
    }

    fn await_repeat(&mut self, link: &mut Context<'_>, settings: &Settings) {
        let span = settings.xon_repeat;
        let is_timed = self.delivery != DeliveryId::NONE && span > 0;
        let at = is_timed.then(|| link.now() + Micros::from_millis(span));
        self.timers.set(link, Timer::RepeatXon, at);
    }
}

/// Length of the longest proper prefix of the first `seen` bytes that is also
/// their suffix.
fn longest_border(mark: &[u8], seen: usize) -> usize {
    let is_border =
        |length: &usize| (0..*length).all(|at| mark.get(at) == mark.get(seen - *length + at));
    (0..seen).rev().find(is_border).unwrap_or(0)
}
