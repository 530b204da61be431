//! Lanes of a reactor, each on a pty whose far end the test plays.

#![cfg(target_os = "linux")]

use crate::lanes;
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Duration;

use crate::lanes::{Bench, program, read_exactly, write_all};
use softplug_abi::{Failure, JobId, LinkDownReason, Micros};
use softplug_live::PortSpec;
use softplug_live::pty::PtyPair;
use softplug_live::reactor::{
    Alarm, AlarmKind, Backoff, Command, Condition, Feed, JobOutcome, LaneFigures, Report, Watch,
    WatchEvent,
};
use softplug_live::reservoir::{Drawn, ReservoirReader, reservoir};

const XOFF: u8 = 0x13;
const XON: u8 = 0x11;

#[test]
fn a_job_reaches_the_machine_byte_by_byte() {
    let mut bench = Bench::start();
    let lane = bench.add_up(115_200);
    let program = program(4_000);
    bench.send(lane, JobId(7), &program);
    assert_eq!(bench.read_from_machine(lane, program.len()), program);
    let end = bench.end_of_job(lane);
    assert_eq!((end.job, end.outcome), (JobId(7), JobOutcome::Done));
    assert_eq!((end.taken, end.maybe_left), (4_000, 4_000));
    bench.until(lane, |figures| (figures.condition, figures.bytes_out) == (Condition::Up, 4_000));
}

#[test]
fn sixty_four_lanes_feed_at_once_on_more_than_one_thread_and_nothing_is_mixed_up() {
    let mut bench = Bench::start_with(24);
    let lanes: Vec<_> = (0..64).map(|_| bench.add(115_200)).collect();
    assert_eq!(bench.reactor.threads(), 3);
    let programs: Vec<_> = (0..64).map(|at| program(3_000 + at)).collect();
    for (lane, program) in lanes.iter().zip(&programs) {
        bench.wait_for(*lane, |report| matches!(report, Report::Up));
        bench.send(*lane, JobId(1), program);
    }
    for (lane, program) in lanes.iter().zip(&programs) {
        assert_eq!(bench.read_from_machine(*lane, program.len()), *program, "{lane}");
    }
    for lane in lanes {
        assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
    }
}

#[test]
fn a_machine_that_never_reads_delays_no_other() {
    let mut bench = Bench::start();
    let stuck = bench.add_up(921_600);
    let lanes: Vec<_> = (0..8).map(|_| bench.add_up(921_600)).collect();
    // More than a pty holds.
    bench.send(stuck, JobId(1), &program(60_000));
    bench.until(stuck, |figures| figures.bytes_out > 4_000 && figures.waiting > 0);
    let program = program(20_000);
    for lane in &lanes {
        bench.send(*lane, JobId(1), &program);
    }
    for lane in &lanes {
        assert_eq!(bench.read_from_machine(*lane, program.len()), program);
        assert_eq!(bench.end_of_job(*lane).outcome, JobOutcome::Done);
    }
    assert!(bench.figures(stuck).bytes_out < 60_000);
    // And it is aborted without the others' help; how far it was is not forgotten.
    bench.until(stuck, |figures| figures.job_bytes_surely_left > 1_000);
    let seen = bench.figures(stuck);
    bench.reactor.tell(stuck, Command::Abort(JobId(1)));
    let end = bench.end_of_job(stuck);
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Aborted, status: 0 });
    assert!(end.bytes_surely_left >= seen.job_bytes_surely_left, "{end:?} after {seen:?}");
    assert!(end.bytes_surely_left <= end.surely_left, "{end:?}");
    assert!(end.bytes_surely_left + 1_024 <= end.taken, "{end:?}");
    // What the plug-in took and the port never had has not left, nor will it.
    let maybe = end.bytes_maybe_left;
    assert!(end.bytes_surely_left <= maybe && maybe + 2_000 < end.taken, "{end:?}");
}

