//! The unit: one thread that hears its server and its lanes, and passes on what each has to know.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::task::Waker;
use std::time::Duration;

use mio::{Events, Poll, Token};
use softplug_abi::Micros;
use softplug_host::{Host, HostOptions};
use softplug_live::clock::Clock;
use softplug_live::reactor::{LaneId, Reactor, ReactorOptions, Report};
use softplug_unit_protocol::{
    FrameError, Identity, LONGEST, Messages, Role, Session, SessionEvent, ToServer, ToUnit,
};
use softplug_unit_uplink::{Closed, Outbox, Uplink, waker_of};

use crate::config::{Reach, UnitConfig};
use crate::door::Door;
use crate::error::UnitError;
use crate::link::{Compiled, Link, Surroundings};
use crate::memory::Memory;

const WAKER: Token = Token(0);
/// How often what is shown of a job is looked at.
const LOOK: Micros = Micros::from_millis(50);

/// Ends a unit from another thread.
#[derive(Clone, Debug)]
pub struct Stop {
    is_asked: Arc<AtomicBool>,
    waker: Arc<mio::Waker>,
}

impl Stop {
    /// Asks it to end.
    pub fn ask(&self) {
        self.is_asked.store(true, Ordering::SeqCst);
        let _ = self.waker.wake();
    }
}

/// A unit.
///
/// ```no_run
/// use softplug_unit::{Unit, UnitConfig};
/// use std::path::Path;
///
/// let config = UnitConfig::read(Path::new("unit.toml"))?;
/// let unit = Unit::start(config, 0x1234_5678_9ABC_DEF0)?;
/// println!("it is reached at {}", unit.address());
/// unit.run()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Unit {
    config: UnitConfig,
    poll: Poll,
    door: Door,
    uplink: Option<Uplink>,
    /// Boxed: it has its frames in it.
    session: Box<Session<16, 1024>>,
    outbox: Outbox,
    /// The server has asked what there is, in this session.
    is_asked: bool,
    reactor: Reactor<softplug_host::Session>,
    reports: Receiver<(LaneId, Report)>,
    host: Host,
    links: Vec<Link>,
    compiled: (Sender<Compiled>, Receiver<Compiled>),
    next_lane: u32,
    clock: Clock,
    waker: Waker,
    stop: Stop,
}

impl Unit {
    /// Opens memories and listener; plug-ins that are there begin to run. `identity` is new at each
    /// start, at random.
    ///
    /// # Errors
    /// The set-up, or the system below.
    pub fn start(config: UnitConfig, identity: u64) -> Result<Self, UnitError> {
        let poll = Poll::new().map_err(system("wait for the uplink"))?;
        let mio_waker = mio::Waker::new(poll.registry(), WAKER).map_err(system("be woken"))?;
        let mio_waker = Arc::new(mio_waker);
        let is_asked = Arc::new(AtomicBool::new(false));
        let stop = Stop { is_asked, waker: Arc::clone(&mio_waker) };
        let waker = waker_of(mio_waker);
        let links = config.links.iter().zip(0..).map(|(link, number)| {
            let memory = Memory::open(&link.memory, &config.signature).map_err(|error| {
                let (path, link) = (link.memory.path.clone(), link.name.clone());
                UnitError::Memory { link, path, reason: error.to_string() }
            })?;
            Ok(Link::new(number, link.clone(), memory))
        });
        let links = links.collect::<Result<Vec<_>, UnitError>>()?;
        let door = Door::open(&config.reach, config.tls.as_ref(), poll.registry())?;
        let (tell, reports) = channel();
        let told = waker.clone();
        let reactor = Reactor::start(ReactorOptions::default(), move |lane, report| {
            if tell.send((lane, report)).is_ok() {
                told.wake_by_ref();
            }
        })?;
        let mut unit = Self {
            poll,
            door,
            uplink: None,
            session: Box::new(Session::new(Role::Unit, Identity(identity))),
            outbox: Outbox::default(),
            is_asked: false,
            reactor,
            reports,
            host: Host::new(HostOptions::default())?,
            links,
            compiled: channel(),
            next_lane: 1,
            clock: Clock::start(),
            waker,
            stop,
            config,
        };
        unit.each_link(Link::start);
        Ok(unit)
    }

