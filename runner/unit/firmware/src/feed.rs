//! The job: one at a time, fed by credit, kept until its end has been noted.

use crate::outbox::Outbox;
use alloc::collections::VecDeque;
use softplug_abi::{Failure, JobId, Micros};
use softplug_link::Supply;
use softplug_unit_protocol::{CreditError, Fed, Outcome, ToServer};

/// Bytes between uplink and machine.
pub(crate) const BUFFER: usize = 4_096;
/// How often the server is told how far a job is.
const PROGRESS: Micros = Micros::from_millis(250);
/// Bytes that a plug-in may have taken and not yet passed on.
const IN_THE_PLUGIN: u64 = 1_024;

pub(crate) struct Feed {
    buffer: VecDeque<u8>,
    pub(crate) active: Option<Active>,
    /// Numbers for the link.
    next: JobId,
}

pub(crate) struct Active {
    /// The server's number.
    pub(crate) job: u64,
    /// The link's.
    pub(crate) of_link: JobId,
    pass: u8,
    fed: Fed,
    has_failed: bool,
    /// It is being aborted: its source has failed, or its data does not fit together.
    pub(crate) is_broken: bool,
    /// It asked for data and there was none.
    pub(crate) is_hungry: bool,
    pub(crate) taken: u64,
    /// Characters that the line was given before it.
    from: u64,
    /// What came of it, until the end is put together.
    pub(crate) ending: Option<Ending>,
    end: Option<End>,
    is_end_told: bool,
    told_at: Option<Micros>,
    told: (bool, bool),
}

/// How the plug-in ended it.
#[derive(Copy, Clone)]
pub(crate) struct Ending {
    pub(crate) outcome: Outcome,
    pub(crate) failure: Option<Failure>,
    pub(crate) status: u16,
    pub(crate) line: u32,
    pub(crate) column: u32,
    /// As the plug-in counts.
    pub(crate) sent: u64,
}

/// What has left the line, of all characters since the start, and what is known of the job's own bytes.
#[derive(Copy, Clone, Default)]
pub(crate) struct Position {
    pub(crate) maybe: u64,
    pub(crate) surely: u64,
    /// Bytes of the link's queue.
    pub(crate) waiting: u64,
    /// Bytes of the job's data of which some may have left or may leave yet.
    pub(crate) bytes_maybe: u64,
    pub(crate) is_held: bool,
    pub(crate) is_starved: bool,
}

#[derive(Copy, Clone)]
struct End {
    ending: Ending,
    taken: u64,
    maybe_left: u64,
    surely_left: u64,
    bytes_maybe_left: u64,
    bytes_surely_left: u64,
}

impl Active {
    fn bytes_surely_left(&self, maybe: u64, surely: u64, waiting: u64) -> u64 {
        let behind = waiting + (maybe - surely) + IN_THE_PLUGIN;
        self.taken.saturating_sub(behind).min(surely)
    }
}

impl Feed {
    pub(crate) fn new() -> Self {
        Self { buffer: VecDeque::with_capacity(BUFFER), active: None, next: JobId(1) }
    }

    pub(crate) fn is_under_way(&self) -> bool {
        self.active.as_ref().is_some_and(|active| active.end.is_none())
    }

    /// The job with this number, as long as it has not ended.
    pub(crate) fn under_way(&mut self, job: u64) -> Option<&mut Active> {
        self.active.as_mut().filter(|active| active.job == job && active.end.is_none())
    }

    pub(crate) fn of_link(&mut self, job: JobId) -> Option<&mut Active> {
        self.active.as_mut().filter(|active| active.of_link == job && active.end.is_none())
    }

    /// Job, pass, what has come, and whether that is all.
    pub(crate) fn received(&self) -> (u64, u8, u64, bool) {
        self.active.as_ref().map_or((0, 0, 0, false), |active| {
            (active.job, active.pass, active.fed.received(), active.fed.is_whole())
        })
    }

    /// A job begins; its number for the link.
    pub(crate) fn begin(&mut self, job: u64, from: u64) -> u32 {
        let of_link = self.next;
        self.next = of_link.next();
        self.buffer.clear();
        self.active = Some(Active {
            job,
            of_link,
            pass: 0,
            fed: Fed::default(),
            has_failed: false,
            is_broken: false,
            is_hungry: false,
            taken: 0,
            from,
            ending: None,
            end: None,
            is_end_told: false,
            told_at: None,
            told: (false, false),
        });
        of_link.0
    }

    /// Data of this pass; none where it was under way to a job or a pass that is over.
    pub(crate) fn data(
        &mut self,
        job: u64,
        pass: u8,
        at: u64,
        bytes: &[u8],
    ) -> Option<Result<(), CreditError>> {
        let fed = self.fed(job, pass)?.data(at, bytes.len() as u64);
        if fed.is_ok() {
            // There is room for what credit was given for.
            self.buffer.extend(bytes);
        }
        Some(fed)
    }

    /// The end of this pass' data.
    pub(crate) fn end(&mut self, job: u64, pass: u8, size: u64) -> Option<Result<(), CreditError>> {
        Some(self.fed(job, pass)?.end(size))
    }

    fn fed(&mut self, job: u64, pass: u8) -> Option<&mut Fed> {
        let active = self.under_way(job).filter(|active| active.pass == pass)?;
        (!active.is_broken).then_some(&mut active.fed)
    }

    /// There is no more of its data. Whether it is to be aborted.
    pub(crate) fn fail(&mut self, job: u64) -> bool {
        let Some(active) = self.under_way(job).filter(|active| !active.is_broken) else {
            return false;
        };
        (active.has_failed, active.is_broken) = (true, true);
        true
    }