#[test]
fn a_partner_that_holds_is_felt_at_the_source() {
    let mut bench = Bench::start();
    let lane = bench.add_up(921_600);
    let (mut writer, source) = reservoir(1_024, 256, 768);
    let job = lanes::job(5, None);
    write_all(&bench.machines[&lane], &[XOFF]);
    bench.until(lane, |figures| figures.is_held);
    bench.reactor.tell(lane, Command::Begin(Feed { job, source }));
    // The queue takes its fill, then the reservoir fills up.
    let data = program(20_000);
    let mut at = 0;
    let mut full = 0;
    while full < 1_000 {
        let count = writer.write(&data[at..]);
        at += count;
        full = if count == 0 { full + 1 } else { 0 };
        thread::yield_now();
    }
    assert!(at < data.len(), "everything went somewhere: {at}");
    assert_eq!(bench.figures(lane).bytes_out, 0);
    assert_eq!(bench.figures(lane).starvations, 0, "held, not starved");
    write_all(&bench.machines[&lane], &[XON]);
    let feeder = thread::spawn(move || {
        while at < data.len() {
            at += writer.write(&data[at..]);
            thread::yield_now();
        }
        writer.finish();
        data
    });
    let received = bench.read_from_machine(lane, 20_000);
    assert_eq!(received, feeder.join().unwrap());
    let end = bench.end_of_job(lane);
    assert_eq!((end.outcome, end.taken), (JobOutcome::Done, 20_000));
    assert_eq!(bench.figures(lane).holds, 1);
}

#[test]
fn a_source_that_runs_dry_starves_the_line_and_one_that_fails_ends_the_job() {
    let mut bench = Bench::start();
    let lane = bench.add_up(115_200);
    let (mut writer, source) = reservoir(1_024, 256, 768);
    let job = lanes::job(5, None);
    bench.reactor.tell(lane, Command::Begin(Feed { job, source }));
    let starvations = |figures: &LaneFigures| figures.starvations;
    assert_eq!(starvations(&bench.figures(lane)), 0, "nothing was there to run dry");
    for times in 1..=3 {
        assert_eq!(writer.write(b"N10 G1 X1\n"), 10);
        assert_eq!(bench.read_from_machine(lane, 10), b"N10 G1 X1\n");
        bench.until(lane, |figures| figures.starvations == times && figures.is_starved);
    }
    writer.fail("the server is gone");
    let outcome = bench.end_of_job(lane).outcome;
    assert_eq!(outcome, JobOutcome::SourceFailed("the server is gone".to_owned()));
    bench.until(lane, |figures| !figures.is_starved && figures.starved_micros > 0);
}

#[test]
fn a_port_that_is_unplugged_in_mid_job_comes_back_and_works() {
    let mut bench = Bench::start();
    let machine = PtyPair::open().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("port");
    std::os::unix::fs::symlink(machine.slave_path(), &name).unwrap();
    let lane = bench.add_on(machine, 19_200, |setup| {
        setup.port = PortSpec::Device(name.clone());
        setup.reopen = Backoff { first: Micros(1_000), longest: Micros(20_000) };
    });
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    bench.machines.get_mut(&lane).unwrap().release_slave();
    bench.send(lane, JobId(1), &program(8_000));
    let first = bench.read_from_machine(lane, 100);
    assert_eq!(first, program(100));
    // Unplugged: the name is there no more, the far end neither.
    std::fs::remove_file(&name).unwrap();
    bench.machines.remove(&lane);
    let end = bench.end_of_job(lane);
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::LinkDown, status: 0 });
    assert!(end.surely_left <= end.maybe_left && end.maybe_left >= 100, "{end:?}");
    let is_down =
        |report: &Report| matches!(report, Report::Down { reason: LinkDownReason::Unplugged, .. });
    bench.wait_for(lane, is_down);
    let retried =
        |report: &Report| matches!(report, Report::Down { reason: LinkDownReason::Failed, .. });
    bench.wait_for(lane, retried);
    // A job that comes now is refused at once.
    bench.send(lane, JobId(2), b"N10\n");
    let outcome = bench.end_of_job(lane).outcome;
    assert_eq!(outcome, JobOutcome::Failed { failure: Failure::LinkDown, status: 0 });
    // And it is back.
    let machine = PtyPair::open().unwrap();
    std::os::unix::fs::symlink(machine.slave_path(), &name).unwrap();
    bench.machines.insert(lane, machine);
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    bench.send(lane, JobId(3), &program(500));
    assert_eq!(bench.read_from_machine(lane, 500), program(500));
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
    assert_eq!(bench.figures(lane).opened, 2);
}

