//! The text of a capture on its way to the host: line ends, the tape check of
//! blocks, one delivery for each program or for all.

use super::Title;
use crate::reason::Reason;
use crate::request::Requests;
use crate::{LineEnd, OnLineError, Programs, Settings};
use softplug_plugin::{Context, DeliveryId, Failure, JobId, NoteLevel};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Characters that are handed over together.
const PIECE: usize = 256;
/// LF CR CR is one line end.
const MOST_OF_LF: u8 = 2;

#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Text {
    /// Id of the delivery under way; 0: none.
    delivery: u32,
    last_delivery: u32,
    /// Why the delivery cannot end well: the first reason.
    failure: Reason,
    filled: u16,
    /// What the host knows of the name.
    named: u8,
    /// CRs that may still come that belong to the LF before them.
    of_lf: u8,
    /// A CR that ends a line, unless it belongs to an LF that follows.
    after_cr: bool,
    /// The characters of the block are odd in number.
    odd: bool,
    /// An EOB has come: blocks are checked from it on.
    counts: bool,
    /// An EOB has come behind the second %.
    ended_behind: bool,
    spare: [u8; 2],
    title: Title,
    /// Empty between two events.
    piece: [u8; PIECE],
}

impl Text {
    /// A capture begins; its delivery does with its first %.
    pub(super) fn start(&mut self) {
        self.failure = Reason::new(None);
        self.title = Title::new();
        self.of_lf = 0;
        self.after_cr = false;
        self.odd = false;
        self.counts = false;
        self.ended_behind = false;
    }

    #[inline(never)]
    pub(super) fn begin(&mut self, link: &mut Context<'_>) {
        self.of_lf = 0;
        self.after_cr = false;
        self.last_delivery = self.last_delivery.wrapping_add(1).max(1);
        self.delivery = self.last_delivery;
        self.named = 0;
        link.delivery_begin(DeliveryId(self.delivery), JobId::NONE);
        self.put(link, b'%');
    }

    /// Whether an EOB has come behind the first %.
    pub(super) fn has_ended_line(&self) -> bool {
        self.counts
    }

    /// An EOB behind the second %.
    pub(super) fn end_behind(&mut self) {
        self.ended_behind = true;
    }

    /// Behind the second % comes another program, with this character: the one before is ended.
    /// Its % is this one's first, if that has none of its own.
    pub(super) fn begin_again(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        requests: &mut Requests,
        character: u8,
    ) {
        let is_in_block = self.ended_behind;
        self.end(link, settings, requests, None);
        self.start();
        self.begin(link);
        if character == b'%' {
            return;
        }
        if is_in_block {
            self.counts = true;
            self.title.next_program();
            self.line_end(link, settings);
        }
        self.character(link, settings, requests, character);
    }

    /// One or two CRs behind an LF belong to it; any other is a line end, with the LF that may
    /// follow it.
    pub(super) fn carriage_return(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.end_at_cr(link, settings);
        self.after_cr = self.of_lf == 0;
        self.of_lf = self.of_lf.saturating_sub(1);
        self.odd ^= settings.tv_cr;
    }

    /// A character behind the first %; LF is EOB.
    pub(super) fn character(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        requests: &mut Requests,
        character: u8,
    ) {
        if character == b'\n' {
            self.of_lf = if self.after_cr { 0 } else { MOST_OF_LF };
            self.after_cr = false;
            self.odd = !self.odd;
            self.end_of_block(link, settings);
            return;
        }
        self.of_lf = 0;
        self.end_at_cr(link, settings);
        if settings.programs == Programs::Split && self.title.ends_before(character) {
            self.put_close(link, settings);
            self.end(link, settings, requests, None);
            self.failure = Reason::new(None);
            self.title.next_program();
            self.begin(link);
            self.line_end(link, settings);
        }
        let in_comment = self.title.read(settings, character);
        self.odd ^= settings.tv_comments || !in_comment;
        self.put(link, character);
    }

    /// The second %.
    pub(super) fn close(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.end_at_cr(link, settings);
        self.ended_behind = false;
        self.put_close(link, settings);
    }

    fn put_close(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.put(link, b'%');
        self.line_end(link, settings);
    }

    fn end_at_cr(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if core::mem::take(&mut self.after_cr) {
            self.odd ^= !settings.tv_cr;
            self.end_of_block(link, settings);
        }
    }

    fn end_of_block(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.odd && self.counts && settings.tv_check {
            self.fail(Failure::ParityCheck);
        }
        self.odd = false;
        self.counts = true;
        self.title.end_of_block();
        self.give_name(link);
        self.line_end(link, settings);
    }

    fn line_end(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if settings.line_end == LineEnd::CrLf {
            self.put(link, b'\r');
        }
        self.put(link, b'\n');
    }

    pub(super) fn put(&mut self, link: &mut Context<'_>, byte: u8) {
        if usize::from(self.filled) == PIECE {
            self.flush(link);
        }
        if let Some(place) = self.piece.get_mut(usize::from(self.filled)) {
            *place = byte;
            self.filled += 1;
        }
    }

    /// What finds no room is lost, and the delivery says so.
    pub(super) fn flush(&mut self, link: &mut Context<'_>) {
        let room = link.delivery_room() as usize;
        let fitting = usize::from(self.filled).min(room);
        let is_lost = fitting < usize::from(self.filled);
        self.filled = 0;
        if fitting > 0 {
            link.deliver(DeliveryId(self.delivery), self.piece.get(..fitting).unwrap_or_default());
        }
        if is_lost && !self.failure.is(Failure::Overrun) {
            self.lost();
            link.note(NoteLevel::Error, 0, "characters are lost");
        }
    }

    pub(super) fn lost(&mut self) {
        self.failure = Reason::new(Some(Failure::Overrun));
    }

    pub(super) fn damaged(&mut self, settings: &Settings) {
        if settings.on_line_error == OnLineError::Fail {
            self.fail(Failure::LineError);
        }
    }

    fn fail(&mut self, failure: Failure) {
        self.failure.keep(failure);
    }

    /// Ends the delivery; a capture of nothing has none. An earlier reason to fail
    /// goes first.
    pub(super) fn end(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        requests: &mut Requests,
        failure: Option<Failure>,
    ) {
        if self.delivery == 0 {
            return;
        }
        self.flush(link);
        let failure = self.failure.failure().or(failure);
        self.give_name(link);
        link.delivery_end(DeliveryId(self.delivery), failure, 0);
        self.delivery = 0;
        if failure.is_none() {
            requests.look(link, settings, &self.title);
        }
    }

    /// Told as soon as it is known, in case the capture is interrupted; a number
    /// that comes behind a comment replaces it.
    fn give_name(&mut self, link: &mut Context<'_>) {
        let (rank, name) = self.title.name();
        if rank > self.named {
            self.named = rank;
            link.delivery_name_ascii(DeliveryId(self.delivery), name);
        }
    }
}
