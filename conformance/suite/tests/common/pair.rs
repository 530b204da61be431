//! Two ends of a line in virtual time, and a plug-in with its host as one of
//! them.
#![allow(dead_code, reason = "loops and random partners each need a part of it")]

use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, Failure, JobId, Micros, RequestId};
use softplug_link::{Job, LinkHost, LinkOptions, Supply, VirtualLine, WireHost};
use softplug_machines::{Partner, Signal};
use softplug_native::{NativeInstance, NativePlugin};
use std::collections::VecDeque;

/// Two ends. What leaves one reaches the other at the same time.
pub(crate) struct Pair<A, B> {
    pub(crate) a: A,
    pub(crate) b: B,
    pub(crate) now: Micros,
    steps: u64,
}

impl<A: Partner, B: Partner> Pair<A, B> {
    pub(crate) fn new(a: A, b: B) -> Self {
        Self { a, b, now: Micros::ZERO, steps: 0 }
    }

    pub(crate) fn next(&self) -> Option<Micros> {
        [self.a.next_event(), self.b.next_event()].into_iter().flatten().min()
    }

    /// One instant: first what arrives, then the rest. `false` if nothing
    /// happens up to `until`.
    pub(crate) fn step(&mut self, until: Micros) -> bool {
        let Some(next) = self.next().filter(|next| *next <= until) else { return false };
        self.steps += 1;
        assert!(self.steps < 5_000_000, "time stands still at {next}");
        self.now = self.now.max(next);
        let now = self.now;
        loop {
            let to_b = self.a.poll_signal(now);
            let to_a = self.b.poll_signal(now);
            if to_a.is_none() && to_b.is_none() {
                break;
            }
            if let Some(signal) = to_b {
                give(&mut self.b, now, signal);
            }
            if let Some(signal) = to_a {
                give(&mut self.a, now, signal);
            }
        }
        self.a.advance(now);
        self.b.advance(now);
        true
    }

    /// Goes on until all is at rest, or time has come to `until`.
    pub(crate) fn run_until(&mut self, until: Micros) {
        while self.step(until) {}
    }
}

fn give(end: &mut impl Partner, now: Micros, signal: Signal) {
    match signal {
        Signal::Character(byte) => end.receive(now, byte),
        Signal::LineError { kind, byte } => end.receive_damaged(now, kind, byte),
        Signal::ModemLines { lines, on } => end.modem_lines(now, lines, on),
    }
}

/// A job that a host gave to a plug-in.
#[derive(Clone, Debug)]
pub(crate) struct Given {
    pub(crate) kind: u16,
    pub(crate) fields: Vec<u8>,
    pub(crate) data: Vec<u8>,
    pub(crate) begun: Micros,
    pub(crate) ended: Option<Micros>,
    pub(crate) result: Option<Result<u64, (Failure, u16)>>,
}

/// A delivery that has ended.
#[derive(Clone, Debug)]
pub(crate) struct Delivered {
    pub(crate) at: Micros,
    pub(crate) job: u32,
    pub(crate) data: Vec<u8>,
    pub(crate) result: Result<(), (Failure, u16)>,
}

/// A request of the plug-in.
#[derive(Clone, Debug)]
pub(crate) struct Asked {
    pub(crate) request: RequestId,
    pub(crate) kind: u16,
    pub(crate) fields: Vec<u8>,
}

/// The host's side of a plug-in.
#[derive(Debug, Default)]
pub(crate) struct Host {
    /// All jobs that were begun, in order.
    pub(crate) jobs: Vec<Given>,
    pub(crate) delivered: Vec<Delivered>,
    /// Characters on the wire: start, end, byte.
    pub(crate) emitted: Vec<(Micros, Micros, u8)>,
    pub(crate) notes: Vec<(Micros, u16, String)>,
    pub(crate) asked: Vec<Asked>,
    /// How long deliveries stay in the room.
    pub(crate) put_away_after: Micros,
    /// Bytes that are given of a job's data at once; 0: as many as asked for.
    pub(crate) piece: usize,
    /// How often the plug-in was replaced.
    pub(crate) swapped: u32,
    at: usize,
    open: Option<(u32, Vec<u8>)>,
    to_put_away: VecDeque<(Micros, u32)>,
    drained: u32,
    in_flight: VecDeque<(Micros, u8)>,
    start: Micros,
}

