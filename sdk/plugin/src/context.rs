//! What a converter can do while it handles an event.

use crate::{DeliveryId, Failure, JobId, MarkId, Micros, ModemLines, NoteLevel, RequestId, Values};
use softplug_abi::limits::{DELIVERY_NAME_BYTES, NOTE_BYTES, STATE_NAME_BYTES};
use softplug_abi::wire::NoSpace;
use softplug_abi::{Action, ActionWriter};

/// How much may be transmitted and delivered.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Rooms {
    pub(crate) transmit: u32,
    pub(crate) delivery: u32,
}

/// The link, while one event is handled. Each method writes one action; the
/// host carries them out in order, after the event.
///
/// Actions of one event must fit the output buffer (4,096 bytes in a plug-in
/// made by [`export!`](crate::export!)): ask for less data at a time, or go on in
/// [`Converter::more`](crate::Converter::more). Past it the plug-in panics.
///
/// ```
/// use softplug_plugin::bench::{Bench, Observed};
/// use softplug_plugin::{Context, Converter, DeliveryId, JobId, Micros};
///
/// /// Delivers each character, and holds its own sending for a second at the first.
/// struct Quiet;
///
/// impl Converter for Quiet {
///     type Settings = ();
///     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "quiet", "version": "1.0.0",
///         "licence": "MIT", "protocol": "none", "description": "Holds for a second."}"#;
///
///     fn new((): ()) -> Self {
///         Self
///     }
///
///     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
///         link.hold();
///         link.transmit(b"later");
///         link.set_timer(0, link.now() + Micros::from_secs(1));
///         link.delivery_begin(DeliveryId(1), JobId::NONE);
///         link.deliver(DeliveryId(1), bytes);
///         link.delivery_end(DeliveryId(1), None, 0);
///     }
///
///     fn timer(&mut self, link: &mut Context<'_>, _id: u8, _deadline: Micros) {
///         link.release();
///     }
/// }
///
/// let mut bench = Bench::<Quiet>::new().open();
/// bench.receive(b"?");
/// bench.run_for_millis(999);
/// assert_eq!(bench.sent(), b"");
/// bench.run_for_millis(100);
/// assert_eq!(bench.sent(), b"later");
/// assert_eq!(bench.deliveries()[0].bytes, b"?");
/// ```
#[derive(Debug)]
pub struct Context<'a> {
    writer: ActionWriter<'a>,
    now: Micros,
    rooms: &'a mut Rooms,
    again: bool,
}

impl<'a> Context<'a> {
    #[inline]
    pub(crate) fn new(output: &'a mut [u8], now: Micros, rooms: &'a mut Rooms) -> Self {
        Self { writer: ActionWriter::new(output), now, rooms, again: false }
    }

    pub(crate) fn set_rooms(&mut self, transmit: u32, delivery: u32) {
        *self.rooms = Rooms { transmit, delivery };
    }

    pub(crate) fn grow_transmit_room(&mut self, grown: u32) {
        self.rooms.transmit = self.rooms.transmit.saturating_add(grown);
    }

    pub(crate) fn grow_delivery_room(&mut self, grown: u32) {
        self.rooms.delivery = self.rooms.delivery.saturating_add(grown);
    }

    /// Length of the output, and whether there is more to come.
    #[inline]
    pub(crate) fn finish(self) -> (usize, bool) {
        (self.writer.len(), self.again)
    }

    /// Time of the event on the link's clock.
    #[inline]
    pub fn now(&self) -> Micros {
        self.now
    }

    /// Bytes that may be transmitted now.
    #[inline]
    pub fn transmit_room(&self) -> u32 {
        self.rooms.transmit
    }

    /// Bytes that may be delivered now.
    #[inline]
    pub fn delivery_room(&self) -> u32 {
        self.rooms.delivery
    }

    /// Bytes left in the output buffer, headers of records included.
    #[inline]
    pub fn output_room(&self) -> usize {
        self.writer.room()
    }