/// Reads a delivery to its end.
fn drain(reader: &mut ReservoirReader, received: &mut Vec<u8>) -> Drawn {
    let mut buffer = [0; 100];
    loop {
        match reader.read(&mut buffer) {
            Drawn::Bytes(count) => received.extend(&buffer[..count]),
            end => return end,
        }
    }
}

#[test]
fn what_a_machine_sends_waits_for_room_and_arrives_whole() {
    let mut bench = Bench::start();
    let lane = bench.add_with(921_600, |setup| setup.station.delivery_room = 1_024);
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    // The kernel holds as much, whatever the plug-in says to the machine.
    let sent = program(3_000);
    write_all(&bench.machines[&lane], &sent);
    let mut received = Vec::new();
    // The plug-in may take a pause for the end; the rest is the next delivery.
    while received.len() < sent.len() {
        let begun = bench.wait_for(lane, |report| matches!(report, Report::DeliveryBegun { .. }));
        let Report::DeliveryBegun { delivery, job: None, unit: None, mut bytes } = begun else {
            unreachable!()
        };
        if received.is_empty() {
            // Nobody puts anything away: reading stops where the room ends.
            bench.until(lane, |figures| figures.to_put_away > 600);
            for _ in 0..200 {
                thread::yield_now();
                assert!(bench.figures(lane).to_put_away <= 1_024);
            }
            assert!(bench.figures(lane).bytes_in <= 1_024);
        }
        let before = received.len();
        while drain(&mut bytes, &mut received) != Drawn::End {
            thread::sleep(Duration::from_micros(100));
        }
        let ended = bench.wait_for(lane, |report| matches!(report, Report::DeliveryEnded { .. }));
        let Report::DeliveryEnded { delivery: same, failure, bytes, .. } = ended else {
            unreachable!()
        };
        let count = (received.len() - before) as u64;
        assert_eq!((same, failure, bytes), (delivery, None, count));
    }
    assert_eq!(received, sent);
}

#[test]
fn a_delivery_that_nobody_wants_is_dropped_and_does_not_stop_the_line() {
    let mut bench = Bench::start();
    let lane = bench.add_with(921_600, |setup| setup.station.delivery_room = 1_024);
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    let machine = bench.machines.remove(&lane).unwrap();
    let far = thread::spawn(move || {
        write_all(&machine, &program(20_000));
        machine
    });
    drop(bench.wait_for(lane, |report| matches!(report, Report::DeliveryBegun { .. })));
    bench.until(lane, |figures| figures.bytes_in == 20_000 && figures.to_put_away == 0);
    far.join().unwrap();
}

#[test]
fn watchdogs_bark_once_and_say_when_it_is_over() {
    let mut bench = Bench::start();
    let lane = bench.add_with(921_600, |setup| {
        setup.watchdogs.stuck_held = Some(Micros(20_000));
        setup.watchdogs.no_progress = Some(Micros(20_000));
        setup.watchdogs.no_bytes = Some(Micros(20_000));
    });
    let alarm = |kind, raised| move |report: &Report| matches!(report, Report::Alarm(alarm) if *alarm == Alarm { kind, raised });
    bench.wait_for(lane, alarm(AlarmKind::NoBytes, true));
    write_all(&bench.machines[&lane], &[XOFF]);
    bench.wait_for(lane, alarm(AlarmKind::NoBytes, false));
    bench.wait_for(lane, alarm(AlarmKind::StuckHeld, true));
    bench.send(lane, JobId(1), &program(50));
    bench.wait_for(lane, alarm(AlarmKind::NoProgress, true));
    bench.until(lane, |figures| figures.alarms.len() == 3);
    write_all(&bench.machines[&lane], &[XON]);
    bench.wait_for(lane, alarm(AlarmKind::StuckHeld, false));
    bench.wait_for(lane, alarm(AlarmKind::NoProgress, false));
    assert_eq!(bench.read_from_machine(lane, 50), program(50));
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
}

