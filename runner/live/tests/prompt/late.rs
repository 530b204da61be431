//! Our side: a channel driven as a thread of the gateway drives it, but late wherever it can be.

use std::time::{Duration, Instant};

use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, Failure, JobId, Micros, NoteLevel};
use softplug_link::{Job, LinkHost, Supply};
use softplug_live::channel::{Channel, ChannelHost, StationOptions, Work};
use softplug_live::clock::Clock;
use softplug_live::poll::{Interest, Poller, Source};
use softplug_live::{Input, Port};
use softplug_native::{NativeInstance, NativePlugin};

use super::partner::Prompt;

/// So long that only something lost makes a test wait for it.
const PATIENCE: Duration = Duration::from_mins(1);
/// One call in so many is late.
const ONE_IN: u64 = 8;

/// The host, which is late where the byte loop calls it: behind a write, before what was read is
/// given on, between turns.
pub(crate) struct Late {
    /// The longest delay in µs, and the state of what chooses it.
    most: u64,
    random: u64,
    data: Vec<u8>,
    pub(crate) ended: Option<Result<(), Failure>>,
    pub(crate) deliveries: u64,
    delivered: Vec<u8>,
    drained: u32,
    warnings: Vec<(u16, String)>,
    partner: Prompt,
    /// Deliveries that failed, how long the partner took, and since when nothing had come.
    cut_off: Vec<(Failure, Duration, Duration)>,
    heard: Instant,
}

impl Late {
    pub(crate) fn new(most: u64, partner: &Prompt) -> Self {
        Self {
            partner: partner.clone(),
            cut_off: Vec::new(),
            heard: Instant::now(),
            most,
            random: 0x9E37_79B9_7F4A_7C15,
            data: Vec::new(),
            ended: None,
            deliveries: 0,
            delivered: Vec::new(),
            drained: 0,
            warnings: Vec::new(),
        }
    }

    fn is_late(&mut self) {
        // Marsaglia's xorshift: the same delays in each run.
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        if self.most > 0 && self.random.is_multiple_of(ONE_IN) {
            std::thread::sleep(Duration::from_micros((self.random >> 8) % self.most));
        }
    }

    /// The job is done, this was delivered meanwhile, and nothing was out of order.
    pub(crate) fn check(&mut self, n: u64, delivered: &[u8]) {
        assert_eq!(self.cut_off, [], "block {n}: {:?}", self.warnings);
        assert_eq!(self.warnings, [], "block {n}");
        assert_eq!(self.ended.take(), Some(Ok(())), "block {n}");
        assert_eq!(std::mem::take(&mut self.delivered), delivered, "block {n}");
    }
}

impl ChannelHost for Late {
    fn heard(&mut self, _: Micros, _: &Input<'_>) {
        self.heard = Instant::now();
        self.is_late();
    }

    fn wrote(&mut self, _: Micros, _: &[u8]) {
        self.partner.was_asked();
        self.is_late();
    }
}

impl LinkHost for Late {
    fn handle(&mut self, _: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } => self.ended = Some(Ok(())),
            Action::JobFailed { failure, .. } => self.ended = Some(Err(*failure)),
            Action::Deliver { bytes, .. } => {
                self.delivered.extend(*bytes);
                self.drained += bytes.len() as u32;
            }
            Action::DeliveryEnd { failure, .. } => {
                if let Some(failure) = failure {
                    let took = self.partner.slowest();
                    self.cut_off.push((*failure, took, self.heard.elapsed()));
                }
                self.deliveries += 1;
            }
            Action::Note { level, code, text } if *level != NoteLevel::Debug => {
                self.warnings.push((*code, (*text).to_owned()));
            }
            _ => {}
        }
    }

    fn supply(&mut self, _: JobId, buffer: &mut [u8]) -> Supply {
        let count = self.data.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.data[..count]);
        self.data.drain(..count);
        if count == 0 { Supply::End } else { Supply::Bytes(count) }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}

/// A channel with 3964R on it.
pub(crate) struct Link {
    pub(crate) channel: Channel<NativeInstance>,
    pub(crate) clock: Clock,
    poller: Poller,
    jobs: u32,
    only_writes: bool,
}

