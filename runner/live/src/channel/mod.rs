//! A channel: one port, one plug-in, and what lies between them: pacing, what
//! has left, breaks, modem lines, counters. It never waits and has no thread.

mod counters;
mod departures;
mod listening;
mod sending;
mod tap;

pub use counters::Counters;
pub use departures::{Left, Place};

use departures::Departures;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Instance, LineParameters, LinkDownReason, Micros, ModemLines};
use softplug_link::{Link, LinkFault, LinkHost, LinkOptions, Taken};
use std::error::Error;
use tap::Tap;
use thiserror::Error;

use crate::clock::Clock;
use crate::due::Due;
use crate::error::PortError;
use crate::pacer::{Pacer, default_depth};
use crate::port::{Input, Port};

/// Most reads and writes of one turn: then others have their say.
const ROUNDS: usize = 16;
/// Longest turn: then others have their say.
const TURN: Micros = Micros(500);
/// Most bytes that are taken from the link at once.
const CHUNK: usize = 64;
/// When to look again whether the port has sent what it should have.
const LOOK_AGAIN: Micros = Micros::from_millis(1);
/// When to look again where somebody else's buffer lies between, which may be held for hours.
const LOOK_AGAIN_FAR: Micros = Micros::from_millis(20);
/// How much later a line that is still busy may be given more, so that many are
/// given theirs together.
const GATHER: Micros = Micros::from_millis(1);
/// How often modem lines are looked at.
const MODEM_LINES_EVERY: Micros = Micros::from_millis(20);

/// What a channel is made with.
#[derive(Clone, Debug)]
pub struct StationOptions {
    /// A value for every setting of the plug-in.
    pub settings: SettingValues,
    /// Characters that may be in flight; by baud if `None`.
    pub depth: Option<u32>,
    /// Bytes that the transmit queue takes.
    pub transmit_room: u32,
    /// Bytes of deliveries that may wait to be put away; 0: none is taken, and a partner whose
    /// protocol has a way to be refused is.
    pub delivery_room: u32,
}

impl Default for StationOptions {
    /// No settings, depth by baud, 4,096 bytes to transmit, 16,384 to deliver.
    fn default() -> Self {
        Self {
            settings: SettingValues::default(),
            depth: None,
            transmit_room: 4_096,
            delivery_room: 16_384,
        }
    }
}

/// Why a channel cannot go on.
#[derive(Debug, Error)]
pub enum ChannelError<F: Error + 'static> {
    /// The port, or the system below it.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The plug-in has ended.
    #[error(transparent)]
    Plugin(#[from] LinkFault<F>),
}

/// What a channel needs from around it: what the link needs, and somebody who
/// looks at what passes on the line.
pub trait ChannelHost: LinkHost {
    /// The port heard this.
    fn heard(&mut self, now: Micros, input: &Input<'_>) {
        let _ = (now, input);
    }

    /// The port took these bytes.
    fn wrote(&mut self, now: Micros, bytes: &[u8]) {
        let _ = (now, bytes);
    }

    /// Whether nothing may leave for now, whatever the plug-in has said.
    fn keeps_back(&self) -> bool {
        false
    }

    /// The port's modem lines are these now: which it has, and those that are on.
    fn modem_lines(&mut self, now: Micros, known: ModemLines, on: ModemLines) {
        let _ = (now, known, on);
    }
}

/// How far [`Channel::work`] came.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Work {
    /// There is nothing to do before something of [`Channel::wants`] comes.
    Done,
    /// There is more to do at once; others first.
    More,
}

/// What a channel waits for. A hang-up is always to be told.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Wants {
    /// Bytes to read.
    pub read: bool,
    /// Room to write: the port was full.
    pub write: bool,
    /// A time, on the clock that [`Channel::work`] is given.
    pub deadline: Option<Micros>,
    /// When the line takes more of what waits; [`Channel::write_on`] is enough then.
    pub write_on: Option<Due>,
}