#[test]
fn whoever_watches_sees_both_ways_and_a_slow_one_costs_only_its_own_view() {
    let mut bench = Bench::start();
    let lane = bench.add_up(921_600);
    let (to, seen) = sync_channel(4);
    bench.until(lane, |figures| figures.condition == Condition::Up);
    bench.reactor.tell(lane, Command::Watch(Some(Watch { to })));
    let program = program(10_000);
    write_all(&bench.machines[&lane], &[XOFF]);
    bench.until(lane, |figures| figures.is_held);
    write_all(&bench.machines[&lane], &[XON]);
    bench.send(lane, JobId(1), &program);
    assert_eq!(bench.read_from_machine(lane, program.len()), program);
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
    bench.until(lane, |figures| figures.unseen > 0);
    let first: Vec<_> = seen.try_iter().take(2).map(|seen| seen.what).collect();
    assert_eq!(first, [WatchEvent::Heard(vec![XOFF]), WatchEvent::Held]);
    // One that has gone away costs nothing.
    drop(seen);
    bench.until(lane, |figures| figures.job == 0);
    let unseen = bench.figures(lane).unseen;
    bench.send(lane, JobId(2), &program);
    assert_eq!(bench.read_from_machine(lane, program.len()), program);
    assert_eq!(bench.end_of_job(lane).outcome, JobOutcome::Done);
    assert_eq!(bench.figures(lane).unseen, unseen);
}

#[test]
fn a_lane_that_is_closed_sends_its_last_bytes_and_one_that_is_removed_does_not() {
    let mut bench = Bench::start();
    let (closed, removed) = (bench.add_up(19_200), bench.add_up(19_200));
    let program = program(100);
    // A partner that holds, so that nothing has left when its lane ends.
    write_all(&bench.machines[&removed], &[XOFF]);
    bench.until(removed, |figures| figures.is_held);
    for lane in [closed, removed] {
        bench.send(lane, JobId(1), &program);
    }
    bench.until(removed, |figures| figures.job_taken == 100);
    let status = bench.reactor.status(closed).unwrap();
    bench
        .reactor
        .tell(closed, Command::Close { patience: Micros::from_secs(30), hand_over: false });
    bench.reactor.remove(removed);
    for lane in [closed, removed] {
        bench.wait_for(lane, |report| matches!(report, Report::Removed));
    }
    assert_eq!(bench.end_of_job(closed).outcome, JobOutcome::Done);
    assert_eq!(read_exactly(&bench.machines[&closed], 100), program);
    let end = bench.end_of_job(removed);
    assert_eq!(end.outcome, JobOutcome::Failed { failure: Failure::Interrupted, status: 0 });
    assert_eq!(end.maybe_left, 0);
    assert_eq!(status.condition(), Condition::Removed);
    assert!(bench.reactor.status(removed).is_none());
}

#[test]
fn a_port_that_is_not_there_is_tried_until_it_is() {
    let mut bench = Bench::start();
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("port");
    let machine = PtyPair::open().unwrap();
    let slave = machine.slave_path().to_owned();
    let lane = bench.add_on(machine, 9_600, |setup| {
        setup.port = PortSpec::Device(name.clone());
        setup.reopen = Backoff { first: Micros(1_000), longest: Micros(5_000) };
    });
    for _ in 0..3 {
        bench.wait_for(lane, |report| matches!(report, Report::Down { .. }));
    }
    assert_eq!(bench.figures(lane).condition, Condition::Opening);
    std::os::unix::fs::symlink(&slave, &name).unwrap();
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    bench.reactor.tell(lane, Command::Reopen);
    bench.wait_for(lane, |report| matches!(report, Report::Down { .. }));
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    bench.until(lane, |figures| figures.opened == 2);
}
