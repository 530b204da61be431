//! A tap: sits between two ports, passes everything on, and tells what passed.
//!
//! Bytes pass both ways at once and unaltered, in bounded queues: a side that
//! takes nothing holds the other one up, as a cable with flow control would.
//! Line errors, breaks and modem lines pass as far as the ports can make them;
//! what they cannot is told once.

mod lines;
mod queue;
mod way;

use std::fmt;

use softplug_abi::{LinkDownReason, Micros, ModemLines};

use crate::clock::Clock;
use crate::error::PortError;
use crate::pacer::default_depth;
use crate::poll::{Interest, Poller, Source, Waker};
use crate::port::{Input, Port};
use lines::Lines;
use way::{Read, Way};

/// Rounds of one turn at the most: then whoever drives the tap has its say.
const ROUNDS: usize = 16;
/// How often modem lines are looked at.
const MODEM_LINES_EVERY: Micros = Micros::from_millis(20);
/// How long the tap tries to pass on what it still holds when it ends.
const PATIENCE: Micros = Micros::from_secs(1);

/// One of the two ports.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Side {
    /// The first.
    A,
    /// The second.
    B,
}

impl Side {
    /// The opposite side.
    pub const fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }

    const fn index(self) -> usize {
        self as usize
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::A => "a",
            Self::B => "b",
        })
    }
}

/// What the tap saw or did.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Event<'a> {
    /// This came from the program or machine on a side.
    Heard {
        /// Where it came from.
        from: Side,
        /// What came.
        what: Input<'a>,
    },
    /// This was given to the port of a side. A damaged character is passed on
    /// as it was read.
    Passed {
        /// Where it went.
        to: Side,
        /// What went.
        what: Input<'a>,
    },
    /// The partner on a side set its lines so; they are named as our port there
    /// sees them.
    Lines {
        /// Where the partner is.
        from: Side,
        /// Lines that the port has.
        known: ModemLines,
        /// Those of them that are on.
        on: ModemLines,
    },
    /// The port of a side cannot do what the other side did. Told once for each.
    Cannot {
        /// Whose port.
        side: Side,
        /// Completes "this port cannot …".
        what: &'static str,
    },
}

/// What a turn left behind.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Turn {
    /// Go on.
    Live,
    /// A port is gone: [`Tap::finish`], then end.
    Gone(Side, LinkDownReason),
}

/// Two ports with everything passing between them.
#[derive(Debug)]
pub struct Tap {
    ports: [Port; 2],
    /// By where it comes from.
    ways: [Way; 2],
    lines: Lines,
    poller: Poller,
    gone: Option<(Side, LinkDownReason)>,
}

impl Tap {
    /// A tap between two open ports.
    pub fn new(a: Port, b: Port) -> Result<Self, PortError> {
        let ports = [a, b];
        let way = |from: Side| {
            let to = &ports[from.other().index()];
            let depth = default_depth(to.line().baud).max(2);
            Way::new(from, ports[from.index()].rate_known(), to, depth)
        };
        let ways = [way(Side::A), way(Side::B)];
        let lines = Lines::new(&ports);
        Ok(Self { ports, ways, lines, poller: Poller::new(Clock::start())?, gone: None })
    }

    /// The port of a side.
    pub fn port(&self, side: Side) -> &Port {
        &self.ports[side.index()]
    }

    /// Time on the tap's clock.
    pub fn now(&self) -> Micros {
        self.poller.clock().now()
    }

    /// Ends a [`turn`](Self::turn)'s wait from another thread.
    pub fn waker(&self) -> Waker {
        self.poller.waker()
    }

    /// The partner's modem lines on a side when the tap was made, as our port
    /// there sees them; `None` if it has none.
    pub fn modem_lines(&self, side: Side) -> Option<(ModemLines, ModemLines)> {
        self.lines.seen(side)
    }

    /// Bytes that came from a side and were not passed on yet.
    pub fn held(&self, from: Side) -> usize {
        self.ways[from.index()].held()
    }

