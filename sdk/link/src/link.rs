//! One link: a plug-in, its transmit queue, its timers, its job. What comes from
//! the line is in `input`, what the host asks for in `requests`.

mod input;
mod probation;
mod replace;
mod requests;
mod saving;
mod seat;
mod swap;
mod under_way;

pub use probation::Reverted;
pub use saving::SavedState;
pub(crate) use saving::saved_by;
pub use seat::Spare;
pub(crate) use seat::give_quiet;
pub use swap::{Successor, SwapError};
pub use under_way::UnderWay;

use crate::core::{Answering, Core, HoldState};
use crate::fault::{LinkFault, RuleBroken};
use crate::queue::Taken;
use crate::{LinkHost, Supply};
use alloc::boxed::Box;
use alloc::vec;
use core::hash::{Hash, Hasher};
use probation::Probation;
use softplug_abi::limits::{OUTPUT_ROUNDS, STEPS_PER_INSTANT};
use softplug_abi::manifest::SettingValues;
use softplug_abi::{
    Actions, Event, Instance, JobId, LineParameters, LinkDownReason, Micros, ModemLines,
};

/// What a link is opened with.
///
/// ```
/// use softplug_abi::{LineParameters, ModemLines, Parity};
/// use softplug_link::LinkOptions;
///
/// let line = LineParameters { parity: Parity::Even, ..LineParameters::new(19_200) };
/// let modem_lines = Some((ModemLines::CTS.union(ModemLines::DSR), ModemLines::CTS));
/// let options = LinkOptions { line, modem_lines, ..LinkOptions::default() };
/// assert_eq!((options.transmit_room, options.delivery_room), (4_096, 4_096));
/// ```
#[derive(Clone, Debug)]
pub struct LinkOptions {
    /// The characters on the line.
    pub line: LineParameters,
    /// Bytes that the transmit queue takes.
    pub transmit_room: u32,
    /// Bytes of deliveries that the host takes before it has to put them away.
    pub delivery_room: u32,
    /// The modem lines that the link has, and those that are on.
    pub modem_lines: Option<(ModemLines, ModemLines)>,
    /// A value for every setting of the plug-in.
    pub settings: SettingValues,
}

impl Default for LinkOptions {
    /// 9600 8N1, room for 4,096 bytes either way, no modem lines, no settings.
    fn default() -> Self {
        Self {
            line: LineParameters::new(9_600),
            transmit_room: 4_096,
            delivery_room: 4_096,
            modem_lines: None,
            settings: SettingValues::default(),
        }
    }
}

/// A plug-in on a line. See the [crate's page](crate) for the order of calls.
///
/// Every call may end in a [`LinkFault`]: the plug-in has then ended, its job and
/// delivery were reported as interrupted, and nothing more is sent. The link
/// itself, with its queue and hold, stays; another plug-in may take over.
///
/// ```
/// use softplug_abi::{Event, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_link::{HoldState, Link, LinkOptions, Recorder, Taken};
///
/// # type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
/// # struct Plugin(Act, Vec<u8>);
/// # impl Instance for Plugin {
/// #     type Fault = NoSpace;
/// #     fn input_capacity(&self) -> usize {
/// #         512
/// #     }
/// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
/// #         self.1.resize(1_024, 0);
/// #         let mut actions = ActionWriter::new(&mut self.1);
/// #         (self.0)(event, &mut actions)?;
/// #         let length = actions.len();
/// #         Ok(Output { actions: &self.1[..length], more: false })
/// #     }
/// # }
/// # fn plugin(act: Act) -> Plugin {
/// #     Plugin(act, Vec::new())
/// # }
/// let echo = plugin(|event, actions| match event {
///     Event::Received(bytes) => actions.transmit(bytes),
///     _ => Ok(()),
/// });
/// let mut link = Link::new(echo, LinkOptions::default());
/// let mut host = Recorder::default();
/// link.open(Micros(0), &mut host)?;
/// link.received(Micros(1_000), b"G1", &mut host)?;
/// link.handle_timeout(Micros(1_000), &mut host)?;
/// assert_eq!(link.hold(), HoldState::Free);
/// let mut port = [0; 64];
/// assert_eq!(link.take(&mut port), Taken::Bytes(2));
/// assert_eq!(&port[..2], b"G1");
/// // Both have left the wire, at the latest now.
/// link.left(2, 2);
/// link.handle_timeout(Micros(3_084), &mut host)?;
/// assert!(link.is_idle());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Link<I: Instance> {
    pub(crate) instance: I,
    pub(crate) core: Core,
    pub(crate) options: LinkOptions,
    scratch: Box<[u8]>,
    pub(crate) now: Micros,
    pub(crate) steps: u32,
    /// Events given so far.
    events: u64,
    is_open: bool,
    /// The port is gone: nothing is sent until it is back.
    pub(crate) down: Option<LinkDownReason>,
    has_ended: bool,
    pub(crate) probation: Option<Box<Probation<I>>>,
    pub(crate) reverted: Option<Box<Reverted<I>>>,
    pub(crate) taken_over_with: UnderWay,
}

