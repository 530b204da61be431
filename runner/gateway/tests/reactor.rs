//! Lanes of a reactor, each on a pty whose far end the test plays.

#![cfg(target_os = "linux")]

mod lanes;

use lanes::{Bench, program};
use softplug_gateway::reactor::{Condition, JobOutcome, Report};

#[test]
fn a_job_reaches_the_machine_byte_by_byte() {
    let mut bench = Bench::start();
    let lane = bench.add(115_200);
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    let program = program(4_000);
    bench.send(lane, 7, &program);
    assert_eq!(bench.read_from_machine(lane, program.len()), program);
    let end = bench.end_of_job(lane);
    assert_eq!((end.job, end.outcome), (7, JobOutcome::Done));
    assert_eq!((end.taken, end.maybe_left), (4_000, 4_000));
    let figures = bench.figures(lane);
    assert_eq!((figures.condition, figures.bytes_out), (Condition::Up, 4_000));
}
