//! The connection to one unit, and the links of it that are driven.

use std::io;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

use mio::{Interest, Token};
use softplug_abi::Micros;
use softplug_unit_bus::Unit;
use softplug_unit_protocol::{Identity, Messages, Role, Session, SessionEvent, ToServer, ToUnit};
use softplug_unit_uplink::{
    CanEnd, CanUplink, Closed, Outbox, TcpUplink, TlsError, TlsKeys, Uplink,
};

use super::lane::{Around, UnitLane};
use super::{Thread, ThreadCommand};
use crate::reactor::{Backoff, LaneId};
use crate::text::plain_text;
use crate::units::{ServerSession, UnitCommand, UnitPlace, UnitSetup};

/// A connection that is not made after this span is tried anew.
const CONNECTING: Micros = Micros::from_millis(5_000);

pub(super) struct Connection {
    number: usize,
    unit: UnitPlace,
    tls: Option<TlsKeys>,
    reopen: Backoff,
    failures: u32,
    uplink: Option<Uplink>,
    /// Boxed: it has its frames in it.
    session: Box<ServerSession>,
    outbox: Outbox,
    /// When to give up or try again.
    at: Option<Micros>,
    /// Whom the last session was with.
    peer: Option<Identity>,
    lanes: Vec<UnitLane>,
    /// How many links the unit has; 0 while that is not known.
    links: u8,
    /// Those that it has named in this session, until all are.
    named: Option<Vec<String>>,
}

impl Connection {
    pub(super) fn new(number: usize, setup: &UnitSetup, thread: &Thread) -> Self {
        let mut connection = Self {
            number,
            unit: setup.address.unit.clone(),
            tls: setup.tls.clone(),
            reopen: setup.reopen,
            failures: 0,
            uplink: None,
            session: Box::new(Session::new(Role::Server, Identity(thread.identity))),
            outbox: Outbox::default(),
            at: None,
            peer: None,
            lanes: Vec::new(),
            links: 0,
            named: None,
        };
        connection.connect(thread);
        connection
    }

    /// Whether it leads to the unit of this link, as the unit is to be reached.
    pub(super) fn is_to(&self, setup: &UnitSetup) -> bool {
        self.unit == setup.address.unit && self.tls == setup.tls
    }