    /// Gives each byte to `take`, while `reserve` bytes of [output](Self::output_room) are left, as many as one
    /// byte can bring; returns those that are left over, for [`Unread`](crate::Unread).
    pub fn each_byte<'b>(
        &mut self,
        bytes: &'b [u8],
        reserve: usize,
        mut take: impl FnMut(&mut Self, u8),
    ) -> &'b [u8] {
        let mut rest = bytes;
        while let Some((byte, after)) = rest.split_first()
            && self.output_room() >= reserve
        {
            take(self, *byte);
            rest = after;
        }
        rest
    }

    /// Asks to be called again at the same time, in [`Converter::more`](crate::Converter::more).
    pub fn again(&mut self) {
        self.again = true;
    }

    /// Appends bytes to the transmit queue.
    ///
    /// # Panics
    /// There is less [room](Self::transmit_room).
    pub fn transmit(&mut self, bytes: &[u8]) {
        self.take_transmit_room(bytes);
        fitted_here(self.writer.transmit(bytes));
    }

    /// Appends bytes; [`Converter::mark`](crate::Converter::mark) tells when the last of them has left. With no
    /// bytes: when the last byte of the queue has. A mark of 0 is no mark.
    ///
    /// # Panics
    /// There is less [room](Self::transmit_room).
    pub fn transmit_marked(&mut self, mark: MarkId, bytes: &[u8]) {
        self.take_transmit_room(bytes);
        fitted(self.writer.transmit_marked(mark, bytes));
    }

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn take_transmit_room(&mut self, bytes: &[u8]) {
        let count = bytes.len() as u32;
        assert!(count <= self.rooms.transmit, "transmits more bytes than there is room for");
        self.rooms.transmit -= count;
    }

    /// Sends up to 16 bytes ahead of queue and hold.
    pub fn transmit_urgent(&mut self, bytes: &[u8]) {
        self.push(&Action::TransmitUrgent { mark: MarkId::NONE, bytes });
    }

    /// Sends up to 16 bytes ahead of queue and hold, with a mark.
    pub fn transmit_urgent_marked(&mut self, mark: MarkId, bytes: &[u8]) {
        self.push(&Action::TransmitUrgent { mark, bytes });
    }

    /// Stops the transmit queue before its next byte.
    pub fn hold(&mut self) {
        self.push(&Action::Hold);
    }

    /// Lets the transmit queue go on.
    pub fn release(&mut self) {
        self.push(&Action::Release);
    }

    /// Drops what the queue holds; [`Converter::discarded`](crate::Converter::discarded) tells how much.
    pub fn discard(&mut self) {
        self.push(&Action::Discard);
    }

    /// Sets timer `id` (0 to 15) to an absolute time; one in the past runs out now.
    #[inline(never)]
    pub fn set_timer(&mut self, id: u8, deadline: Micros) {
        fitted_here(self.writer.set_timer(id, deadline));
    }

    /// Sets timer `id` to a span from now.
    pub fn set_timer_after(&mut self, id: u8, span: Micros) {
        self.set_timer(id, self.now + span);
    }

    /// Cancels timer `id`.
    pub fn cancel_timer(&mut self, id: u8) {
        self.push(&Action::CancelTimer { id });
    }

    /// Sets RTS and DTR: those in `mask`, on where they are in `on` too.
    pub fn set_modem_lines(&mut self, mask: ModemLines, on: ModemLines) {
        self.push(&Action::ModemLines { mask, on });
    }

    /// Sends a break of so many µs, at most 10 s.
    pub fn send_break(&mut self, micros: u32) {
        self.push(&Action::Break { micros });
    }

    /// Asks for `bytes` more of the job's data; nothing for 0.
    pub fn want(&mut self, job: JobId, bytes: u32) {
        if bytes > 0 {
            fitted_here(self.writer.want(job, bytes));
        }
    }

    /// Begins a delivery under an id of the converter's choice, not 0.
    pub fn delivery_begin(&mut self, delivery: DeliveryId, job: JobId) {
        self.push(&Action::DeliveryBegin { delivery, job });
    }

    /// Hands bytes to the host.
    ///
    /// # Panics
    /// There is less [room](Self::delivery_room).
    #[inline]
    pub fn deliver(&mut self, delivery: DeliveryId, bytes: &[u8]) {
        let count = bytes.len() as u32;
        assert!(count <= self.rooms.delivery, "delivers more bytes than there is room for");
        self.rooms.delivery -= count;
        fitted_here(self.writer.deliver(delivery, bytes));
    }

    /// Names the delivery; cut to 128 bytes.
    pub fn delivery_name(&mut self, delivery: DeliveryId, name: &str) {
        self.push(&Action::DeliveryName { delivery, name: cut(name, DELIVERY_NAME_BYTES) });
    }

    /// Names the delivery by characters of ASCII; cut to 128 bytes. Of any other byte
    /// the highest bit is left out: so the name is a text whatever came from the line.
    pub fn delivery_name_ascii(&mut self, delivery: DeliveryId, name: &[u8]) {
        let name = name.get(..DELIVERY_NAME_BYTES).unwrap_or(name);
        fitted(self.writer.delivery_name_ascii(delivery, name));
    }

    /// Ends the delivery: complete, or failed.
    pub fn delivery_end(&mut self, delivery: DeliveryId, failure: Option<Failure>, status: u16) {
        self.push(&Action::DeliveryEnd { delivery, failure, status });
    }

    /// The job is done; so many bytes left for it.
    pub fn job_done(&mut self, job: JobId, sent: u64) {
        self.push(&Action::JobDone { job, sent });
    }

    /// The job has failed; so many bytes left for it.
    pub fn job_failed(&mut self, job: JobId, failure: Failure, status: u16, sent: u64) {
        self.push(&Action::JobFailed { job, failure, status, sent });
    }

    /// The job's check pass was good.
    pub fn check_good(&mut self, job: JobId) {
        self.push(&Action::CheckResult { job, failure: None, status: 0, line: 0, column: 0 });
    }

    /// The job's check pass found a fault at this line and column, from 1.
    pub fn check_failed(&mut self, job: JobId, failure: Failure, line: u32, column: u32) {
        let failure = Some(failure);
        self.push(&Action::CheckResult { job, failure, status: 0, line, column });
    }

    /// The job's check pass found a fault that has a status of the manifest too, at this line and
    /// column, from 1; 0: at none.
    pub fn check_failed_with(
        &mut self,
        job: JobId,
        failure: Failure,
        status: u16,
        line: u32,
        column: u32,
    ) {
        self.push(&Action::CheckResult { job, failure: Some(failure), status, line, column });
    }

    /// Asks the host for something of `kind`, its place in the manifest.
    pub fn request(&mut self, request: RequestId, kind: u16, fields: Values<'_>) {
        self.push(&Action::Request { request, kind, fields });
    }

    /// Takes a request back.
    pub fn withdraw(&mut self, request: RequestId) {
        self.push(&Action::Withdraw { request });
    }

    /// A line for the log; cut to 240 bytes.
    pub fn note(&mut self, level: NoteLevel, code: u16, text: &str) {
        self.push(&Action::Note { level, code, text: cut(text, NOTE_BYTES) });
    }

    /// Names the state that the converter is in now, for people.
    pub fn state(&mut self, name: &str) {
        self.push(&Action::State { name: cut(name, STATE_NAME_BYTES) });
    }

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub(crate) fn push(&mut self, action: &Action<'_>) {
        fitted(self.writer.push(action));
    }
}

#[cfg_attr(target_arch = "wasm32", inline(never))]
fn fitted(pushed: Result<(), NoSpace>) {
    fitted_here(pushed);
}

/// Without a call, for the most frequent actions.
#[cfg_attr(target_arch = "wasm32", inline(always))]
fn fitted_here(pushed: Result<(), NoSpace>) {
    if pushed.is_err() {
        too_many();
    }
}

#[cold]
#[inline(never)]
fn too_many() -> ! {
    panic!("writes more actions in one event than the output buffer holds");
}

fn cut(text: &str, limit: usize) -> &str {
    let mut end = text.len().min(limit);
    loop {
        // Slicing would bring the text of its panic into every plug-in.
        match text.get(..end) {
            Some(cut) => return cut,
            None => end -= 1,
        }
    }
}
