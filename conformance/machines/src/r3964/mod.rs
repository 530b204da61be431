//! A simulated machine that speaks 3964R, 3964 or simplified 3964R, with faults
//! on demand.
//!
//! ```
//! use softplug_abi::{LineParameters, Micros};
//! use softplug_machines::r3964::{Options, Station};
//!
//! let line = LineParameters::new(0);
//! let mut station = Station::new(Options { line, nak_at_start: false, ..Options::default() })?;
//! station.send(Micros::ZERO, b"123".to_vec());
//! // STX, then DLE from the other side, then the block and its check character.
//! assert_eq!(station.poll_transmit(Micros(0)), Some(0x02));
//! station.receive(Micros(5_000), 0x10);
//! let block: Vec<u8> = std::iter::from_fn(|| station.poll_transmit(Micros(5_000))).collect();
//! assert_eq!(block, [0x31, 0x32, 0x33, 0x10, 0x03, 0x23]);
//! station.receive(Micros(9_000), 0x10);
//! assert_eq!(station.report().sent[0].result, Ok(()));
//! # Ok::<(), softplug_machines::r3964::OptionsError>(())
//! ```

mod faults;
mod frame;
mod noise;
mod options;
mod procedure;
mod receiver;
mod report;
pub mod rk512;
mod sender;
#[cfg(test)]
mod tests;
mod transmitter;

use std::collections::VecDeque;

use softplug_abi::{LineErrorKind, Micros};

use self::faults::Schedule;
use self::frame::NAK;
use self::receiver::Reception;
use self::sender::Job;
use self::transmitter::{Item, Role, Transmitter};
use crate::{Partner, Signal};

pub use self::faults::{Fault, Faults, Occasion, When};
pub use self::noise::{Arrival, Noise, Noisy};
pub use self::options::{Options, OptionsError, Priority};
pub use self::report::{Error, Received, Report, Sent};

/// One end of a line that speaks the procedure.
///
/// Time never runs backwards: an earlier `now` counts as the last one. After
/// every call, ask [`next_event`](Self::next_event) again.
///
/// ```
/// use softplug_abi::{LineParameters, Micros};
/// use softplug_machines::r3964::{Options, Received, Station};
///
/// let line = LineParameters::new(0);
/// let mut station = Station::new(Options { line, nak_at_start: false, ..Options::default() })?;
/// // STX is answered by DLE, and so is a block with the right check character.
/// station.receive(Micros(1_000), 0x02);
/// assert_eq!(station.poll_transmit(Micros(1_000)), Some(0x10));
/// for byte in [0x31, 0x32, 0x33, 0x10, 0x03, 0x23] {
///     station.receive(Micros(2_000), byte);
/// }
/// assert_eq!(station.poll_transmit(Micros(2_000)), Some(0x10));
/// let block = Received { at: Micros(2_000), data: b"123".to_vec() };
/// assert_eq!(station.report().received, [block]);
/// # Ok::<(), softplug_machines::r3964::OptionsError>(())
/// ```
#[derive(Debug)]
pub struct Station {
    options: Options,
    schedule: Schedule,
    transmitter: Transmitter,
    state: State,
    /// When the state's time runs out.
    deadline: Option<Micros>,
    /// Blocks that wait.
    jobs: VecDeque<Vec<u8>>,
    /// The block that is being sent; it stays while the other side goes first.
    job: Option<Job>,
    /// The block that is being received, over its repetitions.
    reception: Option<Reception>,
    /// When the last STX, and the last DLE for one, had left.
    start_left: Micros,
    answer_left: Micros,
    report: Report,
    now: Micros,
}

/// Where a station stands.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum State {
    Idle,
    /// Stray characters came: ZVZ of silence, then NAK.
    Garbage,
    /// STX is on its way or has left: DLE within QVZ.
    Connecting,
    /// The block is leaving.
    Sending,
    /// The block was stopped by a stray character: ZVZ of silence, NAK, STX.
    Clearing,
    /// The block has left: DLE within QVZ.
    AwaitingEnd,
    /// STX came and there is no buffer.
    AwaitingBuffer,
    /// DLE for an STX has not left yet.
    Answering,
    /// The next character of the block within ZVZ.
    Receiving,
    /// A bad block was answered by NAK: STX within BWZ.
    AwaitingRepeat,
    /// Deaf and dumb on purpose.
    Silent,
}