    pub(super) fn is_empty(&self) -> bool {
        self.lanes.is_empty()
    }

    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        let lanes = self.lanes.iter().filter_map(UnitLane::poll_timeout);
        lanes.chain(self.at).chain(self.session.poll_timeout()).min()
    }

    pub(super) fn add(&mut self, mut lane: UnitLane, thread: &Thread) {
        if let Some(peer) = self.peer.filter(|_| self.session.is_up()) {
            lane.session_began(peer, true, thread);
            self.outbox.push(&ToUnit::Query {}, false);
        }
        self.lanes.push(lane);
        self.speak(thread);
    }

    pub(super) fn tell(&mut self, id: LaneId, command: UnitCommand, thread: &Thread) {
        let mut around = Around { outbox: &mut self.outbox, is_up: self.session.is_up(), thread };
        if let Some(lane) = self.lanes.iter_mut().find(|lane| lane.id() == id) {
            lane.tell(command, &mut around);
        }
    }

    /// At once.
    pub(super) fn remove(&mut self, id: LaneId, thread: &Thread) {
        let mut around = Around { outbox: &mut self.outbox, is_up: self.session.is_up(), thread };
        if let Some(lane) = self.lanes.iter_mut().find(|lane| lane.id() == id) {
            lane.close(&mut around);
        }
    }

    /// Lanes that are closed.
    pub(super) fn take_ended(&mut self) -> Vec<LaneId> {
        self.lanes.extract_if(.., |lane| lane.is_closed()).map(|lane| lane.id()).collect()
    }

    /// All there is to do now.
    pub(super) fn turn(&mut self, thread: &Thread) {
        let now = thread.clock.now();
        self.hear(thread);
        if self.at.is_some_and(|at| at <= now) {
            self.at = None;
            if let Some(uplink) = &self.uplink {
                let closed = if uplink.is_handshaking() {
                    Closed::Tls(TlsError::Slow)
                } else {
                    Closed::Io(io::ErrorKind::TimedOut.into())
                };
                self.lost(&closed.to_string(), thread);
            } else {
                self.connect(thread);
            }
        }
        self.session.handle_timeout(now);
        self.session_news(thread);
        self.speak(thread);
    }

    /// Looks the unit up, elsewhere if that may take time.
    fn connect(&mut self, thread: &Thread) {
        let (host, port) = match &self.unit {
            UnitPlace::Tcp { host, port } => (host.clone(), *port),
            UnitPlace::Can(address) => {
                let opened = CanUplink::open(address, CanEnd::Gateway);
                self.call(opened.map(Uplink::Can).map_err(Closed::Io), thread);
                return;
            }
        };
        if let Ok(address) = host.parse::<IpAddr>() {
            self.found(Ok(SocketAddr::new(address, port)), thread);
            return;
        }
        let (number, commands) = (self.number, thread.commands.clone());
        let waker = std::sync::Arc::clone(&thread.mio_waker);
        let look_up = move || {
            let found = (host.as_str(), port)
                .to_socket_addrs()
                .and_then(|mut found| found.next().ok_or_else(|| io::ErrorKind::NotFound.into()));
            if commands.send(ThreadCommand::Found(number, found)).is_ok() {
                let _ = waker.wake();
            }
        };
        let spawned = std::thread::Builder::new().name("softplug-connect".into()).spawn(look_up);
        if let Err(error) = spawned {
            self.lost(&error.to_string(), thread);
        }
    }

    pub(super) fn found(&mut self, found: io::Result<SocketAddr>, thread: &Thread) {
        let connected = match found {
            Ok(address) => TcpUplink::connect(address, self.tls.as_ref()),
            Err(error) => Err(error.into()),
        };
        self.call(connected.map(Uplink::Tcp), thread);
    }

    fn call(&mut self, uplink: Result<Uplink, Closed>, thread: &Thread) {
        let both = Interest::READABLE | Interest::WRITABLE;
        let waited = uplink.and_then(|mut uplink| {
            thread.poll.registry().register(&mut uplink, Token(self.number), both)?;
            Ok(uplink)
        });
        match waited {
            Ok(uplink) => {
                self.uplink = Some(uplink);
                let now = thread.clock.now();
                self.at = Some(now + CONNECTING);
                self.session.call(now);
            }
            Err(error) => self.lost(&error.to_string(), thread),
        }
    }

    pub(super) fn drop_uplink(&mut self, thread: &Thread) {
        if let Some(mut uplink) = self.uplink.take() {
            let _ = thread.poll.registry().deregister(&mut uplink);
        }
    }

    /// The connection is gone, or could not be made.
    fn lost(&mut self, why: &str, thread: &Thread) {
        self.drop_uplink(thread);
        self.session.uplink_lost();
        let _ = self.session.poll();
        self.outbox.clear();
        self.failures += 1;
        let retry_in = self.reopen.after(self.failures);
        self.at = Some(thread.clock.now() + retry_in);
        let detail = format!("the unit at {}: {why}", self.unit);
        for lane in &mut self.lanes {
            lane.lost(&detail, retry_in, thread);
        }
    }

    fn hear(&mut self, thread: &Thread) {
        let Some(mut uplink) = self.uplink.take() else { return };
        match self.hear_frames(&mut uplink, thread) {
            Ok(()) => self.uplink = Some(uplink),
            Err(closed) => {
                self.uplink = Some(uplink);
                // A unit sends away whoever comes while it is driven.
                let has_left = closed.is_by_peer() || matches!(closed, Closed::Tls(TlsError::Left));
                let is_sent_away = has_left && !self.session.is_up();
                let also = if is_sent_away { "; another gateway may drive it" } else { "" };
                self.lost(&format!("{closed}{also}"), thread);
            }
        }
    }

    fn hear_frames(&mut self, uplink: &mut Uplink, thread: &Thread) -> Result<(), Closed> {
        while let Some(frame) = uplink.receive()? {
            match self.session.receive(thread.clock.now(), frame) {
                Ok(None) => {}
                Ok(Some(payload)) => {
                    for message in Messages::<ToServer<'_>>::new(payload) {
                        match message {
                            Ok(_) if self.outbox.is_flooded() => {
                                tracing::error!(unit = %self.unit, "it asks and takes nothing");
                                self.session.end();
                                break;
                            }
                            Ok(message) => self.hear_message(&message, thread),
                            Err(error) => {
                                tracing::error!(%error, unit = %self.unit, "the session ends");
                                self.session.end();
                                break;
                            }
                        }
                    }
                }
                Err(error) => tracing::warn!(%error, unit = %self.unit, "a frame is dropped"),
            }
            self.session_news(thread);
        }
        Ok(())
    }

    fn session_news(&mut self, thread: &Thread) {
        match self.session.poll() {
            Some(SessionEvent::Began { peer }) => {
                (self.at, self.failures) = (None, 0);
                self.outbox.begin(self.session.longest_message());
                (self.links, self.named) = (0, None);
                let is_same = self.peer.replace(peer) == Some(peer);
                for lane in &mut self.lanes {
                    lane.session_began(peer, is_same, thread);
                }
                self.outbox.push(&ToUnit::Query {}, false);
            }
            // The connection may be sound; what is behind it is not.
            Some(SessionEvent::Ended(reason)) => self.lost(&reason.to_string(), thread),
            Some(SessionEvent::Refused(reason)) => {
                let why = match reason {
                    softplug_unit_protocol::RefuseReason::Busy => "another gateway drives it",
                    softplug_unit_protocol::RefuseReason::Version
                    | softplug_unit_protocol::RefuseReason::NoSession => {
                        "it speaks another version of the unit protocol"
                    }
                };
                self.lost(why, thread);
            }
            None => {}
        }
    }

    fn hear_message(&mut self, message: &ToServer<'_>, thread: &Thread) {
        let mut around = Around { outbox: &mut self.outbox, is_up: self.session.is_up(), thread };
        match *message {
            ToServer::Unit { links, .. } => {
                (self.links, self.named) = (links, Some(Vec::new()));
            }
            ToServer::Slot { link, slot, state, digest, .. } => {
                // Before its link is known by name: for all, until they know which is theirs.
                for lane in &mut self.lanes {
                    lane.slot(link, slot, state, digest);
                }
            }
            ToServer::Link { link, name, .. } => {
                let links = self.links;
                for lane in self.lanes.iter_mut().filter(|lane| lane.is_called(name, links)) {
                    lane.found(link, message, &mut around);
                }
                let Some(named) = &mut self.named else { return };
                named.push(plain_text(name));
                if named.len() == usize::from(links)
                    && let Some(known) = self.named.take()
                {
                    for lane in &mut self.lanes {
                        lane.is_unknown(&known, thread);
                    }
                }
            }
            _ => {
                let Some(number) = message.link() else { return };
                let of = |lane: &&mut UnitLane| lane.is_number(number);
                for lane in self.lanes.iter_mut().filter(of) {
                    if lane.hear(message, &mut around).is_err() {
                        tracing::error!(unit = %self.unit, "it sends more than it may");
                        self.session.end();
                        return;
                    }
                }
            }
        }
    }

    /// What waits goes to the session, and its frames to the uplink.
    fn speak(&mut self, thread: &Thread) {
        let is_up = self.session.is_up();
        let mut around = Around { outbox: &mut self.outbox, is_up, thread };
        for lane in &mut self.lanes {
            lane.pump(&mut around);
        }
        self.transmit(thread);
    }

    /// What a bus is told of a lane's unit.
    pub(super) fn demand(&mut self, id: LaneId, fair: f64, thread: &Thread) -> Unit {
        let around = Around { outbox: &mut self.outbox, is_up: self.session.is_up(), thread };
        let lane = self.lanes.iter().find(|lane| lane.id() == id);
        lane.map_or(Unit::ABSENT, |lane| lane.demand(fair, &around))
    }

    /// Sends job data of a lane that may leave now, at most so many bytes. How many it were.
    pub(super) fn feed(&mut self, id: LaneId, most: u64, thread: &Thread) -> u64 {
        let mut around = Around { outbox: &mut self.outbox, is_up: self.session.is_up(), thread };
        let lane = self.lanes.iter_mut().find(|lane| lane.id() == id);
        let sent = lane.map_or(0, |lane| lane.feed(most, &mut around));
        self.transmit(thread);
        sent
    }

    /// Bits that went over the uplink since it was asked last, and the bus that they went over: one
    /// unit hangs on one bus.
    pub(super) fn take_bits(&mut self) -> Option<(&str, u64)> {
        let bits = self.uplink.as_mut()?.take_bits();
        let bus = self.lanes.iter().find_map(UnitLane::bus)?;
        Some((bus, bits))
    }

    pub(super) fn lanes(&self) -> &[UnitLane] {
        &self.lanes
    }

    fn transmit(&mut self, thread: &Thread) {
        let Some(uplink) = &mut self.uplink else { return };
        let spoken = uplink.speak(&mut self.session, &mut self.outbox, thread.clock.now());
        if let Err(closed) = spoken {
            self.lost(&closed.to_string(), thread);
        }
    }
}
