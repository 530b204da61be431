//! The thread that drives all units.

mod buses;
mod connection;
mod lane;

use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Waker;
use std::time::Duration;

use mio::{Events, Poll, Token};
use softplug_abi::Micros;
use softplug_unit_uplink::waker_of;

use super::{BusSetup, BusSurvey, UnitCommand, UnitLinkFigures, UnitSetup};
use crate::clock::Clock;
use crate::error::PortError;
use crate::reactor::{LaneId, LaneStatus, Report};
use buses::Buses;
use connection::Connection;
use lane::UnitLane;

const WAKER: Token = Token(usize::MAX);

pub(super) type Reports = Box<dyn Fn(LaneId, Report) + Send + Sync>;

/// What the thread is told.
pub(super) enum ThreadCommand {
    Add(LaneId, Box<UnitSetup>, Arc<LaneStatus>),
    Tell(LaneId, UnitCommand),
    Remove(LaneId),
    /// The buses that there are from now on.
    SetBuses(Vec<BusSetup>),
    /// A name was looked up for the connection with this number.
    Found(usize, std::io::Result<SocketAddr>),
    Stop,
}

/// What connections and lanes need of the thread.
pub(super) struct Thread {
    pub(super) poll: Poll,
    pub(super) clock: Clock,
    pub(super) waker: Waker,
    pub(super) commands: Sender<ThreadCommand>,
    pub(super) mio_waker: Arc<mio::Waker>,
    pub(super) reports: Reports,
    pub(super) identity: u64,
}

pub(super) struct Driver {
    thread: Thread,
    told: Receiver<ThreadCommand>,
    /// By number; none where the last lane of a unit has gone.
    connections: Vec<Option<Connection>>,
    lanes: HashMap<LaneId, usize>,
    buses: Buses,
    shown: Arc<Mutex<Shown>>,
    /// When it was shown last, and whether anything may have happened since.
    shown_at: Option<Micros>,
    is_news: bool,
}

/// What is shown is no older than this.
const SHOWN: Micros = Micros::from_millis(200);

/// Units and buses, as others see them.
#[derive(Debug, Default)]
pub(super) struct Shown {
    pub(super) links: HashMap<LaneId, UnitLinkFigures>,
    pub(super) buses: Vec<BusSurvey>,
}

impl Driver {
    pub(super) fn new(
        identity: u64,
        reports: Reports,
    ) -> Result<(Self, Sender<ThreadCommand>, Arc<mio::Waker>), PortError> {
        let failed = |error| PortError::io("set up the thread for units", error);
        let poll = Poll::new().map_err(failed)?;
        let mio_waker = Arc::new(mio::Waker::new(poll.registry(), WAKER).map_err(failed)?);
        let (commands, told) = channel();
        let thread = Thread {
            poll,
            clock: Clock::start(),
            waker: waker_of(Arc::clone(&mio_waker)),
            commands: commands.clone(),
            mio_waker: Arc::clone(&mio_waker),
            reports,
            identity,
        };
        let driver = Self {
            thread,
            told,
            connections: Vec::new(),
            lanes: HashMap::new(),
            buses: Buses::default(),
            shown: Arc::default(),
            shown_at: None,
            is_news: false,
        };
        Ok((driver, commands, mio_waker))
    }

    pub(super) fn shown(&self) -> Arc<Mutex<Shown>> {
        Arc::clone(&self.shown)
    }

    pub(super) fn run(mut self) {
        let mut events = Events::with_capacity(64);
        loop {
            while let Ok(command) = self.told.try_recv() {
                if matches!(command, ThreadCommand::Stop) {
                    return;
                }
                self.obey(command);
            }
            for connection in self.connections.iter_mut().flatten() {
                connection.turn(&self.thread);
            }
            self.buses.serve(&mut self.connections, &self.lanes, &self.thread);
            self.clear_away();
            self.show();
            let patience = self.patience();
            if let Err(error) = self.thread.poll.poll(&mut events, patience)
                && error.kind() != std::io::ErrorKind::Interrupted
            {
                tracing::error!(%error, "units are driven no further");
                return;
            }
        }
    }

    fn patience(&self) -> Option<Duration> {
        let due = self.connections.iter().flatten().filter_map(Connection::poll_timeout);
        let show = self.shown_at.filter(|_| self.is_news).map(|at| at + SHOWN);
        let due = due.chain(self.buses.poll_timeout()).chain(show).min()?;
        let wait = due - self.thread.clock.now();
        Some(Duration::from_micros(wait.max(Micros::ZERO).0 as u64))
    }

    fn obey(&mut self, command: ThreadCommand) {
        match command {
            ThreadCommand::Add(id, setup, status) => self.add(id, *setup, status),
            ThreadCommand::Tell(id, command) => {
                if let Some(connection) = self.of(id) {
                    let (connection, thread) = connection;
                    connection.tell(id, command, thread);
                }
            }
            ThreadCommand::Remove(id) => {
                if let Some((connection, thread)) = self.of(id) {
                    connection.remove(id, thread);
                }
            }
            ThreadCommand::SetBuses(setups) => self.buses.set(setups, self.thread.clock.now()),
            ThreadCommand::Found(number, found) => {
                if let Some(Some(connection)) = self.connections.get_mut(number) {
                    connection.found(found, &self.thread);
                }
            }
            ThreadCommand::Stop => {}
        }
    }

    fn of(&mut self, id: LaneId) -> Option<(&mut Connection, &Thread)> {
        let number = *self.lanes.get(&id)?;
        Some((self.connections.get_mut(number)?.as_mut()?, &self.thread))
    }

    fn add(&mut self, id: LaneId, mut setup: UnitSetup, status: Arc<LaneStatus>) {
        setup.bus = setup.bus.filter(|bus| self.buses.join(bus, id));
        let goes_to = |connection: &Option<Connection>| {
            connection.as_ref().is_some_and(|connection| connection.is_to(&setup))
        };
        let known = self.connections.iter().position(goes_to);
        let number = known.unwrap_or_else(|| self.add_connection(&setup));
        self.lanes.insert(id, number);
        if let Some(connection) = &mut self.connections[number] {
            connection.add(UnitLane::new(id, setup, status), &self.thread);
        }
    }

    fn add_connection(&mut self, setup: &UnitSetup) -> usize {
        let free = self.connections.iter().position(Option::is_none);
        let number = free.unwrap_or(self.connections.len());
        if free.is_none() {
            self.connections.push(None);
        }
        self.connections[number] = Some(Connection::new(number, setup, &self.thread));
        number
    }

    /// Lanes that have ended, and connections without any.
    fn clear_away(&mut self) {
        for place in &mut self.connections {
            let Some(connection) = place else { continue };
            for id in connection.take_ended() {
                self.lanes.remove(&id);
                self.buses.leave(id);
                (self.thread.reports)(id, Report::Removed);
            }
            if connection.is_empty() {
                connection.drop_uplink(&self.thread);
                *place = None;
            }
        }
    }

    /// Shows how things are, no oftener than need be.
    fn show(&mut self) {
        let now = self.thread.clock.now();
        self.is_news = self.shown_at.is_some_and(|at| now < at + SHOWN);
        if self.is_news {
            return;
        }
        self.shown_at = Some(now);
        let lanes = self.connections.iter().flatten().flat_map(Connection::lanes);
        let links = lanes.map(|lane| (lane.id(), lane.figures())).collect();
        let shown = Shown { links, buses: self.buses.survey(now) };
        *self.shown.lock().unwrap_or_else(PoisonError::into_inner) = shown;
    }
}