    /// One turn: passes on what is there, then waits until there is more or
    /// `until` has come. `sink` is given every event with its time.
    pub fn turn(
        &mut self,
        until: Micros,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<Turn, PortError> {
        for _ in 0..ROUNDS {
            let now = self.now();
            self.lines.pass(&mut self.ports, &mut |event| sink(now, event))?;
            let mut moved = false;
            for from in [Side::A, Side::B] {
                self.attend(from, now)?;
                moved |= self.read(from, sink)?;
                moved |= self.write(from, sink)?;
            }
            if let Some((side, reason)) = self.gone {
                return Ok(Turn::Gone(side, reason));
            }
            if !moved {
                self.wait(until, true)?;
                break;
            }
        }
        Ok(Turn::Live)
    }

    /// Reads no more and passes on what is still held, for a second at most.
    /// Gives what could not be passed on, by the side that it came from.
    pub fn finish(
        &mut self,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<[usize; 2], PortError> {
        let until = self.now() + PATIENCE;
        loop {
            for from in [Side::A, Side::B] {
                while self.is_open(from.other()) && self.write(from, sink)? {}
                let now = self.now();
                self.attend(from, now)?;
            }
            let is_done = |from: Side| self.held(from) == 0 || !self.is_open(from.other());
            if (is_done(Side::A) && is_done(Side::B)) || self.now() >= until {
                break;
            }
            self.wait(until, false)?;
        }
        for way in &mut self.ways {
            let to = way.from().other();
            way.end_break(&mut self.ports[to.index()])?;
        }
        Ok([self.held(Side::A), self.held(Side::B)])
    }

    /// Lets a port do what it does of its own.
    fn attend(&mut self, side: Side, now: Micros) -> Result<(), PortError> {
        match self.ports[side.index()].handle_timeout(now) {
            Err(PortError::Gone(reason)) => {
                self.gone.get_or_insert((side, reason));
                Ok(())
            }
            attended => attended,
        }
    }

    fn is_open(&self, side: Side) -> bool {
        self.gone.is_none_or(|(gone, _)| gone != side)
    }

    fn read(
        &mut self,
        from: Side,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<bool, PortError> {
        if self.gone.is_some() {
            return Ok(false);
        }
        let clock = self.poller.clock();
        let way = &mut self.ways[from.index()];
        match way.read(&mut self.ports[from.index()], clock, sink)? {
            Read::Some => Ok(true),
            Read::Nothing => Ok(false),
            Read::Gone(reason) => {
                self.gone = Some((from, reason));
                Ok(false)
            }
        }
    }

    fn write(
        &mut self,
        from: Side,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<bool, PortError> {
        let to = from.other();
        let clock = self.poller.clock();
        let way = &mut self.ways[from.index()];
        match way.write(&mut self.ports[to.index()], clock, sink) {
            Err(PortError::Gone(reason)) => {
                // What the other side said first is what counts.
                self.gone.get_or_insert((to, reason));
                Ok(false)
            }
            written => written,
        }
    }

    fn wait(&mut self, until: Micros, reads: bool) -> Result<(), PortError> {
        let now = self.now();
        let mut interests = [Interest { read: false, write: false }; 2];
        let mut deadline = until;
        for way in &self.ways {
            let from = way.from();
            let to = from.other();
            interests[from.index()].read = reads && way.has_room();
            if !self.is_open(to) {
                continue;
            }
            let port = &self.ports[to.index()];
            let waits = way.waits_for_port(now) && !port.is_suspended();
            interests[to.index()].write = waits || port.has_output();
            if let Some(attention) = port.poll_timeout() {
                deadline = deadline.min(attention);
            }
            if let Some(next) = way.poll_timeout(now) {
                deadline = deadline.min(next);
            }
        }
        if self.lines.are_watched() {
            deadline = deadline.min(now + MODEM_LINES_EVERY);
        }
        let (ports, gone) = (&self.ports, self.gone);
        let fds = [Side::A, Side::B].map(|side| {
            // A port that has hung up would end every wait.
            let interest = interests[side.index()];
            let is_open = gone.is_none_or(|(gone, _)| gone != side);
            let is_wanted = is_open && (interest.read || interest.write);
            is_wanted.then(|| (&ports[side.index()] as &dyn Source, interest))
        });
        self.poller.wait_both(fds, Some(deadline))
    }
}