/// One port with a plug-in on it. The port may be lost and come back.
///
/// [`work`](Self::work) reads, delivers what is due and writes what may leave,
/// without waiting. Requests of the host go through [`ask`](Self::ask).
#[derive(Debug)]
pub struct Channel<I: Instance> {
    port: Option<Port>,
    link: Link<I>,
    pacer: Pacer,
    departures: Departures,
    /// Given out by the link, not yet taken by the port.
    pending: [u8; CHUNK],
    pending_from: usize,
    pending_to: usize,
    /// Bytes given out by the link that no port will be given.
    never_given: u64,
    /// A break to send as soon as nothing is in flight, and one under way.
    break_next: Option<u32>,
    break_until: Option<Micros>,
    modem_lines: Option<(ModemLines, ModemLines)>,
    /// When modem lines are looked at next.
    modem_lines_at: Micros,
    counters: Counters,
    /// The port may have something to read.
    readable: bool,
    gone: Option<LinkDownReason>,
    depth: Option<u32>,
    /// There is room for deliveries, now or later.
    takes_deliveries: bool,
    /// What the port still holds belongs to a job that is over.
    is_calling_back: bool,
    /// The partner has stopped the line below us: when to look again.
    stopped_until: Option<Micros>,
}

impl<I: Instance> Channel<I> {
    /// A channel whose link is not open yet.
    pub fn new(port: Port, instance: I, options: StationOptions) -> Self {
        let line = port.line();
        let modem_lines = port.modem_lines();
        let link = Link::new(
            instance,
            LinkOptions {
                line,
                transmit_room: options.transmit_room,
                delivery_room: options.delivery_room,
                modem_lines,
                settings: options.settings,
            },
        );
        let departures = Departures::new(&port);
        Self {
            pacer: pacer(line, options.depth),
            port: Some(port),
            link,
            departures,
            pending: [0; CHUNK],
            pending_from: 0,
            pending_to: 0,
            never_given: 0,
            break_next: None,
            break_until: None,
            modem_lines,
            modem_lines_at: Micros::ZERO,
            counters: Counters::default(),
            readable: true,
            gone: None,
            depth: options.depth,
            takes_deliveries: options.delivery_room > 0,
            is_calling_back: false,
            stopped_until: None,
        }
    }

    /// The port, unless it has been taken away.
    pub fn port(&self) -> Option<&Port> {
        self.port.as_ref()
    }

    /// The plug-in's link.
    pub fn link(&self) -> &Link<I> {
        &self.link
    }

    pub(crate) fn link_mut(&mut self) -> &mut Link<I> {
        &mut self.link
    }

    /// What has been counted up to `now`.
    pub fn counters(&self, now: Micros) -> Counters {
        self.counters.at(now)
    }

    /// The host pauses the job, to be said before the plug-in is asked to; or no longer, to be
    /// said after it: a pause is not counted as a hold of the partner's.
    pub fn count_pause(&mut self, now: Micros, is_paused: bool) {
        self.counters.pause(now, is_paused);
    }

    /// Why the port is gone, if it is.
    pub fn gone(&self) -> Option<LinkDownReason> {
        self.gone
    }

    /// The characters in flight at most.
    pub fn depth(&self) -> u32 {
        self.pacer.depth()
    }

    /// The port may have something to read: the channel looks until it finds
    /// nothing more.
    pub fn set_readable(&mut self) {
        self.readable = true;
    }

    /// A request of the host: whatever `act` does with the link, with what it
    /// sets on the port. It comes before a timer whose time is over and that has
    /// not run out, because what may stop that is perhaps not read yet.
    pub fn ask<R>(
        &mut self,
        now: Micros,
        host: &mut dyn ChannelHost,
        act: impl FnOnce(&mut Link<I>, Micros, &mut dyn LinkHost) -> R,
    ) -> Result<R, PortError> {
        self.ask_at(self.before_timers(now), host, act)
    }

    fn ask_at<R>(
        &mut self,
        now: Micros,
        host: &mut dyn ChannelHost,
        act: impl FnOnce(&mut Link<I>, Micros, &mut dyn LinkHost) -> R,
    ) -> Result<R, PortError> {
        let mut tap = Tap::new(host, &mut self.counters, &self.pacer);
        let asked = act(&mut self.link, now, &mut tap);
        let (lines, has_failed) = (tap.modem_lines, tap.has_failed);
        self.set_modem_lines(lines)?;
        self.calls_back(has_failed);
        Ok(asked)
    }

