//! A plug-in on the line to its machine.

use crate::board::{Board, FromMachine};
use crate::counters::Counters;
use crate::deliveries;
use crate::feed::Position;
use crate::host::Host;
use alloc::sync::Arc;
use softplug_abi::manifest::{ManifestError, SettingError, SettingValues};
use softplug_abi::{Failure, LineErrorKind, LineParameters, Micros};
use softplug_interpreter::{Invalid, Module, Room, Session, SessionFault};
use softplug_link::{HoldState, Link, LinkFault, LinkOptions, Taken};
use thiserror::Error;

/// Bytes that a plug-in may have waiting to be sent.
const TRANSMIT_ROOM: u32 = 2_048;
/// Characters from the machine that are taken at once.
const AT_ONCE: usize = 64;
/// Characters that the line has at a time: one leaves, one waits behind it.
const DEPTH: i64 = 2;

type Step = Result<(), LinkFault<SessionFault>>;

/// Why a plug-in is not run.
#[derive(Debug, Error)]
pub(crate) enum NotRun {
    #[error("the settings are not pairs of texts")]
    NoPairs,
    #[error("the plug-in has no manifest")]
    NoManifest,
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("the plug-in uses {bytes} bytes of memory; here are {most}")]
    Memory { bytes: u32, most: u32 },
    #[error(transparent)]
    Module(#[from] Invalid),
    #[error(transparent)]
    Start(#[from] SessionFault),
    #[error(transparent)]
    Fault(#[from] LinkFault<SessionFault>),
}

/// A plug-in that runs.
pub(crate) struct Lane<C: AsRef<[u8]>> {
    pub(crate) link: Link<Session<C>>,
    line: LineParameters,
    /// Kinds of jobs that its manifest has.
    pub(crate) job_kinds: usize,
    /// Characters that the line was given.
    given: u64,
    /// When the last of them has left.
    free_at: Micros,
    /// A break that waits until all before it has left, in µs.
    next_break: Option<u32>,
    /// Until then there is a break on the line.
    break_until: Option<Micros>,
}

/// What a plug-in is started with.
pub(crate) struct Setup {
    pub(crate) line: LineParameters,
    pub(crate) values: SettingValues,
    pub(crate) job_kinds: usize,
    pub(crate) room: Room,
}

impl<C: AsRef<[u8]>> Lane<C> {
    /// Starts a plug-in and opens its link.
    pub(crate) fn open(
        code: C,
        setup: Setup,
        now: Micros,
        host: &mut Host,
    ) -> Result<Self, NotRun> {
        let module = Module::load(code)?;
        let session = Session::start(Arc::new(module), setup.room)?;
        let options = LinkOptions {
            line: setup.line,
            transmit_room: TRANSMIT_ROOM,
            delivery_room: deliveries::ROOM,
            modem_lines: None,
            settings: setup.values,
        };
        let mut link = Link::new(session, options);
        link.open(now, host)?;
        Ok(Self {
            link,
            line: setup.line,
            job_kinds: setup.job_kinds,
            given: 0,
            free_at: now,
            next_break: None,
            break_until: None,
        })
    }

    /// One round: what came, what is due, what may leave.
    pub(crate) fn turn<B: Board<Code = C>>(
        &mut self,
        board: &mut B,
        host: &mut Host,
        counters: &mut Counters,
    ) -> Step {
        let now = board.now();
        self.hear(board, now, host, counters)?;
        self.tell_left(now);
        self.link.handle_timeout(now, host)?;
        for request in core::mem::take(&mut host.refused) {
            self.link.answer(now, request, Err(Failure::TooLong), host)?;
        }
        self.send(board, now, host, counters)?;
        counters.holds.set(now, self.link.hold() == HoldState::Held);
        let is_starved = host.feed.is_hungry()
            && !host.feed.is_supplied()
            && self.link.hold() == HoldState::Free
            && !self.link.has_to_send()
            && self.under_way(now) == 0;
        counters.starved.set(now, is_starved);
        Ok(())
    }

    fn hear<B: Board<Code = C>>(
        &mut self,
        board: &mut B,
        now: Micros,
        host: &mut Host,
        counters: &mut Counters,
    ) -> Step {
        let mut bytes = [0; AT_ONCE];
        let mut count = 0;
        let mut lost = false;
        while count < AT_ONCE && !lost {
            match board.hear_machine() {
                Some(FromMachine::Byte(byte)) => {
                    bytes[count] = byte;
                    count += 1;
                }
                Some(FromMachine::Overrun) => lost = true,
                None => break,
            }
        }
        if count > 0 {
            counters.bytes_in += count as u64;
            self.link.received(now, &bytes[..count], host)?;
        }
        if lost {
            counters.line_errors += 1;
            self.link.line_error(now, LineErrorKind::Overrun, None, 0, host)?;
        }
        Ok(())
    }

    fn send<B: Board<Code = C>>(
        &mut self,
        board: &mut B,
        now: Micros,
        host: &mut Host,
        counters: &mut Counters,
    ) -> Step {
        if self.break_until.is_some_and(|until| now < until) {
            return Ok(());
        }
        if self.break_until.take().is_some() {
            board.set_break(false);
        }
        // It comes alone, when all before it has left.
        if self.next_break.is_some() && self.under_way(now) > 0 {
            return Ok(());
        }
        if let Some(micros) = self.next_break.take() {
            board.set_break(true);
            self.free_at = now + Micros(i64::from(micros));
            self.break_until = Some(self.free_at);
            return Ok(());
        }
        while self.under_way(now) < DEPTH && self.link.has_to_send() && board.machine_takes() {
            let mut byte = [0];
            match self.link.take(&mut byte) {
                Taken::Bytes(_) => {
                    board.tell_machine(byte[0]);
                    self.given += 1;
                    self.free_at = self.free_at.max(now) + self.line.characters(1);
                    counters.bytes_out += 1;
                }
                Taken::Break(micros) => {
                    self.next_break = Some(micros);
                    return Ok(());
                }
                Taken::Nothing => return Ok(()),
            }
            self.tell_left(now);
            if self.link.has_reports() {
                self.link.handle_timeout(now, host)?;
            }
        }
        Ok(())
    }

    /// Characters that are still to leave.
    fn under_way(&self, now: Micros) -> i64 {
        let left = (self.free_at - now).0.max(0);
        let character = self.line.characters(1).0.max(1);
        (left + character - 1) / character
    }

    fn tell_left(&mut self, now: Micros) {
        let (maybe, surely) = (self.given, self.surely(now));
        self.link.left(maybe, surely);
    }

    fn surely(&self, now: Micros) -> u64 {
        self.given - (self.under_way(now) as u64).min(self.given)
    }

    /// How far the job is that is under way, or that has just ended.
    pub(crate) fn position(&self, now: Micros, counters: &Counters) -> Position {
        Position {
            maybe: self.given,
            surely: self.surely(now),
            waiting: self.link.waiting() as u64,
            bytes_maybe: self.link.job_bytes_within(self.link.characters()),
            is_held: counters.holds.is_so(),
            is_starved: counters.starved.is_so(),
        }
    }

    /// Characters that the line was given so far: a job begins behind them.
    pub(crate) fn given(&self) -> u64 {
        self.given
    }
}
