//! A session: frames of an uplink that may lose, double, delay or reorder them become messages
//! that arrive once and in order.
//!
//! The server calls, the unit answers. Frames with messages are numbered; each side says up to
//! which number all have come, and what is not confirmed in time is sent again from there on. Who
//! hears nothing for [`SILENCE`] ends the session. What outlives it is for the layer above: see
//! [`Feeding`](crate::Feeding).

mod event;
mod queue;

use softplug_abi::wire::{Reader, Writer};
use softplug_abi::{Micros, NoSpace};

use crate::frame::{Frame, FrameError, FrameKind};
use crate::message::Encode;
use queue::{Confirmed, Queue};

pub use event::{EndReason, Identity, RefuseReason, Role, SessionError, SessionEvent};

/// A side that has nothing to say says so after this span.
const HEARTBEAT: Micros = Micros::from_millis(500);
/// After this span without a frame of the other side the session ends.
const SILENCE: Micros = Micros::from_millis(3_000);
/// After this span without news of what is under way the session ends, although the other side
/// lives: it never takes that.
const CONFIRMED: Micros = Micros::from_millis(10_000);
/// The server calls again after this span.
const CALL: Micros = Micros::from_millis(1_000);
/// Bounds of the span after which what is not confirmed is sent again; it follows the uplink's
/// round trip.
const RETRY: (Micros, Micros) = (Micros::from_millis(50), Micros::from_millis(2_000));
/// That span while no round trip is known.
const FIRST_RETRY: Micros = Micros::from_millis(500);

/// The least that an end takes in one frame, in bytes of payload: no message without a text of its own
/// is longer.
const LEAST_TAKEN: u16 = 128;

/// One end of a session, with room for `SLOTS` frames of `BYTES` bytes of payload that are not
/// confirmed yet.
///
/// Time only ever goes on. After each call, [`poll`](Self::poll), then
/// [`poll_transmit`](Self::poll_transmit) until `None`, then [`poll_timeout`](Self::poll_timeout)
/// for when [`handle_timeout`](Self::handle_timeout) is due; calling that early does nothing.
///
/// ```
/// use softplug_abi::Micros;
/// use softplug_unit_protocol::{
///     Identity, LONGEST, Messages, Role, Session, SessionEvent, ToUnit,
/// };
///
/// let now = Micros::ZERO;
/// let mut server = Session::<4, 256>::new(Role::Server, Identity(1));
/// let mut unit = Session::<4, 256>::new(Role::Unit, Identity(2));
/// let mut wire = [0; LONGEST];
///
/// server.call(now);
/// while let Some(length) = server.poll_transmit(now, &mut wire) {
///     unit.receive(now, &wire[..length])?;
/// }
/// assert_eq!(unit.poll(), Some(SessionEvent::Began { peer: Identity(1) }));
/// let length = unit.poll_transmit(now, &mut wire).unwrap();
/// server.receive(now, &wire[..length])?;
/// assert_eq!(server.poll(), Some(SessionEvent::Began { peer: Identity(2) }));
///
/// server.send(&ToUnit::Pause { link: 0, job: 7 })?;
/// let length = server.poll_transmit(now, &mut wire).unwrap();
/// let payload = unit.receive(now, &wire[..length])?.unwrap();
/// let first: ToUnit = Messages::new(payload).next().unwrap()?;
/// assert_eq!(first, ToUnit::Pause { link: 0, job: 7 });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Session<const SLOTS: usize, const BYTES: usize> {
    role: Role,
    own: Identity,
    phase: Phase,
    /// Who called, or calls, and how often.
    server: Identity,
    call: u32,
    /// The session's number; the unit chooses it.
    number: u32,
    queue: Queue<SLOTS, BYTES>,
    /// All frames of the other side up to this number have come.
    taken: u32,
    owes: Owes,
    heard_at: Micros,
    said_at: Micros,
    retry_at: Option<Micros>,
    retry: Micros,
    /// The oldest frame that is under way must be confirmed until then.
    confirmed_by: Option<Micros>,
    /// Round trip, smoothed, and how far it varies.
    round_trip: Option<(Micros, Micros)>,
    event: Option<SessionEvent>,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Phase {
    Idle,
    Calling { again_at: Micros },
    Up,
}