    /// Gives the settings to the plug-in and opens the link.
    pub fn open(
        &mut self,
        now: Micros,
        host: &mut dyn ChannelHost,
    ) -> Result<(), ChannelError<I::Fault>> {
        Ok(self.ask(now, host, |link, now, host| link.open(now, host))??)
    }

    /// What can be done without waiting, up to a bound. Reads before each write: a
    /// stop that is already there must stop the next byte. One read before each
    /// write, too: a partner that never pauses must not keep our own stop from
    /// leaving.
    pub fn work(
        &mut self,
        clock: Clock,
        host: &mut dyn ChannelHost,
    ) -> Result<Work, ChannelError<I::Fault>> {
        let until = clock.now() + TURN;
        self.attend_port(clock.now(), host)?;
        for _ in 0..ROUNDS {
            let now = self.take_in(clock, host)?;
            self.look_at_modem_lines(clock, host)?;
            self.note_departures(now);
            self.ask_at(now, host, |link, now, host| link.handle_timeout(now, host))??;
            let has_sent = self.gone.is_none() && self.send_some(clock.now(), clock, host)?;
            let now = clock.now();
            let goes_on = self.may_read() || (has_sent && self.may_go_on(now));
            if !goes_on {
                return Ok(Work::Done);
            }
            if now > until {
                break;
            }
        }
        Ok(Work::More)
    }

    /// What to wait for, after [`Work::Done`].
    pub fn wants(&self, now: Micros) -> Wants {
        if self.gone.is_some() || self.link.has_ended() {
            return Wants { deadline: self.link.poll_timeout(), ..Wants::default() };
        }
        let is_stuck = self.is_stuck(now);
        let port = self.port.as_ref();
        let is_suspended = port.is_some_and(Port::is_suspended);
        let has_output = port.is_some_and(Port::has_output);
        let deadlines = [
            self.link.poll_timeout(),
            self.next_departure(now),
            self.is_calling_back.then_some(now + LOOK_AGAIN),
            self.break_until,
            self.break_next.is_some().then_some(now + LOOK_AGAIN),
            self.looks_for_modem_lines().then_some(self.modem_lines_at),
            port.and_then(Port::poll_timeout),
        ];
        Wants {
            read: self.readable_bytes() > 0,
            write: (is_stuck && !is_suspended) || has_output,
            deadline: deadlines.into_iter().flatten().min(),
            write_on: self.wants_to_send(is_stuck).then(|| self.next_write(now)),
        }
    }

    fn next_write(&self, now: Micros) -> Due {
        let waiting = self.link.waiting();
        let at = self.pacer.next(now, waiting).max(self.stopped_until.unwrap_or(now));
        Due { at, by: at + self.pacer.patience(waiting).min(GATHER) }
    }

    /// A port that still holds what should have left by now is looked at again.
    fn next_departure(&self, now: Micros) -> Option<Micros> {
        if !self.link.awaits_departures() {
            return None;
        }
        if self.departures.has_news() {
            return Some(now);
        }
        let next = self.departures.poll_timeout()?;
        let keeps_rate = self.port.as_ref().is_some_and(Port::rate_known);
        let again = if keeps_rate { LOOK_AGAIN } else { LOOK_AGAIN_FAR };
        Some(if next > now { next } else { now + again })
    }

    /// Whether something is still to leave.
    pub fn is_sending(&self, now: Micros) -> bool {
        let unsent = || self.port.as_ref().is_some_and(|port| port.unsent() > 0);
        self.gone.is_none()
            && (self.is_calling_back
                || self.link.has_to_send()
                || self.pending_from < self.pending_to
                || self.pacer.in_flight(now) > 0
                || unsent())
    }

    /// Whether all that was ever given out has surely left.
    pub(crate) fn is_drained(&mut self, now: Micros) -> bool {
        !self.is_sending(now) && self.departures.place_surely(now) >= self.link.characters()
    }