    /// Where a gateway reaches it.
    pub fn address(&self) -> Reach {
        self.door.address().unwrap_or_else(|| self.config.reach.clone())
    }

    /// What ends it.
    pub fn stop(&self) -> Stop {
        self.stop.clone()
    }

    /// Works until it is asked to stop.
    ///
    /// # Errors
    /// The system below.
    pub fn run(mut self) -> Result<(), UnitError> {
        let mut events = Events::with_capacity(16);
        while !self.stop.is_asked.load(Ordering::SeqCst) {
            self.poll
                .poll(&mut events, self.patience())
                .or_else(|error| {
                    if error.kind() == std::io::ErrorKind::Interrupted {
                        Ok(())
                    } else {
                        Err(error)
                    }
                })
                .map_err(system("wait for the uplink"))?;
            // First who is there: it may be gone already when the next one comes.
            self.hear_uplink();
            self.accept();
            self.hear_uplink();
            self.session.handle_timeout(self.clock.now());
            self.session_news();
            self.hear_lanes();
            self.speak();
        }
        Ok(())
    }

    fn patience(&self) -> Option<Duration> {
        let now = self.clock.now();
        let due = self.session.poll_timeout().into_iter().chain(self.door.again_at());
        let look = self.session.is_up().then_some(now + LOOK);
        let due = due.chain(look).min()?;
        Some(Duration::from_micros((due - now).0.max(0) as u64))
    }

    fn accept(&mut self) {
        let now = self.clock.now();
        while let Some(uplink) = self.door.next(self.session.is_up(), self.poll.registry(), now) {
            self.drop_uplink();
            self.uplink = Some(uplink);
        }
    }

    fn drop_uplink(&mut self) {
        if let Some(mut uplink) = self.uplink.take() {
            let _ = self.poll.registry().deregister(&mut uplink);
            self.door.uplink_is_gone(self.clock.now());
        }
    }

    fn hear_uplink(&mut self) {
        let Some(mut uplink) = self.uplink.take() else { return };
        let heard = self.hear_frames(&mut uplink);
        self.uplink = Some(uplink);
        if let Err(closed) = heard {
            if let Closed::NoFrame(FrameError::Version(version)) = closed {
                self.refuse_version(version);
            }
            self.lost(&closed);
        }
    }

    fn lost(&mut self, closed: &Closed) {
        if self.session.is_up() {
            tracing::info!(%closed, "the uplink is lost");
        } else if let (Closed::Tls(why), Some(uplink)) = (closed, &self.uplink) {
            tracing::warn!(peer = ?uplink.peer(), %why, "a caller is turned away");
        } else {
            tracing::debug!(%closed, "the uplink is of no use");
        }
        self.drop_uplink();
        self.session.uplink_lost();
        self.session_news();
    }

    /// Where the next frame begins is not known, but for the answer that is all there is to say.
    fn refuse_version(&mut self, version: u8) {
        let Some(uplink) = &mut self.uplink else { return };
        let now = self.clock.now();
        let mut frame = [0; LONGEST];
        // The session has the answer ready; it is no error any more that it is to be given.
        let _ = self.session.receive(now, &[version]);
        let Some(length) = self.session.poll_transmit(now, &mut frame) else { return };
        if let Err(error) = uplink.send_last(&frame[..length]) {
            tracing::debug!(%error, "another version is not told so");
        }
    }