impl Link {
    pub(crate) fn open(port: Port, late: &mut Late, asked: &[(&str, &str)]) -> Self {
        let manifest = Manifest::parse(NativePlugin::R3964.manifest().as_bytes()).unwrap();
        let settings = manifest.resolve_settings(asked.iter().copied()).unwrap();
        let options = StationOptions { settings, ..StationOptions::default() };
        let clock = Clock::start();
        let poller = Poller::new(clock).unwrap();
        let mut channel = Channel::new(port, NativePlugin::R3964.instantiate(), options);
        channel.open(clock.now(), late).unwrap();
        Self { channel, clock, poller, jobs: 0, only_writes: false }
    }

    pub(crate) fn begin(&mut self, late: &mut Late, data: &[u8]) {
        self.jobs += 1;
        late.data = data.to_vec();
        let size = Some(data.len() as u64);
        let job = Job { id: JobId(self.jobs), kind: 0, size, fields: Vec::new(), check: false };
        let begin = |link: &mut softplug_link::Link<_>, now, host: &mut dyn LinkHost| {
            link.begin_job(now, job, host)
        };
        self.channel.ask(self.clock.now(), late, begin).unwrap().unwrap();
    }

    /// Asks for something that changes nothing.
    pub(crate) fn resume(&mut self, late: &mut Late) {
        let job = self.jobs;
        let resume = |link: &mut softplug_link::Link<_>, now, host: &mut dyn LinkHost| {
            link.resume(now, JobId(job), host)
        };
        self.channel.ask(self.clock.now(), late, resume).unwrap().unwrap();
    }

    /// Turn by turn until it is so.
    pub(crate) fn until(&mut self, late: &mut Late, is_so: impl Fn(&Late) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !is_so(late) {
            assert!(late.cut_off.is_empty(), "{:?} {:?}", late.cut_off, late.warnings);
            assert!(Instant::now() < end, "{:?} {:?}", late.warnings, late.ended);
            self.turn(late);
        }
    }

    /// Until the plug-in waits for an answer and nothing else: when it is over.
    pub(crate) fn until_waiting(&mut self, late: &mut Late) -> Micros {
        let end = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < end, "it does not wait");
            let wants = self.channel.wants(self.clock.now());
            match self.channel.link().poll_timeout() {
                Some(timer) if wants.deadline == Some(timer) && wants.write_on.is_none() => {
                    return timer;
                }
                _ => self.turn(late),
            }
        }
    }

    /// As a lane does it: only what was told to be readable is read, and a turn that is only to
    /// give the line more does no more than that.
    fn turn(&mut self, late: &mut Late) {
        late.is_late();
        let only_writes = std::mem::take(&mut self.only_writes);
        let written = only_writes.then(|| self.channel.write_on(self.clock, late).unwrap());
        if written.flatten().is_none() {
            let work = self.channel.work(self.clock, late).unwrap();
            assert_eq!(self.channel.gone(), None);
            if work == Work::More {
                return;
            }
        }
        late.is_late();
        let wants = self.channel.wants(self.clock.now());
        let write_on = wants.write_on.map(|due| due.at);
        let bound = self.clock.now() + Micros::from_millis(100);
        let deadline = [wants.deadline, write_on].into_iter().flatten().fold(bound, Micros::min);
        let interest = Interest { read: wants.read, write: wants.write };
        let port = self.channel.port().map(|port| port as &dyn Source);
        let ready = self.poller.wait(port, interest, Some(deadline)).unwrap();
        let is_other = wants.deadline.is_some_and(|at| at <= self.clock.now());
        if ready.readable || ready.hangup {
            self.channel.set_readable();
        } else {
            self.only_writes = write_on.is_some() && !is_other;
        }
    }

    pub(crate) fn close(mut self, late: &mut Late) {
        let close =
            |link: &mut softplug_link::Link<_>, now, host: &mut dyn LinkHost| link.close(now, host);
        self.channel.ask(self.clock.now(), late, close).unwrap().unwrap();
    }
}
