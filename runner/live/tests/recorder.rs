//! The flight recorder: within its bound, over checkpoints and swaps, what it has
//! kept shows the same fault again.

use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{Event, Instance, JobId, LineParameters, Micros, Output};
use softplug_link::{Job, LinkFault, LinkOptions, Recorder, Rerun, Spare, Successor, VirtualLine};
use softplug_live::recorder::{Recorded, Recording, checkpoint, recording};
use softplug_native::{NativeInstance, NativePlugin};

/// The byte on which it fails.
const BOMB: u8 = 0xEE;

/// XON/XOFF, which fails on a certain byte.
#[derive(Debug)]
struct Fragile(NativeInstance);

#[derive(Debug, thiserror::Error)]
enum Broken {
    #[error("the byte EE broke it")]
    Bomb,
    #[error(transparent)]
    Native(<NativeInstance as Instance>::Fault),
}

impl Instance for Fragile {
    type Fault = Broken;

    fn input_capacity(&self) -> usize {
        self.0.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Broken> {
        if let Event::Received(bytes) = event
            && bytes.contains(&BOMB)
        {
            return Err(Broken::Bomb);
        }
        self.0.step(event, now).map_err(Broken::Native)
    }
}

fn fragile() -> Fragile {
    Fragile(NativePlugin::XonXoff.instantiate())
}

fn settings() -> SettingValues {
    let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes()).unwrap();
    manifest.resolve_settings([]).unwrap()
}

/// A job of 20,000 bytes, held and released again and again, with something
/// received now and then; then the byte. `beside` is called before each instant.
fn flight(
    bytes: usize,
    mut beside: impl FnMut(&mut VirtualLine<Recorded<Fragile>>, &mut Recorder, Micros),
) -> (LinkFault<Broken>, Recording) {
    let options = LinkOptions {
        line: LineParameters::new(19_200),
        settings: settings(),
        transmit_room: 512,
        ..LinkOptions::default()
    };
    let mut line = VirtualLine::new(Recorded::new(fragile(), bytes), options, 4);
    let mut out = Recorder::default();
    line.link.open(Micros::ZERO, &mut out).unwrap();
    out.add_source(JobId(1), vec![b'G'; 20_000]);
    let job = Job { id: JobId(1), kind: 0, size: None, fields: Vec::new(), check: false };
    line.link.begin_job(Micros(10), job, &mut out).unwrap();
    for round in 1..400_i64 {
        let now = Micros(round * 20_000);
        line.run_until(now, &mut out).unwrap();
        beside(&mut line, &mut out, now);
        let byte = [[0x13], [0x11], [b'A']][(round % 3) as usize];
        line.link.received(now, &byte, &mut out).unwrap();
        line.transmit(now, &mut out).unwrap();
    }
    let fault = line.link.received(Micros(8_100_000), &[BOMB], &mut out).unwrap_err();
    (fault, recording(&line.link))
}

fn again(recording: &Recording) -> String {
    let mut rerun = Rerun::new(fragile(), recording.under_way());
    let mut out = Recorder::default();
    let last = recording.entries().count();
    for (number, entry) in recording.entries().enumerate() {
        let event = Event::decode(entry.kind, entry.payload).unwrap();
        let given = rerun.give(entry.at, &event, &mut out);
        match given {
            Ok(()) => {}
            Err(fault) if number + 1 == last => return fault.to_string(),
            Err(fault) => panic!("event {number} of {last}: {fault}"),
        }
    }
    panic!("it did not fail")
}

fn size(recording: &Recording) -> usize {
    recording.entries().map(|entry| entry.payload.len() + 12).sum()
}

#[test]
fn a_whole_flight_ends_the_same() {
    let (fault, recording) = flight(1 << 20, |_, _, _| {});
    assert!(recording.is_whole() && size(&recording) > 20_000);
    assert_eq!(again(&recording), fault.to_string());
    assert_eq!(recording.under_way(), &softplug_link::UnderWay::default());
}

#[test]
fn a_long_flight_is_kept_from_a_checkpoint() {
    let mut checkpoints = 0;
    let (fault, recording) = flight(2_048, |line, out, now| {
        if line.link.instance().wants_checkpoint() {
            checkpoint(&mut line.link, now, out).unwrap();
            checkpoints += 1;
        }
    });
    assert!(checkpoints > 5, "{checkpoints}");
    assert!(recording.is_whole());
    let head = 4 * 1_024;
    assert!((1_024..2 * 2_048 + head).contains(&size(&recording)), "{}", size(&recording));
    assert_eq!(recording.under_way().job, Some((JobId(1), softplug_abi::Pass::Run)));
    assert_eq!(again(&recording), fault.to_string());
}

#[test]
fn without_checkpoints_the_end_is_kept() {
    let (_, recording) = flight(2_048, |_, _, _| {});
    assert!(!recording.is_whole());
    assert!((1_024..2 * 2_048).contains(&size(&recording)), "{}", size(&recording));
    let last = recording.entries().last().unwrap();
    assert_eq!((last.at, last.payload), (Micros(8_100_000), &[BOMB][..]));
}

#[test]
fn nothing_is_kept_where_nothing_may_be() {
    let (_, recording) = flight(0, |line, _, _| {
        assert!(!line.link.instance().wants_checkpoint());
    });
    assert!(recording.is_empty());
}

#[test]
fn a_successor_is_kept_from_the_state_that_it_took_over() {
    let (fault, recording) = flight(1 << 20, |line, out, now| {
        if now == Micros(4_000_000) {
            let successor = Successor {
                instance: Recorded::new(fragile(), 1 << 20),
                settings: settings(),
                accepts: vec![1],
                spare: Some(Spare {
                    instance: Recorded::new(fragile(), 1 << 20),
                    accepts: Vec::new(),
                }),
            };
            line.link.swap_to(now, successor, out).unwrap();
        }
        if now == Micros(6_000_000) {
            assert!(line.link.on_probation().unwrap() > 10);
            line.link.keep();
        }
    });
    assert!(recording.is_whole());
    assert_eq!(recording.entries().next().unwrap().at, Micros(4_000_000));
    assert_eq!(recording.under_way().job, Some((JobId(1), softplug_abi::Pass::Run)));
    assert_eq!(again(&recording), fault.to_string());
}