impl<I: Instance> Link<I> {
    /// A link that is not open yet.
    pub fn new(instance: I, options: LinkOptions) -> Self {
        let core = Core::new(options.transmit_room, options.delivery_room);
        let scratch = vec![0; instance.input_capacity()].into();
        Self {
            instance,
            core,
            options,
            scratch,
            now: Micros::ZERO,
            steps: 0,
            events: 0,
            is_open: false,
            down: None,
            has_ended: false,
            probation: None,
            reverted: None,
            taken_over_with: UnderWay::default(),
        }
    }

    /// A second link in the same state, each with an instance of its own from here on. A plug-in
    /// on [probation](Self::on_probation) is no longer so in the second.
    ///
    /// ```
    /// use softplug_abi::{Event, Micros};
    /// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
    /// use std::hash::{DefaultHasher, Hasher};
    /// use softplug_link::{Link, LinkOptions, Recorder};
    ///
    /// # type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
    /// # #[derive(Clone)]
    /// # struct Plugin(Act, Vec<u8>);
    /// # impl Instance for Plugin {
    /// #     type Fault = NoSpace;
    /// #     fn input_capacity(&self) -> usize {
    /// #         512
    /// #     }
    /// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
    /// #         self.1.resize(1_024, 0);
    /// #         let mut actions = ActionWriter::new(&mut self.1);
    /// #         (self.0)(event, &mut actions)?;
    /// #         let length = actions.len();
    /// #         Ok(Output { actions: &self.1[..length], more: false })
    /// #     }
    /// # }
    /// # fn plugin(act: Act) -> Plugin {
    /// #     Plugin(act, Vec::new())
    /// # }
    /// let hash = |link: &Link<Plugin>| {
    ///     let mut state = DefaultHasher::new();
    ///     link.hash_ahead(link.now(), &mut state);
    ///     state.finish()
    /// };
    /// let echo = plugin(|event, actions| match event {
    ///     Event::Received(bytes) => actions.transmit(bytes),
    ///     _ => Ok(()),
    /// });
    /// let mut link = Link::new(echo, LinkOptions::default());
    /// let mut host = Recorder::default();
    /// link.open(Micros(0), &mut host)?;
    /// let mut other = link.fork();
    /// link.received(Micros(1_000), b"G1", &mut host)?;
    /// assert_ne!(hash(&link), hash(&other));
    /// // When it was does not matter, only what comes of it.
    /// other.received(Micros(9_000), b"G1", &mut host)?;
    /// assert_eq!(hash(&link), hash(&other));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn fork(&self) -> Self
    where
        I: Clone,
    {
        Self {
            instance: self.instance.clone(),
            core: self.core.clone(),
            options: self.options.clone(),
            scratch: self.scratch.clone(),
            now: self.now,
            steps: self.steps,
            events: self.events,
            is_open: self.is_open,
            down: self.down,
            has_ended: self.has_ended,
            probation: None,
            reverted: None,
            taken_over_with: self.taken_over_with.clone(),
        }
    }

    /// Hashes all that decides what this link does from `now` on, but for the instance: times as
    /// they are ahead, characters by how many have yet to leave. How many steps there were
    /// at this instant is left out, and so are the line and the settings, which never change.
    pub fn hash_ahead(&self, now: Micros, state: &mut impl Hasher) {
        let Self {
            instance: _,
            core,
            options,
            scratch: _,
            now: _,
            steps: _,
            events: _,
            is_open,
            down,
            has_ended,
            probation: _,
            reverted: _,
            taken_over_with: _,
        } = self;
        (is_open, down, has_ended, options.modem_lines).hash(state);
        core.hash_ahead(now, state);
    }

