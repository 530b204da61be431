//! The remote buffer, protocols A and B.

use softplug_abi::{Failure, Micros};
use softplug_machines::fanuc::{
    Interface, Options, Parity, Press, RemoteOptions, eight_none_two, seven_even_two,
};

use crate::common::fanuc::{Bench, Settings, program, text_of};
use crate::fanuc_loop::SECOND;

fn remote_a(remote: RemoteOptions) -> Options {
    Options {
        interface: Interface::RemoteA,
        line: seven_even_two(19_200),
        buffer: 4_096,
        resume: 2_048,
        block_time: Micros::from_millis(20),
        remote,
        ..Options::default()
    }
}

#[test]
fn protocol_a_carries_a_program_in_packets_whatever_is_damaged() {
    let program = program(600);
    // One at a time: two in a row cannot be told apart by any host.
    let faults = RemoteOptions {
        wrong_sums: vec![0, 8, 15],
        refusals: vec![3, 9],
        ..RemoteOptions::default()
    };
    let eight =
        Options { line: eight_none_two(9_600), parity: Parity::None, ..remote_a(faults.clone()) };
    let cases: [(Settings<'_>, Options); 4] = [
        (&[], remote_a(RemoteOptions::default())),
        (&[], remote_a(faults.clone())),
        (
            &[("packet_end", "etx"), ("packet_size", "100"), ("eob", "crlf")],
            remote_a(RemoteOptions { end_code: 3, ..faults }),
        ),
        (&[("parity", "none"), ("packet_size", "16")], eight),
    ];
    for (settings, control) in cases {
        for is_job_first in [true, false] {
            let settings = [&[("mode", "remote-a")], settings].concat();
            let what = format!("{settings:?} job first: {is_job_first}");
            let retries = control.remote.refusals.len() + control.remote.wrong_sums.len();
            let mut bench = Bench::new(&settings, control.clone());
            let job = if is_job_first {
                let job = bench.send(&program);
                bench.run(Micros::from_secs(2));
                bench.press(Press::Read);
                job
            } else {
                bench.press(Press::Read);
                bench.run(Micros::from_secs(2));
                bench.send(&program)
            };
            let end = bench.end_of(job);
            let report = bench.report();
            assert!(end.is_ok(), "{what}: {end:?} {:#?}", report.remote);
            let account = bench.account();
            let is_same = report.received.matches(text_of(&program).as_bytes());
            assert!(is_same, "{what}: {} characters: {account}", report.received.count());
            assert_eq!(report.remote.faults, [""; 0], "{what}");
            assert_eq!((report.remote.silences, report.alarms.len()), (0, 0), "{what}");
            assert_eq!(report.programs, 1, "{what}");
            let seen = report.remote.retries_asked + report.remote.retries_heard;
            assert_eq!(seen as usize, retries, "{what}");
        }
    }
}

#[test]
fn a_reset_or_an_alarm_of_the_remote_buffer_ends_the_job() {
    for (press, failure) in
        [(Press::Reset, Failure::PartnerReset), (Press::Alarm, Failure::PartnerAlarm)]
    {
        let mut bench = Bench::new(&[("mode", "remote-a")], remote_a(RemoteOptions::default()));
        bench.press(Press::Read);
        bench.run(SECOND);
        let job = bench.send(&program(1_000));
        bench.run(Micros::from_secs(3));
        assert!(bench.report().remote.data > 0);
        bench.press(press);
        let (why, sent) = bench.end_of(job).expect_err("the control was reset");
        assert_eq!(why, failure);
        bench.run(Micros::from_secs(30));
        let report = bench.report();
        assert_eq!((report.remote.acknowledged, report.remote.silences), (1, 0));
        assert_eq!(report.remote.faults, [""; 0]);
        assert!(sent > 1_000);
    }
}

#[test]
fn protocol_b_is_held_for_as_long_as_it_takes() {
    let program = program(600);
    let control = Options {
        interface: Interface::RemoteB,
        line: seven_even_two(19_200),
        buffer: 4_096,
        reserve: 1_024,
        resume: 2_048,
        block_time: Micros::from_secs(60),
        ..Options::default()
    };
    let mut bench = Bench::new(&[("mode", "remote-b")], control);
    let job = bench.send(&program);
    bench.press(Press::Read);
    assert!(bench.end_of(job).is_ok());
    let report = bench.report();
    assert!(report.received.matches(text_of(&program).as_bytes()));
    assert_eq!((report.alarms.len(), report.holds > 5), (0, true), "{report:?}");
    assert!(report.held > Micros::from_secs(20_000), "{}", report.held);
}
