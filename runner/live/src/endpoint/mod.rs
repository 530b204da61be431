//! A server endpoint of a link: other software connects, as to a device server,
//! and uses the link through it.
//!
//! What the client sends becomes the data of jobs; what the plug-in delivers goes
//! to the client. Nothing is taken from the connection before the plug-in wants
//! it, and nothing is delivered before the client takes it: TCP's window holds
//! either side.

mod client;
mod listener;
mod setup;
mod telnet;

pub use setup::{EndpointKind, EndpointSetup, Framing, LineAnswer};

use std::collections::VecDeque;
use std::io;
use std::net::{SocketAddr, TcpStream};
use std::ops::Range;

use mio::event::Event;
use mio::unix::SourceFd;
use mio::{Interest, Registry, Token};
use softplug_abi::Micros;
use softplug_link::Supply;

use self::client::{Client, Taken};
use self::listener::EndpointListener;
use crate::reactor::{Endpoint, EndpointNews, EndpointRequest, JobOutcome, LineNews};

/// Deliveries are sent once so many bytes are gathered: a packet of Ethernet.
const PACKET: usize = 1_400;
/// How often a client that takes nothing is looked at.
const LOOK_EVERY: Micros = Micros::from_millis(10_000);

/// A listener and at most one client, for a lane.
#[derive(Debug)]
pub struct ServerEndpoint {
    setup: EndpointSetup,
    tokens: Range<usize>,
    listener: EndpointListener,
    client: Option<Client>,
    /// A job of the client's is under way; its data may have ended.
    job: Option<Job>,
    /// The next data to come is dropped, up to a pause.
    is_dropping: bool,
    /// The client's job has failed: the connection ends.
    is_ending: bool,
    /// When the pause is long enough.
    gap_at: Option<Micros>,
    gather_until: Option<Micros>,
    look_at: Option<Micros>,
    now: Micros,
    news: VecDeque<EndpointNews>,
    requests: VecDeque<EndpointRequest>,
    drained: u32,
    /// The port as it is, while it is there.
    line: Option<LineNews>,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Job {
    /// More may come.
    Open,
    /// The pause was long enough: what is there is all.
    Closed,
    /// All was taken.
    Ended,
    /// The client is gone without having said all: it is aborted.
    Orphaned,
}

impl ServerEndpoint {
    /// Listens at once, so that the address is known. Where that fails, the lane
    /// that gets the endpoint tells it and tries again: the address may be
    /// another's for a moment.
    pub fn new(setup: EndpointSetup) -> Self {
        let (listener, failure) = EndpointListener::new(setup.listen);
        let news = failure.map(EndpointNews::Failed);
        Self {
            setup,
            tokens: 0..0,
            listener,
            client: None,
            job: None,
            is_dropping: false,
            is_ending: false,
            gap_at: None,
            gather_until: None,
            look_at: None,
            now: Micros::ZERO,
            news: news.into_iter().collect(),
            requests: VecDeque::new(),
            drained: 0,
            line: None,
        }
    }

    /// Where it listens, if it does.
    pub fn address(&self) -> Option<SocketAddr> {
        self.listener.address()
    }

    /// Accepts clients that want to connect, or turns them away.
    fn accept(&mut self, registry: &Registry) {
        while let Some((stream, address)) = self.listener.next(self.now) {
            match self.client.as_ref().map(Client::address) {
                None => self.let_in(registry, stream, address),
                Some(first) => {
                    Client::turn_away(&stream, first);
                    self.news.push_back(EndpointNews::Busy(address));
                }
            }
        }
    }

    fn let_in(&mut self, registry: &Registry, stream: TcpStream, address: SocketAddr) {
        let line = match &self.line {
            Some(LineNews::Up(line, _)) => Some(*line),
            _ => None,
        };
        let Ok(mut client) = Client::new(stream, address, &self.setup, line) else {
            return;
        };
        if self.register(registry, &client).is_err() {
            return;
        }
        if let Some(line) = &self.line {
            client.line_news(line);
        }
        self.client = Some(client);
        self.is_dropping = false;
        self.is_ending = false;
        self.gap_at = None;
        self.look_at = Some(self.now + LOOK_EVERY);
        self.news.push_back(EndpointNews::Connected(address));
    }