impl LinkHost for Host {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        match action {
            Action::DeliveryBegin { job, .. } => self.open = Some((job.0, Vec::new())),
            Action::Deliver { bytes, .. } => {
                self.to_put_away.push_back((now + self.put_away_after, bytes.len() as u32));
                if let Some((_, data)) = &mut self.open {
                    data.extend(*bytes);
                }
            }
            Action::DeliveryEnd { failure, status, .. } => {
                let (job, data) = self.open.take().expect("a delivery is open");
                let result = failure.map_or(Ok(()), |failure| Err((failure, *status)));
                self.delivered.push(Delivered { at: now, job, data, result });
            }
            Action::JobDone { sent, .. } => self.end(now, Ok(*sent)),
            Action::JobFailed { failure, status, .. } => self.end(now, Err((*failure, *status))),
            Action::Note { code, text, .. } => self.notes.push((now, *code, (*text).to_owned())),
            Action::Request { request, kind, fields } => self.asked.push(Asked {
                request: *request,
                kind: *kind,
                fields: fields.as_bytes().to_vec(),
            }),
            Action::Withdraw { request } => self.asked.retain(|asked| asked.request != *request),
            _ => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let Some(job) = self.jobs.last() else { return Supply::End };
        let rest = &job.data[self.at..];
        let most = if self.piece == 0 { usize::MAX } else { self.piece };
        let count = rest.len().min(buffer.len()).min(most);
        if count == 0 {
            return Supply::End;
        }
        buffer[..count].copy_from_slice(&rest[..count]);
        self.at += count;
        Supply::Bytes(count)
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}

impl WireHost for Host {
    fn on_wire(&mut self, start: Micros, _byte: u8) {
        self.start = start;
    }

    fn off_wire(&mut self, end: Micros, byte: u8) {
        self.emitted.push((self.start, end, byte));
        self.in_flight.push_back((end, byte));
    }
}

impl Host {
    fn end(&mut self, now: Micros, result: Result<u64, (Failure, u16)>) {
        let job = self.jobs.last_mut().expect("a job is under way");
        assert!(job.result.is_none(), "a job ends once");
        job.ended = Some(now);
        job.result = Some(result);
    }
}

/// A plug-in on a line, with a host that gives it jobs one after the other.
pub(crate) struct PluginEnd {
    pub(crate) line: VirtualLine<NativeInstance>,
    pub(crate) host: Host,
    waiting: VecDeque<(Micros, u16, Vec<u8>, Vec<u8>)>,
    /// From the end of a character until the port gives it, with all that came
    /// in the meantime.
    latency: Micros,
    arrived: Vec<Signal>,
    given_at: Option<Micros>,
    answers: VecDeque<(u32, Result<Vec<u8>, Failure>)>,
    /// When the plug-in is replaced by a new instance that takes over its state.
    swaps: VecDeque<Micros>,
    /// When the job that is then under way is aborted.
    aborts: VecDeque<Micros>,
    plugin: NativePlugin,
}

impl PluginEnd {
    /// A native plug-in, opened at time 0, with these of its settings.
    pub(crate) fn native(
        plugin: NativePlugin,
        settings: &[(&str, &str)],
        options: &LinkOptions,
        depth: usize,
        latency: Micros,
    ) -> Self {
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).expect("it is valid");
        let settings = manifest
            .resolve_settings(settings.iter().copied())
            .unwrap_or_else(|error| panic!("{error}"));
        let options = LinkOptions { settings, ..options.clone() };
        let mut line = VirtualLine::new(plugin.instantiate(), options, depth);
        let mut host = Host::default();
        line.link.open(Micros::ZERO, &mut host).expect("it opens");
        line.transmit(Micros::ZERO, &mut host).expect("it transmits");
        Self {
            line,
            host,
            waiting: VecDeque::new(),
            latency,
            arrived: Vec::new(),
            given_at: None,
            answers: VecDeque::new(),
            swaps: VecDeque::new(),
            aborts: VecDeque::new(),
            plugin,
        }
    }

    /// Replaces the plug-in at these times, in order, by new instances.
    pub(crate) fn swap_at(&mut self, times: impl IntoIterator<Item = Micros>) {
        self.swaps = times.into_iter().collect();
    }

    /// Aborts the jobs that are under way at these times, in order.
    pub(crate) fn abort_at(&mut self, times: impl IntoIterator<Item = Micros>) {
        self.aborts = times.into_iter().collect();
    }

    /// A job of the first kind, at this time or when those before it are done.
    pub(crate) fn send(&mut self, at: Micros, data: Vec<u8>) {
        self.job(at, 0, Vec::new(), data);
    }

    /// A job of any kind, with its fields as value records.
    pub(crate) fn job(&mut self, at: Micros, kind: u16, fields: Vec<u8>, data: Vec<u8>) {
        self.waiting.push_back((at, kind, fields, data));
    }

    /// Answers a request when time goes on.
    pub(crate) fn answer(&mut self, request: RequestId, answer: Result<Vec<u8>, Failure>) {
        self.answers.push_back((request.0, answer));
    }

