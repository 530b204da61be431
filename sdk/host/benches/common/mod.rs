//! Exchanges of each plug-in with a partner, recorded once and replayed event by
//! event: what a plug-in costs on a line, without the line.

use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, Event, EventKind, Instance, JobId, LineParameters, Micros, Output};
use softplug_host::{Host, HostOptions, Plugin};
use softplug_link::{Job, LinkHost, LinkOptions, Supply, VirtualLine, WireHost};
use softplug_native::{NativeInstance, NativePlugin};
use std::path::{Path, PathBuf};

const BAUD: u32 = 115_200;
/// A port's driver hands over so many characters at once.
const CHUNK: usize = 16;
const BLOCKS: u32 = 64;
const BLOCK_BYTES: usize = 128;
const PROGRAM_BYTES: usize = 8_192;
/// 4,000 characters a second.
const PULSE_BAUD: u32 = 40_000;
const PASSES: usize = 6;
/// Longer than any block takes.
const WHILE: Micros = Micros::from_millis(40);

/// All events of an exchange, from the settings on.
pub(crate) struct Recording {
    /// The plug-in.
    pub(crate) plugin: NativePlugin,
    /// What goes on.
    pub(crate) name: &'static str,
    /// Bytes of the program or of the blocks.
    pub(crate) bytes: u64,
    events: Vec<(EventKind, Vec<u8>, Micros)>,
}

impl Recording {
    /// The events in their order.
    pub(crate) fn events(&self) -> Vec<(Event<'_>, Micros)> {
        let mut events = Vec::with_capacity(self.events.len());
        for (kind, payload, now) in &self.events {
            events.push((Event::decode(*kind, payload).expect("it was encoded here"), *now));
        }
        events
    }
}

/// One exchange in each direction, for each plug-in.
pub(crate) fn recordings() -> Vec<Recording> {
    let xon_xoff = NativePlugin::XonXoff;
    let fanuc = NativePlugin::FanucRs232;
    vec![
        feed(xon_xoff, "program sent", &[], None),
        capture(xon_xoff, "program received", &[], &program(), &[]),
        blocks_sent(NativePlugin::R3964, "blocks of 128 bytes sent"),
        blocks_received(NativePlugin::R3964, "blocks of 128 bytes received"),
        blocks_sent(NativePlugin::R3964Simplified, "blocks of 128 bytes sent"),
        blocks_received(NativePlugin::R3964Simplified, "blocks of 128 bytes received"),
        feed(fanuc, "program sent in ISO", &[("code", "iso")], Some(0x11)),
        feed(fanuc, "program sent in EIA", &[("code", "eia")], Some(0x11)),
        capture(fanuc, "program received in ISO", &[], &program(), &[0x14]),
        pulses("pulses of lines", "G91 F9999\n", "X-2 Z-40\nX2 Z40\n"),
        pulses("pulses of arcs", "G91 F9999\n", "G02 X20 Z-10 I10\nG03 X-20 Z10 K10\n"),
    ]
}

/// The module that `cargo xtask build` leaves; another folder can be given as
/// `SOFTPLUG_PLUGINS`.
pub(crate) fn module(plugin: NativePlugin) -> Plugin {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/plugins"),
        PathBuf::from,
    );
    let file = folder.join(format!("{}.wasm", plugin.name()));
    let host = Host::new(HostOptions::default()).expect("an engine");
    host.load(&file).unwrap_or_else(|error| {
        panic!("{}: {error}; run `cargo xtask build` first", file.display())
    })
}

fn feed(
    plugin: NativePlugin,
    name: &'static str,
    settings: &[(&str, &str)],
    start: Option<u8>,
) -> Recording {
    let program = program();
    let mut bench = Bench::open(plugin, settings);
    bench.begin(1, &program);
    if let Some(start) = start {
        bench.receive(&[start]);
    }
    while bench.far.done == 0 {
        bench.wait(WHILE);
    }
    bench.end(name, program.len())
}

/// Feed pulses, a byte each 250 µs: a block at the begin, and passes.
fn pulses(name: &'static str, begin: &str, pass: &str) -> Recording {
    let program = [begin, &pass.repeat(PASSES)].concat();
    let mut bench = Bench::at(PULSE_BAUD, NativePlugin::PulseLathe, &[("input", "iso")]);
    bench.begin(1, program.as_bytes());
    while bench.far.done == 0 {
        bench.wait(WHILE);
    }
    let sent = bench.far.sent;
    bench.end(name, sent)
}

fn capture(
    plugin: NativePlugin,
    name: &'static str,
    settings: &[(&str, &str)],
    program: &[u8],
    end: &[u8],
) -> Recording {
    let mut bench = Bench::open(plugin, settings);
    if !end.is_empty() {
        bench.receive(&[0x12]);
    }
    bench.receive(program);
    bench.receive(end);
    while bench.far.delivered == 0 {
        bench.wait(WHILE);
    }
    bench.end(name, program.len())
}

/// Nothing that 3964R doubles: the usual case.
fn block() -> Vec<u8> {
    (0..BLOCK_BYTES).map(|at| 0x20 + (at % 0x40) as u8).collect()
}