    fn hear_frames(&mut self, uplink: &mut Uplink) -> Result<(), Closed> {
        while let Some(frame) = uplink.receive()? {
            let now = self.clock.now();
            match self.session.receive(now, frame) {
                Ok(None) => {}
                Ok(Some(payload)) => {
                    for message in Messages::<ToUnit<'_>>::new(payload) {
                        match message {
                            Ok(_) if self.outbox.is_flooded() => {
                                tracing::error!(
                                    "the session ends: the server asks and takes nothing"
                                );
                                self.session.end();
                                break;
                            }
                            Ok(message) => self.hear(&message),
                            Err(error) => {
                                tracing::error!(%error, "the session ends");
                                self.session.end();
                                break;
                            }
                        }
                    }
                }
                Err(error) => tracing::warn!(%error, "a frame is dropped"),
            }
            self.session_news();
        }
        Ok(())
    }

    fn session_news(&mut self) {
        match self.session.poll() {
            Some(SessionEvent::Began { peer }) => {
                tracing::info!(server = format_args!("{:016x}", peer.0), "a server is there");
                self.is_asked = false;
                self.outbox.begin(self.session.longest_message());
            }
            Some(SessionEvent::Ended(reason)) => {
                tracing::info!(%reason, "the server is gone");
                self.outbox.clear();
            }
            Some(SessionEvent::Refused(_)) | None => {}
        }
    }

    fn hear(&mut self, message: &ToUnit<'_>) {
        let Some(link) = message.link() else {
            self.is_asked = true;
            let (links, serial) = (self.links.len() as u8, self.config.serial);
            let name = self.config.name.clone();
            self.outbox.push(&ToServer::Unit { links, serial, name: &name }, false);
            self.each_link(|link, around| link.hear(&ToUnit::Query {}, around));
            return;
        };
        if usize::from(link) < self.links.len() {
            self.one_link(usize::from(link), |link, around| link.hear(message, around));
        } else {
            let (message, why) = (message.kind(), "there is no such link");
            self.outbox.push(&ToServer::Refused { message, link, job: 0, why }, false);
        }
    }

    fn hear_lanes(&mut self) {
        while let Ok((lane, report)) = self.reports.try_recv() {
            let of = |link: &Link| link.lane() == Some(lane);
            if let Some(at) = self.links.iter().position(of) {
                self.one_link(at, |link, around| link.report(report, around));
            }
        }
        while let Ok(compiled) = self.compiled.1.try_recv() {
            let at = usize::from(compiled.link);
            self.one_link(at, |link, around| link.compiled(compiled, around));
        }
        let now = self.clock.now();
        for at in 0..self.links.len() {
            let status = self.links[at].lane().and_then(|lane| self.reactor.status(lane));
            let figures = status.map(|status| status.read());
            self.one_link(at, |link, around| link.pump(figures, now, around));
        }
    }

    /// What waits goes to the session, and its frames to the uplink.
    fn speak(&mut self) {
        self.outbox.pump(&mut self.session);
        if self.session.is_up() && self.is_asked && self.outbox.is_empty() {
            let longest = self.session.longest_message();
            let session = &mut self.session;
            for link in &mut self.links {
                link.deliver(&mut |message| session.send(message).is_ok(), longest);
            }
        }
        let Some(uplink) = &mut self.uplink else { return };
        let now = self.clock.now();
        let spoken = uplink.speak(&mut self.session, &mut self.outbox, now);
        if let Err(closed) = spoken {
            self.lost(&closed);
        }
    }

    fn one_link(&mut self, at: usize, act: impl FnOnce(&mut Link, &mut Surroundings<'_>)) {
        let mut around = Surroundings {
            reactor: &self.reactor,
            host: &self.host,
            outbox: &mut self.outbox,
            is_up: self.session.is_up() && self.is_asked,
            waker: &self.waker,
            compiled: &self.compiled.0,
            next_lane: &mut self.next_lane,
        };
        act(&mut self.links[at], &mut around);
    }

    fn each_link(&mut self, mut act: impl FnMut(&mut Link, &mut Surroundings<'_>)) {
        for at in 0..self.links.len() {
            self.one_link(at, &mut act);
        }
    }
}

impl std::fmt::Debug for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let links: Vec<&str> = self.links.iter().map(Link::name).collect();
        f.debug_struct("Unit").field("links", &links).finish_non_exhaustive()
    }
}

fn system(what: &'static str) -> impl FnOnce(std::io::Error) -> UnitError {
    move |source| UnitError::System { what, source }
}