/// Frames that are to leave beside those with messages.
#[derive(Copy, Clone, Debug, Default)]
struct Owes {
    hello: bool,
    welcome: bool,
    /// Why, in which session, and whose call it answers.
    refusal: Option<(RefuseReason, u32, Identity, u32)>,
    taken: bool,
}

impl<const SLOTS: usize, const BYTES: usize> Session<SLOTS, BYTES> {
    /// An end without a session.
    pub fn new(role: Role, own: Identity) -> Self {
        Self {
            role,
            own,
            phase: Phase::Idle,
            server: own,
            call: 0,
            // A unit that was started anew must not take up numbers of its former life.
            number: own.0 as u32,
            queue: Queue::new(),
            taken: 0,
            owes: Owes::default(),
            heard_at: Micros::ZERO,
            said_at: Micros::ZERO,
            retry_at: None,
            retry: FIRST_RETRY,
            confirmed_by: None,
            round_trip: None,
            event: None,
        }
    }

    /// Whether there is a session.
    pub fn is_up(&self) -> bool {
        self.phase == Phase::Up
    }

    /// The server calls the unit, and again until it answers. A session that there is ends.
    pub fn call(&mut self, now: Micros) {
        if self.role == Role::Unit {
            return;
        }
        self.call = self.call.wrapping_add(1);
        self.owes = Owes { hello: true, ..Owes::default() };
        self.phase = Phase::Calling { again_at: now + CALL };
    }

    /// The uplink is gone: the session ends, and nobody is called.
    pub fn uplink_lost(&mut self) {
        self.finish(EndReason::Uplink);
    }

    /// Ends the session from this side: the other one notices by its silence, or at the next call.
    pub fn end(&mut self) {
        self.finish(EndReason::Here);
    }

    /// What became of the session, once.
    pub fn poll(&mut self) -> Option<SessionEvent> {
        self.event.take()
    }

    /// Appends a message to what is to leave.
    ///
    /// # Errors
    /// There is no room for it now, or never will be, or there is no session: nothing was appended.
    pub fn send(&mut self, message: &impl Encode) -> Result<(), SessionError> {
        if !self.is_up() {
            return Err(SessionError::NoSession);
        }
        self.queue.push(message)
    }

    /// Whether another message of so many bytes, its head included, can be sent at once.
    pub fn has_room(&self, bytes: usize) -> bool {
        self.is_up() && self.queue.has_room(bytes)
    }

    /// The most bytes of a message, its head included, that the other side takes.
    pub fn longest_message(&self) -> usize {
        self.queue.limit()
    }