fn blocks_sent(plugin: NativePlugin, name: &'static str) -> Recording {
    let block = block();
    let mut bench = Bench::open(plugin, &[]);
    for id in 1..=BLOCKS {
        bench.begin(id, &block);
        bench.wait(WHILE);
        assert_eq!(bench.far.heard.last(), Some(&0x02), "STX");
        bench.receive(&[0x10]);
        bench.wait(WHILE);
        bench.receive(&[0x10]);
        assert_eq!(bench.far.done, id, "each block is done");
    }
    bench.end(name, BLOCKS as usize * BLOCK_BYTES)
}

fn blocks_received(plugin: NativePlugin, name: &'static str) -> Recording {
    let mut telegram = block();
    telegram.extend([0x10, 0x03]);
    telegram.push(telegram.iter().fold(0, |check, byte| check ^ byte));
    let mut bench = Bench::open(plugin, &[]);
    for id in 1..=BLOCKS {
        bench.receive(&[0x02]);
        bench.wait(WHILE);
        assert_eq!(bench.far.heard.last(), Some(&0x10), "DLE");
        bench.receive(&telegram);
        assert_eq!(bench.far.delivered, id, "each block is delivered");
        bench.wait(WHILE);
    }
    bench.end(name, BLOCKS as usize * BLOCK_BYTES)
}

/// Blocks as in a program, without control bytes.
fn program() -> Vec<u8> {
    let mut program = b"%\nO1234\n".to_vec();
    let blocks = b"N10 G1 X12.345 Y-6.789 F1200\n".iter().copied().cycle();
    program.extend(blocks.take(PROGRAM_BYTES));
    program.extend(b"\nM30\n%\n");
    program
}

/// A plug-in on a line in virtual time, every event of which is kept.
struct Bench {
    plugin: NativePlugin,
    line: VirtualLine<Recorder>,
    far: Far,
    parameters: LineParameters,
}

impl Bench {
    fn open(plugin: NativePlugin, settings: &[(&str, &str)]) -> Self {
        Self::at(BAUD, plugin, settings)
    }

    fn at(baud: u32, plugin: NativePlugin, settings: &[(&str, &str)]) -> Self {
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).expect("a manifest");
        let settings = manifest.resolve_settings(settings.iter().copied()).expect("settings");
        let parameters = LineParameters::new(baud);
        let options = LinkOptions { line: parameters, settings, ..LinkOptions::default() };
        let recorder = Recorder { inner: plugin.instantiate(), events: Vec::new() };
        let mut line = VirtualLine::new(recorder, options, CHUNK);
        let mut far = Far::default();
        line.link.open(Micros::ZERO, &mut far).expect("it opens");
        let mut bench = Self { plugin, line, far, parameters };
        bench.wait(WHILE);
        bench
    }

    fn begin(&mut self, id: u32, data: &[u8]) {
        self.far.data = data.to_vec();
        self.far.at = 0;
        let job = Job {
            id: JobId(id),
            kind: 0,
            size: Some(data.len() as u64),
            fields: Vec::new(),
            check: false,
        };
        let now = self.line.link.now();
        self.line.link.begin_job(now, job, &mut self.far).expect("it takes a job");
        self.line.transmit(now, &mut self.far).expect("it goes on");
    }

    /// In pieces, at the line's rate.
    fn receive(&mut self, bytes: &[u8]) {
        for piece in bytes.chunks(CHUNK) {
            self.wait(self.parameters.characters(piece.len() as u64));
            let now = self.line.link.now();
            self.line.link.received(now, piece, &mut self.far).expect("it takes bytes");
            self.line.transmit(now, &mut self.far).expect("it goes on");
        }
    }

    fn wait(&mut self, span: Micros) {
        let until = self.line.link.now() + span;
        self.line.run_until(until, &mut self.far).expect("it goes on");
    }

    fn end(self, name: &'static str, bytes: usize) -> Recording {
        let events = self.line.link.instance().events.clone();
        Recording { plugin: self.plugin, name, bytes: bytes as u64, events }
    }
}

/// The far end, and the host.
#[derive(Default)]
struct Far {
    heard: Vec<u8>,
    data: Vec<u8>,
    at: usize,
    done: u32,
    delivered: u32,
    drained: u32,
    sent: usize,
}

impl LinkHost for Far {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } => self.done += 1,
            Action::JobFailed { failure, .. } => panic!("a job failed: {}", failure.text()),
            Action::Deliver { bytes, .. } => self.drained += bytes.len() as u32,
            Action::DeliveryEnd { failure: None, .. } => self.delivered += 1,
            Action::DeliveryEnd { failure: Some(failure), .. } => {
                panic!("a delivery failed: {}", failure.text())
            }
            _ => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let rest = &self.data[self.at..];
        let count = rest.len().min(buffer.len());
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

impl WireHost for Far {
    fn off_wire(&mut self, _end: Micros, byte: u8) {
        self.sent += 1;
        self.heard.push(byte);
    }
}

/// Keeps every event that its instance is given.
struct Recorder {
    inner: NativeInstance,
    events: Vec<(EventKind, Vec<u8>, Micros)>,
}

impl Instance for Recorder {
    type Fault = <NativeInstance as Instance>::Fault;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault> {
        let mut payload = vec![0; self.inner.input_capacity()];
        let length = event.encode(&mut payload).expect("an event fits the input");
        payload.truncate(length);
        self.events.push((event.kind(), payload, now));
        self.inner.step(event, now)
    }
}