impl Station {
    /// A station at time 0.
    ///
    /// # Errors
    /// Its settings contradict each other.
    pub fn new(options: Options) -> Result<Self, OptionsError> {
        options.check()?;
        let mut transmitter = Transmitter::new(options.line);
        if options.nak_at_start {
            transmitter.push(Item::Character(NAK, Role::Nak));
            transmitter.feed(Micros::ZERO);
        }
        Ok(Self {
            schedule: Schedule::new(&options.faults),
            transmitter,
            state: State::Idle,
            deadline: None,
            jobs: VecDeque::new(),
            job: None,
            reception: None,
            start_left: Micros::ZERO,
            answer_left: Micros::ZERO,
            report: Report::default(),
            now: Micros::ZERO,
            options,
        })
    }

    /// Sends a block once those before it are done. One over the block size is
    /// sent all the same: what the other side makes of it is its affair.
    pub fn send(&mut self, now: Micros, block: Vec<u8>) {
        self.advance(now);
        self.jobs.push_back(block);
        self.rest();
        self.transmitter.feed(self.now);
    }

    /// Makes no more faults from now on.
    pub fn behave(&mut self) {
        self.schedule = Schedule::new(&Faults::default());
    }

    /// A character's stop bit ended now.
    pub fn receive(&mut self, now: Micros, byte: u8) {
        self.begin(now);
        self.take(Some(byte));
        self.settle(self.now, true);
    }

    /// A damaged character or a break ended now.
    pub fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind) {
        self.begin(now);
        if kind == LineErrorKind::Break {
            self.take_break();
        } else {
            self.take(None);
        }
        self.settle(self.now, true);
    }

    /// When something can next be seen of the station from outside; call
    /// [`advance`](Self::advance) then.
    pub fn next_event(&self) -> Option<Micros> {
        [self.transmitter.next_signal(), self.next()].into_iter().flatten().min()
    }

    /// Does all that is due by now, each thing at its own time.
    pub fn advance(&mut self, now: Micros) {
        let now = now.max(self.now);
        if let Some(due) = self.next() {
            self.report.late = self.report.late.max(now - due);
        }
        self.settle(now, true);
    }

    /// The next character whose last bit has left by now; breaks are passed over.
    pub fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        loop {
            if let Signal::Character(byte) = self.poll_signal(now)? {
                return Some(byte);
            }
        }
    }

    /// The next character or break that has left by now. A time that runs out
    /// just now has not run out yet: what the other side says first may come in
    /// time.
    pub fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.begin(now);
        while let Some(role) = self.transmitter.leave(self.now) {
            self.left(role);
            self.transmitter.feed(self.now);
        }
        self.transmitter.poll(self.now)
    }

    /// What has happened so far.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Its own blocks that are not done yet.
    pub fn waiting(&self) -> usize {
        self.jobs.len() + usize::from(self.job.is_some())
    }

    /// The block that it is sending or is about to send, and since when.
    pub fn under_way(&self) -> Option<(Micros, &[u8])> {
        self.job.as_ref().map(|job| (job.begun, job.data.as_slice()))
    }

    /// Whether it does nothing and has nothing to do.
    pub fn is_idle(&self) -> bool {
        self.state == State::Idle
            && self.waiting() == 0
            && self.transmitter.is_silent()
            && self.reception.is_none()
    }

    fn next(&self) -> Option<Micros> {
        [self.transmitter.next(), self.deadline].into_iter().flatten().min()
    }

    /// What was due before an arrival. A character that ends at a deadline comes
    /// in time.
    fn begin(&mut self, now: Micros) {
        let now = now.max(self.now);
        if let Some(due) = self.next().filter(|due| *due < now) {
            self.report.late = self.report.late.max(now - due);
        }
        self.settle(now, false);
    }

    fn settle(&mut self, now: Micros, with_now: bool) {
        loop {
            self.transmitter.feed(self.now);
            let due = |at: &Micros| *at < now || with_now && *at == now;
            let Some(at) = self.next().filter(due) else { break };
            self.now = self.now.max(at);
            if self.transmitter.next() == Some(at) {
                if let Some(role) = self.transmitter.advance(at) {
                    self.left(role);
                }
            } else {
                self.deadline = None;
                self.time_out();
            }
        }
        self.now = now;
        self.transmitter.feed(self.now);
    }
}

impl Partner for Station {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.poll_transmit(now)
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, _byte: Option<u8>) {
        self.receive_damaged(now, kind);
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.poll_signal(now)
    }
}