    /// Takes a frame. If it has messages that were not there yet, they are returned.
    ///
    /// # Errors
    /// It is no frame of this version. Nothing has changed by it, but that a unit says so of
    /// another version.
    pub fn receive<'a>(
        &mut self,
        now: Micros,
        bytes: &'a [u8],
    ) -> Result<Option<&'a [u8]>, FrameError> {
        let frame = Frame::decode(bytes);
        if matches!(frame, Err(FrameError::Version(_))) {
            self.refuse(RefuseReason::Version, 0, self.own, 0);
        }
        let frame = frame?;
        match (frame.kind, self.role) {
            (FrameKind::Hello, Role::Unit) => self.called(now, frame.payload)?,
            (FrameKind::Welcome, Role::Server) => self.welcomed(now, &frame)?,
            (FrameKind::Refuse, Role::Server) => self.refused(&frame)?,
            (FrameKind::Data, _) => return Ok(self.data(now, &frame)),
            // Our own frames, come back.
            (FrameKind::Hello, Role::Server)
            | (FrameKind::Welcome | FrameKind::Refuse, Role::Unit) => {}
        }
        Ok(None)
    }

    /// Writes the next frame that is to leave to the start of `out`, which has room for
    /// [`LONGEST`](crate::LONGEST) bytes, and returns its length.
    pub fn poll_transmit(&mut self, now: Micros, out: &mut [u8]) -> Option<usize> {
        let length = self.transmit(now, out)?.ok()?;
        self.said_at = now;
        Some(length)
    }

    /// When [`handle_timeout`](Self::handle_timeout) is due.
    pub fn poll_timeout(&self) -> Option<Micros> {
        match self.phase {
            Phase::Idle => None,
            Phase::Calling { again_at } => Some(again_at),
            Phase::Up => {
                let spoken = (self.said_at + HEARTBEAT).min(self.heard_at + SILENCE);
                [self.retry_at, self.confirmed_by].into_iter().flatten().chain([spoken]).min()
            }
        }
    }

    /// Does what is due.
    pub fn handle_timeout(&mut self, now: Micros) {
        match self.phase {
            Phase::Calling { again_at } if now >= again_at => {
                self.owes.hello = true;
                self.phase = Phase::Calling { again_at: now + CALL };
            }
            Phase::Idle | Phase::Calling { .. } => {}
            Phase::Up if now >= self.heard_at + SILENCE => self.finish(EndReason::Silence),
            Phase::Up if self.confirmed_by.is_some_and(|at| now >= at) => {
                self.finish(EndReason::Unconfirmed);
            }
            Phase::Up => {
                if self.retry_at.is_some_and(|at| now >= at) {
                    self.queue.go_back();
                    self.retry = (self.retry + self.retry).min(RETRY.1);
                    self.retry_at = None;
                }
                if now >= self.said_at + HEARTBEAT {
                    self.owes.taken = true;
                }
            }
        }
    }

    fn called(&mut self, now: Micros, payload: &[u8]) -> Result<(), FrameError> {
        let mut reader = Reader::new(payload);
        let (server, call, takes) = (Identity(reader.u64()), reader.u32(), reader.u16());
        reader.require("takes", takes >= LEAST_TAKEN);
        reader.end().map_err(FrameError::Malformed)?;
        let is_known = server == self.server && self.call != 0;
        if self.is_up() && server != self.server {
            self.refuse(RefuseReason::Busy, 0, server, call);
            return Ok(());
        }
        let is_later = !is_known || (call.wrapping_sub(self.call) as i32) > 0;
        if is_known && call == self.call && self.is_up() {
            // It has not had our answer yet.
            self.heard_at = now;
            self.owes.welcome = true;
        } else if is_later || (call == self.call && !self.is_up()) {
            (self.server, self.call) = (server, call);
            self.number = self.number.wrapping_add(1).max(1);
            self.begin(now, server, takes);
            self.owes.welcome = true;
        }
        // Else it was under way for long, and the server has called again since.
        Ok(())
    }

    fn welcomed(&mut self, now: Micros, frame: &Frame<'_>) -> Result<(), FrameError> {
        let mut reader = Reader::new(frame.payload);
        let (server, call) = (Identity(reader.u64()), reader.u32());
        let (unit, takes) = (Identity(reader.u64()), reader.u16());
        reader.require("takes", takes >= LEAST_TAKEN);
        reader.end().map_err(FrameError::Malformed)?;
        let is_calling = matches!(self.phase, Phase::Calling { .. });
        if is_calling && server == self.own && call == self.call {
            self.number = frame.session;
            self.begin(now, unit, takes);
        }
        Ok(())
    }

    fn refused(&mut self, frame: &Frame<'_>) -> Result<(), FrameError> {
        let mut reader = Reader::new(frame.payload);
        let code = reader.u8();
        let reason = RefuseReason::ALL.into_iter().find(|reason| reason.code() == code);
        let reason = reader.known("reason", reason, RefuseReason::NoSession);
        let (server, call) = (Identity(reader.u64()), reader.u32());
        reader.end().map_err(FrameError::Malformed)?;
        match (reason, self.phase) {
            (RefuseReason::NoSession, Phase::Up) if frame.session == self.number => {
                self.finish(EndReason::Unknown);
            }
            (RefuseReason::Version, Phase::Calling { .. }) => {
                self.event = Some(SessionEvent::Refused(reason));
            }
            (RefuseReason::Busy, Phase::Calling { .. })
                if server == self.own && call == self.call =>
            {
                self.event = Some(SessionEvent::Refused(reason));
            }
            // What was refused is over already.
            _ => {}
        }
        Ok(())
    }

    fn data<'a>(&mut self, now: Micros, frame: &Frame<'a>) -> Option<&'a [u8]> {
        if !self.is_up() || frame.session != self.number {
            self.refuse(RefuseReason::NoSession, frame.session, self.own, 0);
            return None;
        }
        self.heard_at = now;
        let Ok(confirmed) = self.queue.confirm(frame.taken) else {
            self.finish(EndReason::Broken);
            return None;
        };
        self.learn(now, confirmed);
        if frame.number == 0 {
            return None;
        }
        self.owes.taken = true;
        let is_next = frame.number == self.taken.wrapping_add(1);
        is_next.then(|| {
            self.taken = frame.number;
            frame.payload
        })
    }

    /// Something was confirmed: how long its round trip took is known, unless it was sent twice.
    fn learn(&mut self, now: Micros, confirmed: Option<Confirmed>) {
        let Some(Confirmed { sent_at }) = confirmed else { return };
        if let Some(sent_at) = sent_at {
            let took = now - sent_at;
            let (mean, varies) = match self.round_trip {
                None => (took, Micros(took.0 / 2)),
                Some((mean, varies)) => {
                    let apart = Micros((took - mean).0.abs());
                    (
                        Micros(mean.0 + (took.0 - mean.0) / 8),
                        Micros(varies.0 + (apart.0 - varies.0) / 4),
                    )
                }
            };
            self.round_trip = Some((mean, varies));
            self.retry = Micros(mean.0 + 4 * varies.0).clamp(RETRY.0, RETRY.1);
        }
        self.retry_at = self.queue.is_under_way().then(|| now + self.retry);
        self.confirmed_by = self.queue.is_under_way().then(|| now + CONFIRMED);
    }

    fn begin(&mut self, now: Micros, peer: Identity, takes: u16) {
        self.queue.clear(usize::from(takes));
        self.phase = Phase::Up;
        self.taken = 0;
        self.owes = Owes::default();
        (self.heard_at, self.said_at) = (now, now);
        (self.retry_at, self.retry, self.round_trip) = (None, FIRST_RETRY, None);
        self.confirmed_by = None;
        self.event = Some(SessionEvent::Began { peer });
    }

    fn finish(&mut self, reason: EndReason) {
        if self.is_up() {
            self.event = Some(SessionEvent::Ended(reason));
        }
        self.phase = Phase::Idle;
        self.owes = Owes::default();
        self.queue.clear(0);
        (self.retry_at, self.confirmed_by) = (None, None);
    }

    /// Only units refuse.
    fn refuse(&mut self, reason: RefuseReason, session: u32, server: Identity, call: u32) {
        if self.role == Role::Unit {
            self.owes.refusal = Some((reason, session, server, call));
        }
    }

    fn transmit(&mut self, now: Micros, out: &mut [u8]) -> Option<Result<usize, NoSpace>> {
        let mut scratch = [0; 32];
        if let Some((reason, session, server, call)) = self.owes.refusal.take() {
            let mut writer = Writer::new(&mut scratch);
            writer.u8(reason.code());
            writer.u64(server.0);
            writer.u32(call);
            return Some(control(FrameKind::Refuse, session, writer.written(), out));
        }
        if core::mem::take(&mut self.owes.hello) {
            let mut writer = Writer::new(&mut scratch);
            writer.u64(self.own.0);
            writer.u32(self.call);
            writer.u16(Queue::<SLOTS, BYTES>::TAKES);
            return Some(control(FrameKind::Hello, 0, writer.written(), out));
        }
        if core::mem::take(&mut self.owes.welcome) {
            let mut writer = Writer::new(&mut scratch);
            writer.u64(self.server.0);
            writer.u32(self.call);
            writer.u64(self.own.0);
            writer.u16(Queue::<SLOTS, BYTES>::TAKES);
            return Some(control(FrameKind::Welcome, self.number, writer.written(), out));
        }
        if !self.is_up() {
            return None;
        }
        let (session, taken) = (self.number, self.taken);
        let (number, payload) = match self.queue.next(now) {
            Some(next) => {
                self.retry_at.get_or_insert(now + self.retry);
                self.confirmed_by.get_or_insert(now + CONFIRMED);
                next
            }
            None if self.owes.taken => (0, &[][..]),
            None => return None,
        };
        self.owes.taken = false;
        Some(Frame { kind: FrameKind::Data, session, number, taken, payload }.encode(out))
    }
}

fn control(
    kind: FrameKind,
    session: u32,
    payload: &[u8],
    out: &mut [u8],
) -> Result<usize, NoSpace> {
    Frame { kind, session, number: 0, taken: 0, payload }.encode(out)
}