    /// Whether something is still to leave, or the link is still to hear what has left: a job may
    /// end with that.
    pub fn is_settling(&self, now: Micros) -> bool {
        self.is_sending(now) || (self.gone.is_none() && self.link.awaits_departures())
    }

    /// How much the port was given so far: a job begins behind it.
    pub fn place(&self) -> Place {
        self.departures.place()
    }

    /// What has left of all that the port was given behind `from`, by asking the
    /// port. See [`Left`] for what the figures mean.
    pub fn left(&mut self, now: Micros, from: Place) -> Left {
        self.look(now);
        self.departures.left(now, from)
    }

    /// Bytes of the latest job's data of which some may have left or may leave yet, now that it
    /// is over.
    pub fn job_may_have_left(&mut self, now: Micros) -> u64 {
        // What a port has that is lost is no more than it had when it last told.
        let lost = self.gone.map(|_| self.departures.place_maybe(now));
        let place = lost.unwrap_or(u64::MAX).min(self.link.characters());
        self.link.job_bytes_within(place)
    }

    /// [`left`](Self::left), without asking a port that was asked a moment ago.
    pub(crate) fn left_lately(&mut self, now: Micros, from: Place) -> Left {
        if now >= self.departures.looked_at() + LOOK_AGAIN_FAR {
            self.look(now);
        }
        self.departures.left(now, from)
    }

    /// Asks the port what it still holds.
    fn look(&mut self, now: Micros) {
        if let Some(port) = self.port.as_ref().filter(|_| self.gone.is_none()) {
            self.departures.looked(now, port.backlog());
        }
    }

    /// The port is lost, or taken away by the host: the plug-in is told. What
    /// the port had taken and not sent is lost with it.
    pub fn lose(
        &mut self,
        now: Micros,
        reason: LinkDownReason,
        host: &mut dyn ChannelHost,
    ) -> Result<(), ChannelError<I::Fault>> {
        self.gone = Some(reason);
        self.drop_pending();
        (self.break_next, self.break_until) = (None, None);
        (self.is_calling_back, self.stopped_until) = (false, None);
        let now = listening::input_time(&self.link, now);
        if self.link.awaits_departures() {
            // It cannot be asked any more: what it said last bounds it.
            let (maybe, surely) = self.departures.places(now);
            self.link.left(maybe, surely);
        }
        self.ask(now, host, |link, now, host| {
            link.link_down(now, reason, host)?;
            link.handle_timeout(now, host)
        })??;
        Ok(())
    }

    /// When to look again whether all that the port took has left.
    pub(crate) fn next_look_at_the_line(&self, now: Micros) -> Option<Micros> {
        if self.link.has_to_send() || self.pending_from < self.pending_to {
            return None;
        }
        let free = self.pacer.free_at();
        let holds = || self.port.as_ref().is_some_and(|port| port.unsent() > 0);
        if free > now { Some(free) } else { holds().then_some(now + LOOK_AGAIN) }
    }

    /// Puts another plug-in in the place of one that has ended. What that one had
    /// to send is dropped.
    pub(crate) fn replace(
        &mut self,
        now: Micros,
        instance: I,
        settings: SettingValues,
        host: &mut dyn ChannelHost,
    ) -> Result<I, ChannelError<I::Fault>> {
        self.drop_pending();
        if self.gone.is_none() && self.never_given > 0 {
            self.pass_over_never_given();
            self.departures.lost(now);
        }
        self.readable = true;
        self.calls_back(true);
        // What the one before held, nobody will let go.
        self.counters.pause(now, false);
        self.counters.release(now);
        Ok(self.ask(now, host, |link, now, host| link.replace(now, instance, settings, host))??)
    }

    fn put_port(&mut self, now: Micros, port: Port) {
        self.pacer = pacer(port.line(), self.depth);
        self.pass_over_never_given();
        self.departures.begin_anew(&port, now);
        self.modem_lines = port.modem_lines();
        self.port = Some(port);
        self.gone = None;
        self.readable = true;
    }

