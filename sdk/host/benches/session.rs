//! Steps, starts and loads.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use softplug_abi::{Event, Instance, Micros};
use softplug_host::{Host, HostOptions};
use std::hint::black_box;

fn echo() -> Vec<u8> {
    wat::parse_str(include_str!("../tests/guests/echo.wat")).expect("the guest is valid")
}

fn steps(criterion: &mut Criterion) {
    let host = Host::new(HostOptions::default()).expect("an engine");
    let plugin = host.load_bytes(&echo()).expect("a plug-in");
    let mut group = criterion.benchmark_group("step");
    for size in [1, 64, 1_024] {
        let bytes = vec![b'N'; size];
        let mut session = plugin.instantiate().expect("an instance");
        group.throughput(Throughput::Bytes(size as u64));
        group.bench_function(format!("{size} B"), |bencher| {
            bencher.iter(|| {
                let event = Event::Received(black_box(&bytes));
                black_box(session.step(&event, Micros(1)).expect("an answer").actions.len())
            });
        });
    }
    group.finish();
}

fn starts(criterion: &mut Criterion) {
    let host = Host::new(HostOptions::default()).expect("an engine");
    let plugin = host.load_bytes(&echo()).expect("a plug-in");
    criterion.bench_function("instantiate and first event", |bencher| {
        bencher.iter(|| {
            let mut session = plugin.instantiate().expect("an instance");
            black_box(session.step(&Event::Received(b"N"), Micros(1)).expect("an answer").more)
        });
    });
}

fn loads(criterion: &mut Criterion) {
    let wasm = echo();
    let directory = tempfile::tempdir().expect("a directory");
    let cache = Some(directory.path().to_owned());
    let host = Host::new(HostOptions { cache, ..HostOptions::default() }).expect("an engine");
    host.load_bytes(&wasm).expect("a plug-in");
    criterion.bench_function("load from cache", |bencher| {
        bencher.iter(|| host.load_bytes(black_box(&wasm)).expect("a plug-in"));
    });
    let host = Host::new(HostOptions::default()).expect("an engine");
    criterion.bench_function("lint and compile", |bencher| {
        bencher.iter(|| host.load_bytes(black_box(&wasm)).expect("a plug-in"));
    });
}

criterion_group!(benches, steps, starts, loads);
criterion_main!(benches);
