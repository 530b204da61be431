//! The unit: it hears its server and its machine, and passes on what each has to know.

use crate::board::Board;
use crate::counters::Counters;
use crate::feed::Position;
use crate::frames::Frames;
use crate::host::Host;
use crate::lane::Lane;
use crate::memory::Memory;
use crate::outbox::{FRAMES, PAYLOAD_BYTES};
use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use softplug_abi::{Failure, JobId, Micros};
use softplug_interpreter::{Room, SessionFault};
use softplug_link::{Job, LinkFault};
use softplug_unit_protocol::{
    CreditError, Digest, HEADER, Identity, Messages, Role, Session, SessionEvent, TRAILER,
    ToServer, ToUnit,
};
use softplug_unit_slots::Trust;

/// The longest answer to a request, in bytes.
const LONGEST_ANSWER: usize = 4_096;

/// How a unit is set up.
#[derive(Copy, Clone, Debug)]
pub struct Options {
    /// Its name: letters, digits, `-`, `_` and `.`.
    pub name: &'static str,
    /// The link's name, likewise.
    pub link: &'static str,
    /// A number that stays the same.
    pub serial: u64,
    /// A number that is new at each start.
    pub identity: u64,
    /// The rate of the line, in bits a second. The characters are as the plug-in names them, else 8N1.
    pub baud: u32,
    /// Whose plug-ins it takes.
    pub trust: Trust<'static>,
    /// Erasures of a slot after which it takes no further plug-in.
    pub most_erases: u32,
    /// What there is for a plug-in to run in. One that says how much memory it uses has so much, and is refused where
    /// that is more; any other one has all of this.
    pub room: Room,
}

/// A front-end unit with one link.
///
/// `tests/unit/shop.rs` has one on a board in memory, with a server at its uplink.
pub struct Unit<B: Board> {
    pub(crate) board: B,
    pub(crate) options: Options,
    pub(crate) memory: Memory<B::Flash>,
    session: Box<Session<FRAMES, PAYLOAD_BYTES>>,
    frames: Option<Frames>,
    /// A frame that is on its way out, and how much of it has left.
    leaving: (Box<[u8]>, usize, usize),
    /// The server has asked what there is, in this session.
    is_asked: bool,
    pub(crate) host: Host,
    pub(crate) lane: Option<Lane<B::Code>>,
    /// The plug-in that runs, or that has ended by a fault.
    pub(crate) running: Option<Digest>,
    /// As they came; they are the defaults after a start.
    pub(crate) settings: Vec<u8>,
    pub(crate) is_on_trial: bool,
    pub(crate) fault: Option<String>,
    /// An answer that is not whole yet: to which request, and what has come of it.
    pub(crate) answer: Option<(u32, Vec<u8>)>,
    pub(crate) counters: Counters,
    pub(crate) counted: Option<Counters>,
}

impl<B: Board> Unit<B> {
    /// Looks at what is in the slots, and runs what is to run.
    ///
    /// # Errors
    /// The flash cannot be used as two slots.
    pub fn start(
        board: B,
        flash: B::Flash,
        options: Options,
    ) -> Result<Self, softplug_unit_slots::Error<<B::Flash as softplug_unit_slots::Device>::Error>>
    {
        let memory = Memory::open(flash, options.trust, options.most_erases)?;
        let leaving = alloc::vec![0; HEADER + PAYLOAD_BYTES + TRAILER].into();
        let mut unit = Self {
            board,
            options,
            memory,
            session: session(options.identity),
            frames: Some(Frames::new(PAYLOAD_BYTES)),
            leaving: (leaving, 0, 0),
            is_asked: false,
            host: Host::new(),
            lane: None,
            running: None,
            settings: Vec::new(),
            is_on_trial: false,
            fault: None,
            answer: None,
            counters: Counters::default(),
            counted: None,
        };
        if let Some(bootable) = unit.memory.boot() {
            unit.run(bootable, Vec::new());
        }
        Ok(unit)
    }

    /// The board, to look at.
    pub fn board(&self) -> &B {
        &self.board
    }

    /// The board.
    pub fn board_mut(&mut self) -> &mut B {
        &mut self.board
    }

    /// One round. To be called when something has come, and a few times in the time of a character of the line
    /// at least: timers are kept no better than that.
    pub fn turn(&mut self) {
        self.hear_uplink();
        let now = self.board.now();
        self.session.handle_timeout(now);
        self.session_news();
        self.drive();
        self.speak();
    }

    fn hear_uplink(&mut self) {
        // What waits to be told must not grow without end: the rest is heard when some has left.
        let Some(mut frames) = self.frames.take() else { return };
        while !self.host.outbox.is_busy()
            && let Some(byte) = self.board.hear_uplink_byte()
        {
            let mut whole = frames.take(byte);
            while let Some(length) = whole {
                self.hear_frame(frames.frame(length));
                whole = frames.next(length);
            }
        }
        self.frames = Some(frames);
    }