    /// Whether no job waits or is under way and no timer runs.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.waiting.is_empty()
            && self.line.link.job().is_none()
            && self.line.link.poll_timeout().is_none()
            && !self.line.link.has_to_send()
            && self.host.open.is_none()
    }

    fn take(&mut self, now: Micros, signal: Signal) {
        if self.latency > Micros::ZERO {
            self.arrived.push(signal);
            self.given_at.get_or_insert(now + self.latency);
        } else {
            self.give(now, &[signal]);
        }
    }

    fn give(&mut self, now: Micros, signals: &[Signal]) {
        let link = &mut self.line.link;
        let mut at = 0;
        while let Some(signal) = signals.get(at) {
            let given = match signal {
                Signal::Character(_) => {
                    let bytes: Vec<u8> = signals[at..]
                        .iter()
                        .map_while(|signal| match signal {
                            Signal::Character(byte) => Some(*byte),
                            _ => None,
                        })
                        .collect();
                    at += bytes.len() - 1;
                    link.received(now, &bytes, &mut self.host)
                }
                Signal::LineError { kind, byte } => {
                    link.line_error(now, *kind, *byte, 0, &mut self.host)
                }
                Signal::ModemLines { .. } => Ok(()),
            };
            given.unwrap_or_else(|fault| panic!("{fault}"));
            at += 1;
        }
    }

    fn begin_job(&mut self, now: Micros) {
        let is_due = self.waiting.front().is_some_and(|(at, ..)| *at <= now);
        if !is_due || self.line.link.job().is_some() {
            return;
        }
        let Some((_, kind, fields, data)) = self.waiting.pop_front() else { return };
        let size = Some(data.len() as u64);
        let id = self.host.jobs.len() as u32 + 1;
        self.host.jobs.push(Given {
            kind,
            fields: fields.clone(),
            data,
            begun: now,
            ended: None,
            result: None,
        });
        self.host.at = 0;
        let job = Job { id: JobId(id), kind, size, fields, check: false };
        self.line.link.begin_job(now, job, &mut self.host).unwrap_or_else(|f| panic!("{f}"));
    }
}

impl Partner for PluginEnd {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.take(now, Signal::Character(byte));
    }

    fn receive_damaged(
        &mut self,
        now: Micros,
        kind: softplug_abi::LineErrorKind,
        byte: Option<u8>,
    ) {
        self.take(now, Signal::LineError { kind, byte });
    }

    fn next_event(&self) -> Option<Micros> {
        let job = self.waiting.front().map(|(at, ..)| *at);
        let now = self.line.link.now();
        [
            self.line.poll_timeout(),
            self.host.in_flight.front().map(|(end, _)| *end),
            self.host.to_put_away.front().map(|(at, _)| *at),
            self.given_at,
            self.swaps.front().copied(),
            self.aborts.front().copied(),
            job.filter(|_| self.line.link.job().is_none()).map(|at| at.max(now)),
            self.answers.front().map(|_| now),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    fn advance(&mut self, now: Micros) {
        if self.given_at.is_some_and(|at| at <= now) {
            self.given_at = None;
            let arrived = std::mem::take(&mut self.arrived);
            self.give(now, &arrived);
        }
        while let Some((_, bytes)) = self.host.to_put_away.pop_front_if(|(at, _)| *at <= now) {
            self.host.drained += bytes;
        }
        self.line.transmit(now, &mut self.host).unwrap_or_else(|fault| panic!("{fault}"));
        while self.swaps.pop_front_if(|at| *at <= now).is_some() {
            let successor = self.plugin.instantiate();
            let swapped = self.line.link.swap(now, successor, &mut self.host);
            swapped.unwrap_or_else(|error| panic!("{error}"));
            self.host.swapped += 1;
        }
        while self.aborts.pop_front_if(|at| *at <= now).is_some() {
            let link = &mut self.line.link;
            let job = link.job().map(|job| link.abort(now, job, &mut self.host));
            job.unwrap_or(Ok(())).unwrap_or_else(|fault| panic!("{fault}"));
        }
        while let Some((request, answer)) = self.answers.pop_front() {
            let answer = answer.as_ref().map(Vec::as_slice).map_err(|failure| *failure);
            self.line
                .link
                .answer(now, RequestId(request), answer, &mut self.host)
                .unwrap_or_else(|fault| panic!("{fault}"));
        }
        self.begin_job(now);
        self.line.transmit(now, &mut self.host).unwrap_or_else(|fault| panic!("{fault}"));
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.host.in_flight.pop_front_if(|(end, _)| *end <= now).map(|(_, byte)| byte)
    }
}
