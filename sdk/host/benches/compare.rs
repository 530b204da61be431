//! The plug-ins in their sandbox against the same converters as native code:
//! single events of XON/XOFF, and whole exchanges of each.
//!
//! The module is the one that `cargo xtask build` leaves; another folder can be
//! given as `SOFTPLUG_PLUGINS`.

mod common;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Event, Instance, JobId, LineParameters, Micros, Parity, Pass, Values};
use softplug_host::Plugin;
use softplug_native::NativePlugin;
use std::hint::black_box;
use std::time::{Duration, Instant};

const SIZES: [usize; 3] = [1, 64, 1_024];

/// Rooms at the opening, and again after each batch.
const ROOM: u32 = 16 << 20;

/// Steps between two refreshes of the rooms.
const BATCH: u64 = 4_096;

fn received(criterion: &mut Criterion) {
    compare(criterion, "received", |bytes| Event::Received(bytes));
}

fn job_data(criterion: &mut Criterion) {
    compare(criterion, "job data", |bytes| Event::JobData { job: JobId(1), bytes });
}

fn starts(criterion: &mut Criterion) {
    let plugin = plugin();
    criterion.bench_function("xon-xoff: instantiate and first event", |bencher| {
        bencher.iter(|| {
            let mut session = plugin.instantiate().expect("an instance");
            let first = Event::Settings { first: true, last: false, values: empty() };
            black_box(session.step(&first, Micros::ZERO).expect("an answer").more)
        });
    });
    let values = plugin.manifest().resolve_settings([]).expect("defaults");
    criterion.bench_function("xon-xoff: instantiate, settings and open", |bencher| {
        bencher.iter(|| {
            let mut session = plugin.instantiate().expect("an instance");
            open(&mut session, &values);
            session
        });
    });
}

/// What a byte costs on a line: each event of an exchange, by a fresh instance.
fn exchanges(criterion: &mut Criterion) {
    for recording in common::recordings() {
        let events = recording.events();
        let plugin = common::module(recording.plugin);
        let name = format!("{}: {}", recording.plugin.name(), recording.name);
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Bytes(recording.bytes));
        group.sample_size(20);
        group.bench_function("native", |bencher| {
            bencher.iter_custom(|times| {
                (0..times).map(|_| timed(&mut recording.plugin.instantiate(), &events)).sum()
            });
        });
        group.bench_function("wasm", |bencher| {
            bencher.iter_custom(|times| {
                let instance = || plugin.instantiate().expect("an instance");
                (0..times).map(|_| timed(&mut instance(), &events)).sum()
            });
        });
        group.finish();
    }
}

fn timed<I: Instance>(instance: &mut I, events: &[(Event<'_>, Micros)]) -> Duration {
    let start = Instant::now();
    for (event, now) in events {
        black_box(must(instance.step(black_box(event), *now)).actions);
    }
    start.elapsed()
}

fn compare(criterion: &mut Criterion, name: &str, event: impl Fn(&[u8]) -> Event<'_> + Copy) {
    let plugin = plugin();
    let values = plugin.manifest().resolve_settings([]).expect("defaults");
    let mut group = criterion.benchmark_group(format!("xon-xoff: {name}"));
    for size in SIZES {
        let bytes = program(size);
        group.throughput(Throughput::Bytes(size as u64));
        let mut native = NativePlugin::XonXoff.instantiate();
        open(&mut native, &values);
        measure(&mut group, &format!("{size} B/native"), &mut native, || event(&bytes));
        let mut session = plugin.instantiate().expect("an instance");
        open(&mut session, &values);
        measure(&mut group, &format!("{size} B/wasm"), &mut session, || event(&bytes));
    }
    group.finish();
}

/// Times the steps alone: room is given back outside of what is timed. Each
/// event has its own time, as on a line, so that timers are set anew.
fn measure<'a, I: Instance>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    instance: &mut I,
    event: impl Fn() -> Event<'a>,
) {
    let mut now = Micros(1);
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|steps| {
            let mut taken = Duration::ZERO;
            let mut left = steps;
            while left > 0 {
                let batch = left.min(BATCH);
                left -= batch;
                let start = Instant::now();
                for _ in 0..batch {
                    now.0 += 87;
                    black_box(must(instance.step(&black_box(event()), now)).actions);
                }
                taken += start.elapsed();
                give_room(instance, now);
            }
            taken
        });
    });
}

fn open<I: Instance>(instance: &mut I, values: &SettingValues) {
    let capacity = instance.input_capacity();
    must(values.pieces(capacity, |event| instance.step(event, Micros::ZERO).map(|_| ())));
    let line =
        LineParameters { baud: 115_200, data_bits: 8, parity: Parity::None, stop_half_bits: 2 };
    let (transmit_room, delivery_room) = (ROOM, ROOM);
    let open = Event::Open { resumed: false, line, transmit_room, delivery_room };
    must(instance.step(&open, Micros::ZERO));
    let job =
        Event::JobBegin { job: JobId(1), kind: 0, pass: Pass::Run, size: None, fields: empty() };
    must(instance.step(&job, Micros::ZERO));
}

fn give_room<I: Instance>(instance: &mut I, now: Micros) {
    must(instance.step(&Event::DeliveryRoom { grown: ROOM }, now));
    must(instance.step(&Event::TransmitRoom { grown: ROOM }, now));
}

fn must<T, E: std::fmt::Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|error| panic!("the converter takes every event: {error}"))
}

fn empty() -> Values<'static> {
    Values::new(&[])
}

/// Blocks as in a program, without control bytes.
fn program(size: usize) -> Vec<u8> {
    b"N10 G1 X12.345 Y-6.789 F1200\n".iter().copied().cycle().take(size).collect()
}

fn plugin() -> Plugin {
    common::module(NativePlugin::XonXoff)
}

criterion_group!(benches, received, job_data, exchanges, starts);
criterion_main!(benches);