    pub(crate) fn supply(&mut self, job: JobId, into: &mut [u8]) -> Supply {
        let count = into.len().min(self.buffer.len());
        let has_data = count > 0;
        let Some(active) =
            self.active.as_mut().filter(|active| active.of_link == job && active.end.is_none())
        else {
            return Supply::End;
        };
        // What is broken waits for its abort: it must not pass for whole.
        active.is_hungry = !has_data && (active.is_broken || !active.fed.is_whole());
        if !has_data {
            return if active.is_hungry { Supply::Later } else { Supply::End };
        }
        active.taken += count as u64;
        for (place, byte) in into.iter_mut().zip(self.buffer.drain(..count)) {
            *place = byte;
        }
        Supply::Bytes(count)
    }

    /// Whether the link waits for data that is there, or for the end.
    pub(crate) fn is_supplied(&self) -> bool {
        self.active.as_ref().is_some_and(|active| {
            let has_more = !self.buffer.is_empty() || active.fed.is_whole();
            active.is_hungry && has_more && !active.is_broken && active.end.is_none()
        })
    }

    /// Whether the job waits for data.
    pub(crate) fn is_hungry(&self) -> bool {
        let waits = |active: &Active| active.is_hungry && active.taken > 0 && active.end.is_none();
        self.active.as_ref().is_some_and(waits)
    }

    /// The check was good: the data comes once more.
    pub(crate) fn rewind(&mut self, of_link: JobId, outbox: &mut Outbox) {
        let Some(active) = self.of_link(of_link) else { return };
        (active.pass, active.fed, active.taken) = (1, Fed::default(), 0);
        active.is_hungry = false;
        let job = active.job;
        self.buffer.clear();
        outbox.say(&ToServer::Rewind { link: 0, job });
        self.give(true, outbox);
    }

    /// Credit, if there is notably more of it than before.
    pub(crate) fn give(&mut self, at_any_rate: bool, outbox: &mut Outbox) {
        let room = (BUFFER - self.buffer.len()) as u64;
        let Some(active) = self
            .active
            .as_mut()
            .filter(|active| active.end.is_none() && !active.is_broken && !active.fed.is_whole())
        else {
            return;
        };
        let is_worth_it = active.fed.received() + room >= active.fed.until() + BUFFER as u64 / 4;
        if at_any_rate || (is_worth_it && outbox.is_up) {
            active.fed.give(room);
            outbox.say(&ToServer::Credit {
                link: 0,
                job: active.job,
                pass: active.pass,
                received: active.fed.received(),
                until: active.fed.until(),
            });
        }
    }

    /// In a new session all is said again.
    pub(crate) fn tell_all(&mut self, outbox: &mut Outbox) {
        self.give(true, outbox);
        if let Some(active) = &mut self.active {
            (active.told_at, active.is_end_told) = (None, false);
        }
    }

    /// The job has ended, by its plug-in or with it.
    pub(crate) fn conclude(&mut self, ending: Ending, at: Position) {
        let Some(active) = self.active.as_mut().filter(|active| active.end.is_none()) else {
            return;
        };
        let is_done = ending.outcome == Outcome::Done;
        let (maybe, surely) = (at.maybe - active.from, at.surely - active.from);
        let mut ending = ending;
        if active.has_failed && !is_done {
            (ending.outcome, ending.failure) = (Outcome::SourceFailed, Some(Failure::Aborted));
        }
        // A plug-in counts what the line was given, and cannot know that it stopped there.
        ending.sent = if is_done { ending.sent } else { ending.sent.min(surely) };
        let bytes_surely_left = active.bytes_surely_left(maybe, surely, at.waiting);
        active.end = Some(End {
            ending,
            taken: active.taken,
            maybe_left: maybe,
            surely_left: surely,
            bytes_maybe_left: if is_done { active.taken } else { at.bytes_maybe },
            bytes_surely_left,
        });
        self.buffer.clear();
    }

    /// The end has been noted.
    pub(crate) fn noted(&mut self, job: u64) {
        self.active.take_if(|active| active.job == job && active.end.is_some());
    }

    /// Once in a session.
    pub(crate) fn tell_end(&mut self, outbox: &mut Outbox) {
        let Some(active) = self.active.as_mut().filter(|active| !active.is_end_told) else {
            return;
        };
        let Some(end) = active.end.filter(|_| outbox.is_up) else { return };
        active.is_end_told = true;
        let Ending { outcome, failure, status, line, column, sent } = end.ending;
        outbox.say(&ToServer::Ended {
            link: 0,
            job: active.job,
            outcome,
            failure,
            status,
            line,
            column,
            taken: end.taken,
            sent,
            maybe_left: end.maybe_left,
            surely_left: end.surely_left,
            bytes_maybe_left: end.bytes_maybe_left,
            bytes_surely_left: end.bytes_surely_left,
            why: "",
        });
    }

    /// How far the job is: from time to time, and when hold or starving changes.
    pub(crate) fn progress(&mut self, now: Micros, at: Position, outbox: &mut Outbox) {
        let level = self.buffer.len() as u32;
        let Some(active) = self.active.as_mut().filter(|active| active.end.is_none()) else {
            return;
        };
        let told = (at.is_held, at.is_starved);
        let is_due = active.told_at.is_none_or(|before| now >= before + PROGRESS);
        if !outbox.is_up || !(is_due || told != active.told) {
            return;
        }
        (active.told_at, active.told) = (Some(now), told);
        let (maybe_left, surely_left) = (at.maybe - active.from, at.surely - active.from);
        outbox.remark(&ToServer::Progress {
            link: 0,
            job: active.job,
            taken: active.taken,
            maybe_left,
            surely_left,
            bytes_left: active.bytes_surely_left(maybe_left, surely_left, at.waiting),
            level,
            is_held: at.is_held,
            is_starved: at.is_starved,
        });
    }
}
