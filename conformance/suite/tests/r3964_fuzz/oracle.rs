//! What must hold of a run, whatever went wrong in it.

use softplug_abi::Micros;
use softplug_machines::Signal;
use softplug_machines::r3964::{Arrival, Options, Station};

use crate::pair::PluginEnd;

/// A block that one end was to send.
pub(crate) struct Job {
    pub(crate) begun: Micros,
    pub(crate) ended: Micros,
    pub(crate) data: Vec<u8>,
    pub(crate) is_done: bool,
}

/// What one end did, as its host and the line saw it.
pub(crate) struct Side {
    pub(crate) jobs: Vec<Job>,
    pub(crate) delivered: Vec<(Micros, Vec<u8>)>,
    /// When each DLE for a good block had left, and for which delivery.
    pub(crate) acknowledged: Vec<(Micros, usize)>,
    /// What was sent, if the line was watched: start, end, byte.
    pub(crate) emitted: Option<Vec<(Micros, Micros, u8)>>,
}

/// Counts of what no implementation can see, and of what was seen.
#[derive(Copy, Clone, Default, Debug)]
pub(crate) struct Tally {
    pub(crate) jobs: usize,
    pub(crate) done: usize,
    pub(crate) delivered: usize,
    /// Blocks that arrived more often than once.
    pub(crate) repeated: usize,
    /// Jobs done by a DLE that was not sent for them.
    pub(crate) forged: usize,
    /// Blocks altered on the line whose check is right all the same.
    pub(crate) colliding: usize,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.jobs += other.jobs;
        self.done += other.done;
        self.delivered += other.delivered;
        self.repeated += other.repeated;
        self.forged += other.forged;
        self.colliding += other.colliding;
    }
}

impl Side {
    pub(crate) fn of_station(station: &Station) -> Self {
        let report = station.report();
        let sent = report.sent.iter().map(|sent| Job {
            begun: sent.begun,
            ended: sent.ended,
            data: sent.data.clone(),
            is_done: sent.result.is_ok(),
        });
        let under_way = station.under_way().map(|(begun, data)| Job {
            begun,
            ended: Micros::MAX,
            data: data.to_vec(),
            is_done: false,
        });
        Self {
            jobs: sent.chain(under_way).collect(),
            delivered: report.received.iter().map(|one| (one.at, one.data.clone())).collect(),
            acknowledged: report.acknowledged.clone(),
            emitted: None,
        }
    }

    pub(crate) fn of_plugin(plugin: &PluginEnd) -> Self {
        let host = &plugin.host;
        let jobs = host.jobs.iter().map(|job| Job {
            begun: job.begun,
            ended: job.ended.unwrap_or(Micros::MAX),
            data: job.data.clone(),
            is_done: matches!(job.result, Some(Ok(_))),
        });
        let good = host.delivered.iter().filter(|delivered| delivered.result.is_ok());
        let delivered: Vec<_> = good.map(|one| (one.at, one.data.clone())).collect();
        // The first character after a good delivery is its DLE.
        let acknowledged = delivered
            .iter()
            .enumerate()
            .filter_map(|(place, (at, _))| {
                let next = host.emitted.iter().find(|(start, ..)| start >= at)?;
                (next.2 == 0x10).then_some((next.1, place))
            })
            .collect();
        Self { jobs: jobs.collect(), delivered, acknowledged, emitted: Some(host.emitted.clone()) }
    }
}

/// One direction of a run.
pub(crate) struct Direction<'a> {
    pub(crate) sender: &'a Side,
    pub(crate) receiver: &'a Side,
    /// What came to the sender, and to the receiver.
    pub(crate) to_sender: &'a [Arrival],
    pub(crate) to_receiver: &'a [Arrival],
    pub(crate) options: &'a Options,
    /// How many things went wrong in the run.
    pub(crate) disturbances: usize,
    /// How long after its job has ended a block may arrive.
    pub(crate) reach: Micros,
    /// Without a rule for conflicts, repeated STXs can become data on the
    /// soundest line; and so can the NAK and STX that follow an aborted block.
    pub(crate) is_ambiguous: bool,
    /// How late a port may give what arrived.
    pub(crate) latency: Micros,
}