    fn register(&self, registry: &Registry, client: &Client) -> io::Result<()> {
        let token = Token(self.tokens.start + 1);
        let both = Interest::READABLE | Interest::WRITABLE;
        registry.register(&mut SourceFd(&client.fd()), token, both)
    }

    fn hang_up(&mut self, registry: &Registry) {
        let Some(mut client) = self.client.take() else { return };
        let _ = registry.deregister(&mut SourceFd(&client.fd()));
        self.drained += client.drained() + client.waiting() as u32;
        self.gather_until = None;
        self.look_at = None;
        self.news.push_back(EndpointNews::Disconnected(client.address()));
        if matches!(self.job, Some(Job::Open | Job::Closed)) {
            // It may not pass for whole.
            self.job = Some(Job::Orphaned);
            self.requests.push_back(EndpointRequest::Purge);
        }
    }

    fn serve(&mut self, registry: &Registry) {
        let now = self.now;
        let is_gathered = self.gather_until.is_none_or(|until| until <= now);
        let Some(client) = &mut self.client else { return };
        client.flush(is_gathered || client.waiting() >= PACKET);
        if client.waiting() == 0 {
            self.gather_until = None;
        }
        if self.job.is_none() {
            client.peek();
        }
        while self.is_dropping && client.has_data() {
            client.drop_front();
            client.peek();
        }
        client.purge();
        while let Some(request) = client.next_request() {
            self.requests.push_back(request);
        }
        if client.has_heard()
            && let Framing::Gap(gap) = self.setup.framing
        {
            self.gap_at = Some(now + gap);
        }
        if self.gap_at.is_some_and(|at| at <= now) {
            self.gap_at = None;
            // If there is more, the pause begins when that has been taken.
            if !client.may_have_data() {
                self.is_dropping = false;
                if self.job == Some(Job::Open) {
                    self.job = Some(Job::Closed);
                }
            }
        }
        self.look_after_client(registry);
    }

    /// Hangs up on a client that is gone, or that is done.
    fn look_after_client(&mut self, registry: &Registry) {
        let Some(client) = &mut self.client else { return };
        let is_done = self.job.is_none() && client.is_done();
        let is_due = self.look_at.is_some_and(|at| at <= self.now);
        if is_due {
            self.look_at = Some(self.now + LOOK_EVERY);
        }
        let is_dead = is_due && client.has_output() && client.is_dead();
        if client.is_lost() || is_done || is_dead || self.is_ending {
            self.hang_up(registry);
        }
    }

    /// The lane's clock begins anew when its port first opens: what was to come
    /// is looked at at once.
    fn set_time(&mut self, now: Micros) {
        if now < self.now {
            self.listener.look_at(now);
            for at in [&mut self.gap_at, &mut self.gather_until, &mut self.look_at] {
                *at = at.map(|_| now);
            }
        }
        self.now = now;
    }
}

impl Endpoint for ServerEndpoint {
    fn attach(&mut self, registry: &Registry, tokens: Range<usize>) -> io::Result<()> {
        self.tokens = tokens;
        if let Some(client) = &self.client {
            self.register(registry, client)?;
        }
        self.listener.attach(registry, Token(self.tokens.start), self.now)
    }

    fn leave(&mut self, registry: &Registry) {
        if let Some(client) = &self.client {
            let _ = registry.deregister(&mut SourceFd(&client.fd()));
        }
        self.listener.leave(registry);
    }

    fn ready(&mut self, _registry: &Registry, event: &Event, now: Micros) {
        self.set_time(now);
        if event.token().0 == self.tokens.start {
            self.listener.ready();
        } else if let Some(client) = &mut self.client {
            client.ready(event);
        }
    }

    fn poll_timeout(&self) -> Option<Micros> {
        let has_more = self.news.len() + self.requests.len() > 0
            || self.is_ending
            || self.client.as_ref().is_some_and(|client| {
                client.is_lost() || self.job.is_none() && (client.has_unread() || client.is_done())
            });
        if has_more {
            return Some(self.now);
        }
        [self.listener.poll_timeout(), self.gap_at, self.gather_until, self.look_at]
            .into_iter()
            .flatten()
            .min()
    }