    /// What the link gave out and no port took is not sent any more.
    fn drop_pending(&mut self) {
        self.never_given += (self.pending_to - self.pending_from) as u64;
        (self.pending_from, self.pending_to) = (0, 0);
    }

    /// What the plug-in has said and the port was not given is not sent any more, unless it is held:
    /// that waits as before.
    pub(crate) fn drop_unsent(&mut self, now: Micros) {
        self.drop_pending();
        self.break_next = None;
        loop {
            match self.link.take(&mut self.pending) {
                Taken::Nothing => break,
                Taken::Bytes(count) => self.never_given += count as u64,
                Taken::Break(_) => {}
            }
        }
        if self.gone.is_none() && self.never_given > 0 {
            self.pass_over_never_given();
            self.departures.lost(now);
        }
    }

    /// The link counts what it gave out: places go on behind it, else what follows would never
    /// count as left.
    fn pass_over_never_given(&mut self) {
        self.departures.pass_over_never_given(std::mem::take(&mut self.never_given));
    }

    /// Takes the port out, to be closed where closing may take its time.
    pub fn detach(&mut self) -> Option<Port> {
        self.port.take()
    }

    /// The port is back: the plug-in is told. Whatever the old port was given
    /// counts as left from here on; the plug-in knows that the port was lost.
    pub fn attach(
        &mut self,
        port: Port,
        now: Micros,
        host: &mut dyn ChannelHost,
    ) -> Result<(), ChannelError<I::Fault>> {
        self.put_port(now, port);
        let lines = self.modem_lines;
        self.ask(now, host, |link, now, host| {
            // Also where the plug-in has ended: its successor finds the port back.
            let up = link.link_up(now, host);
            let told = lines.map_or(Ok(()), |(known, on)| link.modem_lines(now, known, on, host));
            up.and(told)?;
            link.handle_timeout(now, host)
        })??;
        Ok(())
    }

    /// Whether there is more to do for what has just been sent.
    fn may_go_on(&self, now: Micros) -> bool {
        self.link.has_reports() || self.break_next.is_some() || self.may_send(now)
    }

    fn note_departures(&mut self, now: Micros) {
        if self.link.awaits_departures() {
            self.look(now);
            let (maybe, surely) = self.departures.places(now);
            self.link.left(maybe, surely);
        }
    }

    /// The port's own business: probing the other side, what it has to answer.
    fn attend_port(
        &mut self,
        now: Micros,
        host: &mut dyn ChannelHost,
    ) -> Result<(), ChannelError<I::Fault>> {
        let Some(port) = self.port.as_mut().filter(|_| self.gone.is_none()) else {
            return Ok(());
        };
        if !port.has_output() && port.poll_timeout().is_none_or(|at| at > now) {
            return Ok(());
        }
        self.readable = true;
        match port.handle_timeout(now) {
            Err(PortError::Gone(reason)) => self.lose(now, reason, host),
            attended => Ok(attended?),
        }
    }

    /// Holds the line low, or no longer; nothing on a port that cannot.
    pub(crate) fn set_break(&mut self, on: bool) -> Result<(), PortError> {
        let Some(port) = &mut self.port else { return Ok(()) };
        match if on { port.start_break() } else { port.stop_break() } {
            Err(PortError::Unsupported { .. } | PortError::Gone(_)) => {
                self.readable = true;
                Ok(())
            }
            set => set,
        }
    }

    pub(crate) fn set_modem_lines(
        &mut self,
        lines: Option<(ModemLines, ModemLines)>,
    ) -> Result<(), PortError> {
        let Some(((mask, on), port)) = lines.zip(self.port.as_mut()) else { return Ok(()) };
        match port.set_modem_lines(mask, on) {
            Err(PortError::Unsupported { what }) => {
                tracing::warn!("this port cannot {what}; the plug-in asked for it");
                Ok(())
            }
            // A read will find out and tell the plug-in.
            Err(PortError::Gone(_)) => {
                self.readable = true;
                Ok(())
            }
            set => set,
        }
    }
}

fn pacer(line: LineParameters, depth: Option<u32>) -> Pacer {
    Pacer::new(line, depth.unwrap_or_else(|| default_depth(line.baud)))
}