    fn hear_frame(&mut self, frame: &[u8]) {
        let now = self.board.now();
        let payload = self.session.receive(now, frame).ok().flatten();
        // A session that has begun with this frame, or ended, comes before its messages.
        self.session_news();
        for message in Messages::<ToUnit<'_>>::new(payload.unwrap_or_default()) {
            match message {
                Ok(message) if !self.host.outbox.is_flooded() => self.hear(&message),
                // Nothing of it can be relied on any more, or it asks and takes nothing.
                Ok(_) | Err(_) => {
                    self.session.end();
                    self.session_news();
                    return;
                }
            }
        }
    }

    fn session_news(&mut self) {
        match self.session.poll() {
            Some(SessionEvent::Began { .. } | SessionEvent::Ended(_)) => {
                self.is_asked = false;
                self.host.outbox.begin_anew(false);
            }
            Some(SessionEvent::Refused(_)) | None => {}
        }
    }

    fn speak(&mut self) {
        self.host.outbox.pump(&mut self.session);
        if self.session.is_up() && self.is_asked && self.host.outbox.is_empty() {
            let longest = self.session.longest_message();
            let session = &mut self.session;
            self.host.deliveries.pump(longest, |message| session.send(message).is_ok());
        }
        let now = self.board.now();
        loop {
            let (frame, at, end) = &mut self.leaving;
            while at < end {
                if !self.board.tell_uplink_byte(frame[*at]) {
                    return;
                }
                *at += 1;
            }
            (*at, *end) = (0, 0);
            match self.session.poll_transmit(now, frame) {
                Some(length) => *end = length,
                None => return,
            }
            self.host.outbox.pump(&mut self.session);
        }
    }

    fn hear(&mut self, message: &ToUnit<'_>) {
        let Some(link) = message.link() else {
            self.is_asked = true;
            self.host.outbox.is_up = true;
            self.tell_all();
            return;
        };
        if link != 0 {
            let (message, why) = (message.kind(), "there is no such link");
            self.host.outbox.say(&ToServer::Refused { message, link, job: 0, why });
            return;
        }
        match *message {
            ToUnit::Download { length, digest, signature, .. } => {
                let begun = self.memory.begin(length, digest, signature);
                self.tell_download(begun);
            }
            ToUnit::Piece { at, bytes, .. } => {
                let until = self.memory.piece(at, bytes);
                self.tell_download(until);
            }
            ToUnit::Install { .. } => {
                let installed = self.memory.install();
                self.tell_download(installed);
            }
            ToUnit::Open { digest, settings, .. } => self.open(digest, settings),
            ToUnit::Close { .. } => self.close(),
            ToUnit::Swap { digest, settings, .. } => self.swap(digest, settings),
            // A query has been answered above, and no swap ever waits here.
            ToUnit::Query {} | ToUnit::CancelSwap { .. } => {}
            ToUnit::Reopen { .. } => {
                self.ask(|lane, now, host| {
                    lane.link.close(now, host)?;
                    lane.link.open(now, host)
                });
                if self.lane.is_some() {
                    self.host.outbox.say(&ToServer::Up { link });
                }
            }
            ToUnit::Halt { why, .. } => {
                if self.lane.is_some() {
                    self.end_lane(why.to_owned());
                }
            }
            ToUnit::ForceResume { .. } => {
                self.ask(|lane, now, host| lane.link.force_resume(now, host));
            }
            ToUnit::Answer { request, refused, is_last, bytes, .. } => {
                self.answer(request, refused, is_last, bytes);
            }
            ToUnit::Stored { delivery, until, is_whole, .. } => {
                self.host.deliveries.stored(delivery, until, is_whole);
            }
            ToUnit::Begin { job, kind, size, check, fields, .. } => {
                self.begin(job, kind, size, check, fields);
            }
            ToUnit::Data { job, pass, at, bytes, .. } => {
                let fed = self.host.feed.data(job, pass, at, bytes);
                self.fed(message.kind(), job, fed);
            }
            ToUnit::End { job, pass, size, .. } => {
                let fed = self.host.feed.end(job, pass, size);
                self.fed(message.kind(), job, fed);
            }
            ToUnit::Fail { job, .. } => {
                if self.host.feed.fail(job) {
                    self.abort(job);
                }
            }
            ToUnit::Pause { job, .. } => {
                self.ask_of_job(job, |lane, now, job, host| lane.link.pause(now, JobId(job), host));
            }
            ToUnit::Resume { job, .. } => {
                self.ask_of_job(job, |lane, now, job, host| {
                    lane.link.resume(now, JobId(job), host)
                });
            }
            ToUnit::Abort { job: 0, .. } => {
                self.ask(|lane, now, host| lane.link.abort(now, JobId::NONE, host));
            }
            ToUnit::Abort { job, .. } => self.abort(job),
            ToUnit::Noted { job, .. } => self.host.feed.noted(job),
        }
    }

    /// Asks the plug-in for something, if one runs.
    pub(crate) fn ask(
        &mut self,
        act: impl FnOnce(&mut Lane<B::Code>, Micros, &mut Host) -> Result<(), LinkFault<SessionFault>>,
    ) {
        let now = self.board.now();
        let Some(lane) = &mut self.lane else { return };
        let asked = act(lane, now, &mut self.host);
        self.settle(asked);
    }

    fn ask_of_job(
        &mut self,
        job: u64,
        act: impl FnOnce(
            &mut Lane<B::Code>,
            Micros,
            u32,
            &mut Host,
        ) -> Result<(), LinkFault<SessionFault>>,
    ) {
        if let Some(active) = self.host.feed.under_way(job) {
            let of_link = active.of_link;
            self.ask(|lane, now, host| act(lane, now, of_link.0, host));
        }
    }

    fn abort(&mut self, job: u64) {
        self.ask_of_job(job, |lane, now, job, host| lane.link.abort(now, JobId(job), host));
    }

    fn drive(&mut self) {
        if let Some(lane) = &mut self.lane {
            let turned = lane.turn(&mut self.board, &mut self.host, &mut self.counters);
            self.settle(turned);
        }
        self.host.feed.give(false, &mut self.host.outbox);
        if let Some(lane) = &self.lane {
            let now = self.board.now();
            let position = lane.position(now, &self.counters);
            self.host.feed.progress(now, position, &mut self.host.outbox);
        }
        // Not before its answers.
        let (job, ..) = self.host.feed.received();
        if job != 0 && !self.host.deliveries.answer(job) {
            self.host.feed.tell_end(&mut self.host.outbox);
        }
        self.count();
    }

    /// What the plug-in did last: its job may have ended, or it has.
    fn settle(&mut self, did: Result<(), LinkFault<SessionFault>>) {
        let has_flooded = core::mem::take(&mut self.host.has_flooded);
        match did {
            Ok(()) if !has_flooded => self.conclude(),
            Ok(()) => self.fail("it begins more deliveries than can be put away".to_owned()),
            Err(fault) => self.fail(fault.to_string()),
        }
    }

    pub(crate) fn position(&mut self) -> Position {
        let now = self.board.now();
        self.lane.as_ref().map(|lane| lane.position(now, &self.counters)).unwrap_or_default()
    }

    pub(crate) fn conclude(&mut self) {
        let active = self.host.feed.active.as_mut();
        if let Some(ending) = active.and_then(|active| active.ending.take()) {
            let position = self.position();
            self.host.feed.conclude(ending, position);
        }
    }

    fn begin(&mut self, job: u64, kind: u16, size: u64, check: bool, fields: &[u8]) {
        let (there, ..) = self.host.feed.received();
        if job != 0 && there == job {
            self.host.feed.tell_all(&mut self.host.outbox);
            return;
        }
        let refused = match &self.lane {
            _ if job == 0 => "a job's number is never 0",
            _ if there != 0 => "another job is there",
            None => "no plug-in runs",
            Some(lane) if usize::from(kind) >= lane.job_kinds => {
                "the plug-in has no job of this kind"
            }
            Some(lane) => {
                let id = self.host.feed.begin(job, lane.given());
                let size = (size != u64::MAX).then_some(size);
                let begun = Job { id: JobId(id), kind, size, fields: fields.to_vec(), check };
                self.ask(|lane, now, host| lane.link.begin_job(now, begun, host));
                self.host.feed.give(true, &mut self.host.outbox);
                return;
            }
        };
        self.refuse(ToUnit::BEGIN, job, refused);
    }

    /// Data that does not fit together is refused once, and its job aborted.
    fn fed(&mut self, message: u8, job: u64, fed: Option<Result<(), CreditError>>) {
        let Some(Err(error)) = fed else { return };
        if let Some(active) = self.host.feed.under_way(job) {
            active.is_broken = true;
        }
        self.refuse(message, job, &error.to_string());
        self.abort(job);
    }

    fn answer(&mut self, number: u32, refused: Option<Failure>, is_last: bool, bytes: &[u8]) {
        // One that was withdrawn meanwhile is not asked for any more.
        let Some(at) = self.host.requests.iter().position(|asked| asked.number == number) else {
            return;
        };
        let mut so_far = match self.answer.take() {
            Some((of, so_far)) if of == number => so_far,
            _ => Vec::new(),
        };
        let is_too_long = so_far.len() + bytes.len() > LONGEST_ANSWER;
        if !is_too_long {
            so_far.extend_from_slice(bytes);
            if !is_last && refused.is_none() {
                self.answer = Some((number, so_far));
                return;
            }
        }
        let of_link = self.host.requests.remove(at).of_link;
        let refused = refused.or(is_too_long.then_some(Failure::TooLong));
        let answer = refused.map_or(Ok(&so_far[..]), Err);
        self.ask(|lane, now, host| lane.link.answer(now, of_link, answer, host));
    }
}

/// It has its frames in it, and is made on the stack: in a call of its own, so that this is free again.
#[inline(never)]
fn session(identity: u64) -> Box<Session<FRAMES, PAYLOAD_BYTES>> {
    Box::new(Session::new(Role::Unit, Identity(identity)))
}
