//! What replay costs: a trace of ten hours with 100,000 events, read, replayed and
//! compared, natively and in the sandbox.
//!
//! The module is the one that `cargo xtask build` leaves; another folder can be given as
//! `SOFTPLUG_PLUGINS`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use softplug_abi::manifest::Manifest;
use softplug_conformance::{Case, Filter, FromFn, Judge, Sandboxed, bless, run_all};
use softplug_host::{EngineKind, Host, HostOptions};
use softplug_native::NativePlugin;
use softplug_trace::Trace;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};

/// Each is two inputs, two characters out and a delivery.
const BLOCKS: u64 = 20_000;
const EVENTS: u64 = 5 * BLOCKS;
/// µs from one block to the next: ten hours for all.
const PERIOD: u64 = 1_800_000;

const FRONT: &str = "id: r3964.bench.ten-hours\ntitle: Ten hours of blocks\nprofile: r3964\n\
    clauses: r3964.rx.deliver\nlevel: must\nline: 9600 8E1 depth=1 reaction=0\n\
    config: nak_at_start=off\nsince: 1\norigin: hand-written\n---\n";

fn replay(criterion: &mut Criterion) {
    let subject = native();
    let inputs = Trace::parse(&inputs()).expect("the trace is valid");
    let blessed = bless(&subject, &Case::new("bench.spt", inputs)).expect("the plug-in takes it");
    let text = blessed.format();
    let case = Case::new("bench.spt", blessed);
    assert_eq!(case.trace.entries().count() as u64, EVENTS);

    let mut group = criterion.benchmark_group("replay: ten hours of 3964R, 100,000 events");
    group.throughput(Throughput::Elements(EVENTS));
    group.sample_size(10);
    group.bench_function("native", |bencher| bencher.iter(|| judge(&subject, &case)));
    for (name, engine) in [("wasm", EngineKind::Wasmtime), ("wasmi", EngineKind::Wasmi)] {
        let subject = sandboxed(engine);
        group.bench_function(name, |bencher| bencher.iter(|| judge(&subject, &case)));
    }
    group.bench_function("read", |bencher| {
        bencher.iter(|| Trace::parse(black_box(&text)).expect("the trace is valid"));
    });
    group.finish();
}

/// One run, compared with the trace; it passes.
fn judge(subject: &dyn Judge, case: &Case) {
    let uncut = Filter::only(["r3964.bench.ten-hours/uncut"]);
    let summary = run_all(&[subject], std::slice::from_ref(black_box(case)), &uncut);
    assert_eq!((summary.passed, summary.failed), (1, 0));
}

/// STX, then a block of 16 bytes, over and over.
fn inputs() -> String {
    let mut text = FRONT.to_owned();
    for block in 0..BLOCKS {
        let (start, data) = (block * PERIOD, block * PERIOD + 20_000);
        let payload = [format!("N{block:05} G1 X1234").as_bytes(), &[0x10, 0x03]].concat();
        let check = payload.iter().fold(0, |check, byte| check ^ byte);
        let _ = write!(text, "< {} 02\n< {}", seconds(start), seconds(data));
        for byte in payload.into_iter().chain([check]) {
            let _ = write!(text, " {byte:02X}");
        }
        text.push('\n');
    }
    text
}

fn seconds(micros: u64) -> String {
    format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000)
}

fn native() -> impl Judge {
    let plugin = NativePlugin::R3964;
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).expect("its manifest is valid");
    FromFn::new(manifest, move || plugin.instantiate())
}

fn sandboxed(engine: EngineKind) -> Sandboxed {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/plugins"),
        PathBuf::from,
    );
    let options = HostOptions { engine, ..HostOptions::default() };
    let host = Host::new(options).expect("the engine can be set up");
    let plugin = host.load(&folder.join("r3964.wasm"));
    Sandboxed::new(plugin.unwrap_or_else(|error| panic!("{error}; run cargo xtask build first")))
}

criterion_group!(benches, replay);
criterion_main!(benches);