    fn turn(&mut self, registry: &Registry, now: Micros) {
        self.set_time(now);
        if let Some(failure) = self.listener.turn(registry, now) {
            self.news.push_back(EndpointNews::Failed(failure));
        }
        self.serve(registry);
        self.accept(registry);
        if self.client.is_some() && self.job.is_none() {
            self.serve(registry);
        }
    }

    fn next_news(&mut self) -> Option<EndpointNews> {
        self.news.pop_front()
    }

    fn next_request(&mut self) -> Option<EndpointRequest> {
        self.requests.pop_front()
    }

    fn wants_job(&self) -> bool {
        let has_data = || self.client.as_ref().is_some_and(Client::has_data);
        self.job.is_none() && !self.is_dropping && !self.is_ending && has_data()
    }

    fn job_begun(&mut self) {
        self.job = Some(Job::Open);
    }

    fn supply(&mut self, buffer: &mut [u8]) -> Supply {
        let (Some(client), Some(job)) = (&mut self.client, self.job) else {
            // Its client is gone; that it be aborted is asked for already.
            return Supply::Later;
        };
        let taken = match job {
            Job::Open => client.take(buffer),
            Job::Closed if client.has_data() => client.take(buffer),
            Job::Closed | Job::Ended => Taken::End,
            Job::Orphaned => Taken::Nothing,
        };
        match taken {
            Taken::Bytes(count) => Supply::Bytes(count),
            Taken::Nothing => Supply::Later,
            Taken::End => {
                self.job = Some(Job::Ended);
                Supply::End
            }
        }
    }

    fn has_supply(&self) -> bool {
        let Some(client) = &self.client else { return false };
        match self.job {
            Some(Job::Open) => client.may_have_data() || client.has_said_all(),
            Some(Job::Closed | Job::Ended) => true,
            Some(Job::Orphaned) | None => false,
        }
    }

    fn job_ended(&mut self, outcome: &JobOutcome) {
        let is_orphan = self.job.take() == Some(Job::Orphaned);
        let Some(client) = self.client.as_mut().filter(|_| !is_orphan) else { return };
        if *outcome == JobOutcome::Done {
            return;
        }
        match self.setup.framing {
            Framing::Stream => self.is_ending = true,
            Framing::Gap(gap) => {
                client.drop_front();
                self.is_dropping = true;
                self.gap_at = Some(self.now + gap);
            }
        }
    }

    fn takes_deliveries(&self) -> bool {
        self.client.as_ref().is_some_and(|client| !client.is_lost())
    }

    fn deliver(&mut self, bytes: &[u8]) {
        let Some(client) = &mut self.client else {
            // It went in the middle of a delivery.
            self.drained += bytes.len() as u32;
            return;
        };
        client.deliver(bytes);
        if self.setup.gather == Micros::ZERO || client.waiting() >= PACKET {
            client.flush(true);
        } else if self.gather_until.is_none() {
            self.gather_until = Some(self.now + self.setup.gather);
        }
    }

    fn delivery_ended(&mut self) {
        self.gather_until = None;
        if let Some(client) = &mut self.client {
            client.flush(true);
        }
    }

    fn drained(&mut self) -> u32 {
        let client = self.client.as_mut().map_or(0, Client::drained);
        client + std::mem::take(&mut self.drained)
    }

    fn line_news(&mut self, news: &LineNews) {
        if let LineNews::Up(line, lines) = news {
            self.line = Some(LineNews::Up(*line, *lines));
        } else if let (LineNews::ModemLines(known, on), Some(LineNews::Up(_, lines))) =
            (news, &mut self.line)
        {
            *lines = Some((*known, *on));
        } else if *news == LineNews::Down {
            self.line = None;
        }
        if let Some(client) = &mut self.client {
            client.line_news(news);
            client.flush(false);
        }
    }

    fn detach(&mut self, registry: &Registry) {
        if let Some(client) = self.client.take() {
            let _ = registry.deregister(&mut SourceFd(&client.fd()));
        }
        self.listener.detach(registry);
    }
}
