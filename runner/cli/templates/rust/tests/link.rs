//! The converter on a bench: a line in virtual time, natively, under a debugger if you like.
//!
//! What the protocol demands is better said in `traces`; here is place for what is easier said in
//! code.

use my_protocol::{ACK, LINE, NAK, Plugin};
use softplug_plugin::Failure;
use softplug_plugin::bench::{Bench, Observed};

#[test]
fn every_line_waits_for_its_answer() {
    let mut bench = Bench::<Plugin>::new().open();
    bench.send(b"G1 X1\nG1 X2");
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), b"G1 X1\n");
    bench.receive(&[ACK]);
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), b"G1 X1\nG1 X2\n");
    bench.receive(&[ACK]);
    let done = bench
        .observed()
        .iter()
        .any(|(_, seen)| *seen == Observed::Done { job: 1, sent: 12 });
    assert!(done, "{:?}", bench.observed());
}

#[test]
fn settings_are_given_as_an_operator_gives_them() {
    let mut bench = Bench::<Plugin>::new().set("repeats", "0").open();
    bench.send(b"G1\n");
    bench.run_for_millis(100);
    bench.receive(&[NAK]);
    let failure = Failure::AttemptsUsedUp;
    let failed = Observed::Failed {
        job: 1,
        failure,
        status: 0,
        sent: 3,
    };
    assert!(
        bench.observed().iter().any(|(_, seen)| *seen == failed),
        "{:?}",
        bench.observed()
    );
}

#[test]
fn the_longest_line_is_taken_and_a_longer_one_is_not() {
    for (length, answer) in [(LINE, ACK), (LINE + 1, NAK)] {
        let mut line = vec![b'x'; length];
        line[length - 1] = b'\n';
        let mut bench = Bench::<Plugin>::new().open();
        bench.receive(&line);
        bench.run_for_millis(10);
        assert_eq!(bench.sent(), [answer]);
        assert_eq!(bench.deliveries().len(), usize::from(answer == ACK));
    }
}

#[test]
fn a_swap_in_the_middle_changes_nothing() {
    let mut bench = Bench::<Plugin>::new().open();
    bench.send(b"one\ntwo\n");
    for _ in 0..40 {
        bench.run_for_millis(1);
        bench.swap();
        if bench.sent().ends_with(b"\n") {
            bench.receive(&[ACK]);
        }
    }
    assert_eq!(bench.sent(), b"one\ntwo\n");
}
