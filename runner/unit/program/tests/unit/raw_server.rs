//! A server that says what it is told to say, and keeps what it hears.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use mio::{Events, Interest, Poll, Token};
use softplug_abi::Micros;
use softplug_live::clock::Clock;
use softplug_unit_protocol::{Identity, Messages, Role, Session, ToServer, ToUnit};
use softplug_unit_uplink::{Outbox, TcpUplink, Uplink};

use crate::shop::PATIENCE;

pub(crate) struct RawServer {
    poll: Poll,
    uplink: Uplink,
    session: Box<Session<16, 1024>>,
    outbox: Outbox,
    clock: Clock,
    /// Messages as they are shown by `Debug`.
    pub(crate) heard: Vec<String>,
    /// Queries that were answered to their end.
    told: usize,
}

impl RawServer {
    /// A session with a unit.
    pub(crate) fn connect(unit: SocketAddr) -> Self {
        let poll = Poll::new().unwrap();
        let mut uplink = Uplink::Tcp(TcpUplink::connect(unit, None).unwrap());
        let both = Interest::READABLE | Interest::WRITABLE;
        poll.registry().register(&mut uplink, Token(0), both).unwrap();
        let clock = Clock::start();
        let mut session = Box::new(Session::new(Role::Server, Identity(77)));
        session.call(clock.now());
        let (outbox, heard) = (Outbox::default(), Vec::new());
        let mut server = Self { poll, uplink, session, outbox, clock, heard, told: 0 };
        let begin = Instant::now();
        while !server.session.is_up() {
            assert!(begin.elapsed() < PATIENCE, "no session");
            server.turn();
        }
        server
    }

    pub(crate) fn say(&mut self, message: &ToUnit<'_>) {
        self.outbox.push(message, false);
    }

    pub(crate) fn until(&mut self, is_so: impl Fn(&[String]) -> bool) {
        let begin = Instant::now();
        while !is_so(&self.heard) {
            assert!(begin.elapsed() < PATIENCE, "it never came: {:?}", self.heard);
            self.turn();
        }
    }

    /// Asks again and again what there is; deliveries are put away as they come.
    pub(crate) fn ask_until(&mut self, is_so: impl Fn(&[String]) -> bool) {
        let begin = Instant::now();
        let mut asked = 0;
        while !is_so(&self.heard) {
            assert!(begin.elapsed() < PATIENCE, "it never came: {:?}", self.heard);
            if self.told >= asked {
                asked += 1;
                self.say(&ToUnit::Query {});
            }
            self.turn();
        }
    }

    /// Asks so often that no answer to all of it can be meant, until the unit has had enough.
    pub(crate) fn ask_without_end(&mut self) {
        (0..5_000).for_each(|_| self.say(&ToUnit::Query {}));
        let begin = Instant::now();
        while self.session.is_up() {
            assert!(begin.elapsed() < PATIENCE, "it goes on answering");
            self.turn();
        }
    }

    /// Until the unit has said at least once that it is there, though it has nothing to say.
    pub(crate) fn turn_for_a_heartbeat(&mut self) {
        let until = self.clock.now() + Micros::from_millis(1_100);
        while self.clock.now() < until {
            self.turn();
        }
    }

    fn turn(&mut self) {
        while let Some(frame) = self.uplink.receive().unwrap() {
            let frame = frame.to_vec();
            if let Ok(Some(payload)) = self.session.receive(self.clock.now(), &frame) {
                for message in Messages::<ToServer<'_>>::new(payload) {
                    let message = message.unwrap();
                    self.heard.push(format!("{message:?}"));
                    match message {
                        ToServer::Told { .. } => self.told += 1,
                        ToServer::DeliveryEnded { link, delivery, size, .. } => {
                            let (until, is_whole) = (size, true);
                            let stored = ToUnit::Stored { link, delivery, until, is_whole };
                            self.outbox.push(&stored, false);
                        }
                        _ => {}
                    }
                }
            }
        }
        let now = self.clock.now();
        self.session.handle_timeout(now);
        self.uplink.speak(&mut self.session, &mut self.outbox, now).unwrap();
        let mut events = Events::with_capacity(4);
        self.poll.poll(&mut events, Some(Duration::from_millis(20))).unwrap();
    }
}