    /// Gives the settings, then opens.
    pub fn open(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_instant(now);
        self.steps = 0;
        let settings = core::mem::take(&mut self.options.settings);
        let capacity = self.instance.input_capacity();
        let given =
            settings.pieces(capacity, |event| self.step_as(event, Answering::Nothing, &mut *host));
        self.options.settings = settings;
        given?;
        self.is_open = true;
        self.down = None;
        self.taken_over_with = UnderWay::default();
        let opening = self.opening(false);
        self.core.restate_rooms();
        self.step(&opening, host)?;
        self.tell_modem_lines(host)?;
        self.handle_timeout(self.now, host)
    }

    /// The opening that tells a plug-in of the same state what this one knows.
    pub fn standing(&self) -> Event<'static> {
        Event::Open {
            resumed: true,
            line: self.options.line,
            transmit_room: self.core.queue.known_room(),
            delivery_room: self.core.known_delivery_room(),
        }
    }

    /// The modem lines as they were told last.
    pub fn modem_lines_told(&self) -> Option<(ModemLines, ModemLines)> {
        self.options.modem_lines
    }

    pub(crate) fn opening(&self, resumed: bool) -> Event<'static> {
        Event::Open {
            resumed,
            line: self.options.line,
            transmit_room: self.core.queue.whole_room(),
            delivery_room: self.core.whole_delivery_room(),
        }
    }

    /// Closes. What the plug-in still has under way is interrupted, what waits
    /// to be sent is dropped.
    pub fn close(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        if !self.is_open {
            return Ok(());
        }
        let closed = if self.has_ended { Ok(()) } else { self.tell_close(now, host) };
        self.keep();
        self.is_open = false;
        self.core.interrupt(self.now, host);
        self.core.queue.clear();
        closed
    }

    fn tell_close(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.handle_timeout(now, host)?;
        self.keep();
        self.steps = 0;
        self.step(&Event::Close, host)
    }

    /// How many characters, of all that [`take`](Self::take) gave out, have left
    /// the wire: at most (never late) and at least (never early). The reports to
    /// the plug-in follow in [`handle_timeout`](Self::handle_timeout).
    pub fn left(&mut self, maybe: u64, surely: u64) {
        self.core.queue.left(maybe, surely);
    }

    /// Delivers what is due at `now` until nothing of this instant is left:
    /// transmit progress, timers by (deadline, id), room for deliveries, then
    /// the job's data.
    pub fn handle_timeout(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_instant(now);
        if !self.is_open {
            return Ok(());
        }
        self.give_due(host)?;
        while self.feed(host)? {
            self.give_due(host)?;
        }
        Ok(())
    }

    /// All that goes before host requests and data.
    pub(crate) fn give_due(&mut self, host: &mut dyn LinkHost) -> Result<(), LinkFault<I::Fault>> {
        while let Some(event) = self.due(host) {
            self.step(&event, host)?;
        }
        Ok(())
    }

    fn due(&mut self, host: &mut dyn LinkHost) -> Option<Event<'static>> {
        let queue = &mut self.core.queue;
        if let Some((mark, state)) = queue.next_mark() {
            return Some(Event::Mark { mark, state });
        }
        if let Some(grown) = queue.next_room() {
            return Some(Event::TransmitRoom { grown });
        }
        if let Some(bytes) = queue.next_discarded() {
            return Some(Event::Discarded { bytes });
        }
        if let Some((id, deadline)) = self.core.timers.take_due(self.now) {
            return Some(Event::Timer { id, deadline });
        }
        let grown = self.core.next_delivery_room(host)?;
        Some(Event::DeliveryRoom { grown })
    }

    /// One event of the job: its beginning after a good check, data, or its end.
    fn feed(&mut self, host: &mut dyn LinkHost) -> Result<bool, LinkFault<I::Fault>> {
        let capacity = self.capacity();
        let Some(active) = &mut self.core.job else { return Ok(false) };
        let job = active.job.id;
        if active.run_next {
            active.start_run();
            self.core.fed.begin();
            host.rewind(job);
            self.steps = 0;
            return self.begin_event(host).map(|()| true);
        }
        let Some(most) = active.hungry(capacity) else { return Ok(false) };
        match host.supply(job, &mut self.scratch[..most]) {
            Supply::Later => return Ok(false),
            Supply::End => {
                active.end_data();
                self.step(&Event::JobEnd { job }, host)?;
            }
            Supply::Bytes(count) => {
                active.given(count);
                self.core.fed.give(count, self.core.queue.tail());
                self.steps = 0;
                let scratch = core::mem::take(&mut self.scratch);
                let given = self.step(&Event::JobData { job, bytes: &scratch[..count] }, host);
                // Another plug-in may have come with its own.
                if self.scratch.is_empty() {
                    self.scratch = scratch;
                }
                given?;
            }
        }
        Ok(true)
    }

    /// Gives the port what it may now send, as much as fits into `buffer`.
    /// Call it only when [`handle_timeout`](Self::handle_timeout) has left nothing for this
    /// instant.
    pub fn take(&mut self, buffer: &mut [u8]) -> Taken {
        if self.has_ended || self.down.is_some() {
            return Taken::Nothing;
        }
        self.core.queue.take(buffer)
    }

    /// When [`handle_timeout`](Self::handle_timeout) has something to do though nothing comes: when
    /// the next timer runs out.
    pub fn poll_timeout(&self) -> Option<Micros> {
        self.core.timers.poll_timeout()
    }

    /// The job under way.
    pub fn job(&self) -> Option<JobId> {
        self.core.job.as_ref().map(|active| active.job.id)
    }

    /// Whether a delivery is under way.
    pub fn has_delivery(&self) -> bool {
        self.core.delivery.is_some()
    }

    /// Whether the plug-in holds the queue.
    pub fn hold(&self) -> HoldState {
        if self.core.queue.is_held() { HoldState::Held } else { HoldState::Free }
    }

    /// Whether [`take`](Self::take) would give something.
    pub fn has_to_send(&self) -> bool {
        !self.has_ended && self.down.is_none() && self.core.queue.has_to_send()
    }

    /// Bytes that may be delivered before the host has to put some away.
    pub fn delivery_room(&self) -> u32 {
        self.core.whole_delivery_room()
    }

    /// Bytes that the plug-in knows it may deliver: a host that gives it no more
    /// than fits in there makes it lose nothing.
    pub fn known_delivery_room(&self) -> u32 {
        self.core.known_delivery_room()
    }

    /// Bytes that wait in the transmit queue.
    pub fn waiting(&self) -> usize {
        self.core.queue.waiting()
    }

    /// Characters that [`take`](Self::take) has given out or may give out yet, urgent
    /// ones that still wait left out.
    pub fn characters(&self) -> u64 {
        self.core.queue.tail()
    }

    /// Bytes of the latest job's data, also of one that has ended, of which some
    /// may be among the first `characters` that [`take`](Self::take) gave out, of
    /// all since the link began: never too few, provided that a byte of data is at
    /// least one character where the plug-in sends it as urgent. Too many by what
    /// the plug-in is given at once, and by a little.
    ///
    /// ```
    /// # use softplug_abi::{Action, ActionWriter, Event, Instance, JobId, Micros, NoSpace, Output};
    /// # use softplug_link::{Job, Link, LinkOptions, Recorder};
    /// # struct Sender(Vec<u8>);
    /// # impl Instance for Sender {
    /// #     type Fault = NoSpace;
    /// #     fn input_capacity(&self) -> usize {
    /// #         512
    /// #     }
    /// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
    /// #         self.0.resize(1_024, 0);
    /// #         let mut actions = ActionWriter::new(&mut self.0);
    /// #         match event {
    /// #             Event::JobBegin { job, .. } => actions.push(&Action::Want { job: *job, bytes: 900 })?,
    /// #             Event::JobData { bytes, .. } => actions.transmit(bytes)?,
    /// #             _ => {}
    /// #         }
    /// #         let length = actions.len();
    /// #         Ok(Output { actions: &self.0[..length], more: false })
    /// #     }
    /// # }
    /// let mut link = Link::new(Sender(Vec::new()), LinkOptions::default());
    /// let mut host = Recorder::default();
    /// link.open(Micros(0), &mut host)?;
    /// host.add_source(JobId(7), vec![b'X'; 900]);
    /// let job = Job { id: JobId(7), kind: 0, size: Some(900), fields: Vec::new(), check: false };
    /// link.begin_job(Micros(0), job, &mut host)?;
    /// // It was given 508 bytes, and the rest when these were in the queue.
    /// assert_eq!(link.characters(), 900);
    /// assert_eq!([0, 1, 509].map(|left| link.job_bytes_within(left)), [0, 508, 900]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn job_bytes_within(&self, characters: u64) -> u64 {
        self.core.fed.within(characters)
    }

    /// Events that the plug-in was given.
    pub fn events(&self) -> u64 {
        self.events
    }

    /// Whether a report waits for bytes to leave: only then does it matter when
    /// [`left`](Self::left) is told. Telling all of it then makes up for before.
    pub fn awaits_departures(&self) -> bool {
        self.core.queue.awaits_departures()
    }

    /// Whether, after [`take`](Self::take), [`handle_timeout`](Self::handle_timeout) may have
    /// something to tell of it.
    pub fn has_reports(&self) -> bool {
        self.core.queue.has_reports()
    }

    /// Whether the plug-in has ended by a fault.
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// The time of the latest call.
    pub fn now(&self) -> Micros {
        self.now
    }

    pub(crate) fn is_open(&self) -> bool {
        self.is_open
    }

    /// A host request: steps at this instant count anew.
    pub(crate) fn begin_request(&mut self) {
        self.steps = 0;
    }

    /// Whether nothing is under way: no job, delivery or request, nothing to send
    /// and no hold. A plug-in may still be in the middle of what it receives.
    pub fn is_idle(&self) -> bool {
        self.core.is_idle()
    }

    /// The instance, to look at.
    pub fn instance(&self) -> &I {
        &self.instance
    }

    /// The instance. Whoever steps it by himself breaks the link.
    pub fn instance_mut(&mut self) -> &mut I {
        &mut self.instance
    }

    /// The settings that the plug-in was given.
    pub fn settings(&self) -> &SettingValues {
        &self.options.settings
    }

    /// Time never goes back: an earlier `now` counts as the latest.
    pub(crate) fn begin_instant(&mut self, now: Micros) {
        if now > self.now {
            self.now = now;
            self.steps = 0;
        }
    }

    pub(crate) fn step(
        &mut self,
        event: &Event<'_>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        if !self.is_open {
            return Ok(());
        }
        self.step_as(event, Answering::Ordinary, host)
    }

    /// One event with all rounds of its output. A fault ends the plug-in.
    pub(crate) fn step_as(
        &mut self,
        event: &Event<'_>,
        answering: Answering,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        if self.has_ended {
            return Err(LinkFault::Ended);
        }
        if self.probation.is_some() {
            return self.step_on_probation(event, host);
        }
        let stepped = self.rounds(event, answering, host);
        self.ended_by(stepped, host)
    }

    fn rounds(
        &mut self,
        event: &Event<'_>,
        answering: Answering,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.count_step(event)?;
        let now = self.now;
        let broken = |source| LinkFault::Rule { event: event.kind(), source };
        let mut asked = event;
        for _ in 0..=OUTPUT_ROUNDS {
            let output = self
                .instance
                .step(asked, now)
                .map_err(|source| LinkFault::instance(event, source))?;
            for action in Actions::new(output.actions) {
                let action = action
                    .map_err(|source| LinkFault::Malformed { event: event.kind(), source })?;
                self.core.apply(now, &action, answering, host).map_err(broken)?;
            }
            if !output.more {
                return Ok(());
            }
            asked = &Event::Continue;
        }
        Err(broken(RuleBroken::OutputWithoutEnd))
    }

    /// One more event at this instant.
    pub(crate) fn count_step(&mut self, event: &Event<'_>) -> Result<(), LinkFault<I::Fault>> {
        self.steps += 1;
        self.events += 1;
        if self.steps > STEPS_PER_INSTANT {
            let source = RuleBroken::TimeStandsStill;
            return Err(LinkFault::Rule { event: event.kind(), source });
        }
        Ok(())
    }

    /// The largest payload that the plug-in takes, and also the one that may
    /// have to take its place.
    pub(crate) fn capacity(&self) -> usize {
        let own = self.instance.input_capacity();
        self.probation.as_ref().map_or(own, |probation| own.min(probation.capacity()))
    }

    /// Puts `instance` in the place of the plug-in; timers are cancelled.
    pub(crate) fn put(&mut self, instance: I) -> I {
        self.scratch = vec![0; instance.input_capacity()].into();
        self.core.timers.clear();
        self.has_ended = false;
        core::mem::replace(&mut self.instance, instance)
    }

    pub(crate) fn ended_by(
        &mut self,
        result: Result<(), LinkFault<I::Fault>>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        if result.is_err() {
            self.has_ended = true;
            self.core.interrupt(self.now, host);
        }
        result
    }

    pub(crate) fn tell_modem_lines(
        &mut self,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        match self.options.modem_lines {
            Some((known, on)) => self.step(&Event::ModemLines { known, on }, host),
            None => Ok(()),
        }
    }
}