impl Direction<'_> {
    pub(crate) fn judge(&self) -> Result<Tally, String> {
        let mut tally = Tally {
            jobs: self.sender.jobs.len(),
            done: self.sender.jobs.iter().filter(|job| job.is_done).count(),
            delivered: self.receiver.delivered.len(),
            ..Tally::default()
        };
        let mut deliveries = vec![0_usize; self.sender.jobs.len()];
        for (at, data) in &self.receiver.delivered {
            match self.job_of(*at, data, &deliveries) {
                Some(job) => deliveries[job] += 1,
                None if self.is_colliding(*at, data) => tally.colliding += 1,
                None => {
                    return Err(format!("at {at} was delivered, but not sent: {}", hex(data)));
                }
            }
        }
        tally.repeated = deliveries.iter().map(|count| count.saturating_sub(1)).sum();
        // A DLE that is lost or late can spoil all tries of a block.
        let most = self.disturbances * self.options.transmission_attempts as usize;
        if tally.repeated > most {
            return Err(format!(
                "{} blocks arrived twice where only {} things went wrong",
                tally.repeated, self.disturbances
            ));
        }
        for (place, job) in self.sender.jobs.iter().enumerate().filter(|(_, job)| job.is_done) {
            let dle = self.accepted(job)?;
            if deliveries[place] == 0 {
                match self.cause(job, dle)? {
                    Cause::Forged => tally.forged += 1,
                    Cause::Colliding => {}
                }
            }
        }
        Ok(tally)
    }

    /// The job whose block this is: the one under way, or one before if the port
    /// is deep or the line delays. Of several at one instant, with the same data, the first that
    /// has not arrived.
    fn job_of(&self, at: Micros, data: &[u8], deliveries: &[usize]) -> Option<usize> {
        let jobs = &self.sender.jobs;
        let begun = jobs.iter().rposition(|job| job.begun <= at)?;
        let is_of = |place: &usize| jobs[*place].data == data;
        let is_under_way = |place: &usize| is_of(place) && jobs[*place].ended >= at;
        let is_recent = |place: &usize| jobs[*place].ended + self.reach >= at;
        let is_last = |place: &usize| is_of(place) && (*place + 1 >= begun || is_recent(place));
        let is_new = |place: &usize| deliveries[*place] == 0;
        let places = || 0..=begun;
        places()
            .find(|place| is_under_way(place) && is_new(place))
            .or_else(|| places().find(|place| is_last(place) && is_new(place)))
            .or_else(|| places().rfind(is_under_way))
            .or_else(|| places().rfind(is_last))
    }

    /// Whether the line altered something of this block, and the character that
    /// completed it checks.
    fn is_colliding(&self, at: Micros, data: &[u8]) -> bool {
        let since = self.sender.jobs.iter().rfind(|job| job.begun <= at).map(|job| job.begun);
        let Some(since) = since else { return self.disturbances > 0 && self.checks(at, data) };
        let in_time = |arrival: &&Arrival| arrival.at >= since && arrival.at <= at;
        // Lost characters leave nothing behind, so that all of the run counts.
        let is_altered = self.to_receiver.iter().filter(in_time).any(|one| one.is_altered);
        (is_altered || self.disturbances > 0 || self.is_ambiguous) && self.checks(at, data)
    }

    fn checks(&self, at: Micros, data: &[u8]) -> bool {
        let block = self.block(data);
        let came: Vec<_> = self.to_receiver.iter().filter(|arrival| arrival.at <= at).collect();
        let is_block = |arrivals: &[&Arrival]| {
            let mut both = arrivals.iter().zip(&block);
            both.all(|(arrival, byte)| arrival.signal == Signal::Character(*byte))
        };
        came.windows(block.len())
            .rev()
            .take_while(|window| window[block.len() - 1].at + self.latency >= at)
            .any(is_block)
    }

    /// The DLE that ended the job, at the very time of its end. The block must
    /// have left before, whole and unaltered, and not longer ago than QVZ.
    fn accepted(&self, job: &Job) -> Result<Arrival, String> {
        let at_end = |arrival: &&Arrival| {
            arrival.at + self.latency >= job.begun
                && arrival.at <= job.ended
                && arrival.at + self.latency >= job.ended
                && arrival.signal == Signal::Character(0x10)
        };
        let mut why = "no DLE came then".to_owned();
        for dle in self.to_sender.iter().filter(at_end) {
            match self.may_be_accepted(job, *dle) {
                Ok(()) => return Ok(*dle),
                Err(reason) => why = reason,
            }
        }
        Err(format!("the job of {} was done at {}, but {why}", job.begun, job.ended))
    }

    fn may_be_accepted(&self, job: &Job, dle: Arrival) -> Result<(), String> {
        let Some(emitted) = &self.sender.emitted else { return Ok(()) };
        // The plug-in knows of it when the port gives it.
        let seen = job.ended;
        let before = |(start, end, _): &&(Micros, Micros, u8)| *start < seen && *end <= seen;
        let left: Vec<_> = emitted.iter().filter(before).collect();
        let bytes: Vec<u8> = left.iter().map(|(.., byte)| *byte).collect();
        let block = self.block(&job.data);
        if !bytes.ends_with(&block) {
            let last = &bytes[bytes.len().saturating_sub(block.len() + 8)..];
            return Err(format!(
                "its block had not left before the DLE of {}: {}",
                dle.at,
                hex(last)
            ));
        }
        let end = left.last().map_or(Micros::ZERO, |(_, end, _)| *end);
        if seen - end > self.options.qvz {
            return Err(format!("the DLE of {} came after QVZ", dle.at));
        }
        Ok(())
    }

    fn block(&self, data: &[u8]) -> Vec<u8> {
        let mut block = Vec::new();
        for byte in data {
            block.push(*byte);
            if *byte == 0x10 && self.options.doubling {
                block.push(0x10);
            }
        }
        block.extend([0x10, 0x03]);
        if self.options.bcc {
            block.push(block.iter().fold(0, |check, byte| check ^ byte));
        }
        block
    }

    /// Why a job is done whose block was not delivered.
    fn cause(&self, job: &Job, dle: Arrival) -> Result<Cause, String> {
        let Some(sent_at) = dle.sent_at.filter(|_| !dle.is_altered) else {
            return Ok(Cause::Forged);
        };
        let for_delivery = self.receiver.acknowledged.iter().find(|(at, _)| *at == sent_at);
        if let Some((_, place)) = for_delivery {
            let (at, data) = &self.receiver.delivered[*place];
            let is_late = *at < job.begun;
            // That delivery was found to be none of those sent.
            let is_other = *data != job.data;
            return match (is_late, is_other) {
                (true, _) => Ok(Cause::Forged),
                (false, true) => Ok(Cause::Colliding),
                (false, false) => Err(format!("the books of the job of {} differ", job.begun)),
            };
        }
        // A station's other DLEs are known to be none for a block. A plug-in's
        // must be the answer to an STX, which came just before, or of its block.
        if let Some(emitted) = &self.receiver.emitted {
            let mut dles = (0..emitted.len()).filter(|place| {
                let (_, end, byte) = emitted[*place];
                end == sent_at && byte == 0x10
            });
            if !dles.any(|place| self.is_of_block(place) || self.is_answer(emitted[place].0)) {
                return Err(format!(
                    "the DLE that left at {sent_at} acknowledged the job of {}, but nothing was \
                     delivered",
                    job.begun
                ));
            }
        }
        Ok(Cause::Forged)
    }

    /// Whether what the receiver began to send at this time can answer an STX.
    fn is_answer(&self, start: Micros) -> bool {
        let before = |arrival: &&Arrival| arrival.at <= start;
        let is_stx = |arrival: &Arrival| arrival.signal == Signal::Character(0x02);
        let is_recent = |arrival: &&Arrival| arrival.at + self.latency >= start;
        let came = || self.to_receiver.iter().filter(before);
        came().next_back().is_some_and(is_stx) || came().filter(is_recent).any(is_stx)
    }

    /// Whether this character of the receiver's is one of a block of its own.
    fn is_of_block(&self, place: usize) -> bool {
        let Some(emitted) = &self.receiver.emitted else { return false };
        self.receiver.jobs.iter().any(|job| {
            let block = self.block(&job.data);
            (1..=place).rev().take(block.len()).any(|first| {
                let so_far = emitted[first..=place].iter().map(|(.., byte)| byte);
                emitted[first - 1].2 == 0x02 && so_far.eq(&block[..=place - first])
            })
        })
    }
}

enum Cause {
    /// The DLE was not sent for this block.
    Forged,
    /// The block was altered and checks all the same.
    Colliding,
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;

    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02X} ");
        text
    })
}
