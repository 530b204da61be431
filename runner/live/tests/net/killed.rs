//! A device server that is killed in mid-job, whichever it is.

use softplug_abi::{Failure, JobId, LinkDownReason};
use softplug_live::reactor::{LaneId, Report};

use crate::lanes::{Bench, program};

/// What the test does with its server.
pub(crate) trait Server {
    /// As by `kill -9`.
    fn kill(&mut self);
    /// At the same address, with the same machine.
    fn restart(&mut self);
    /// All that the machine has got, once it has so many bytes.
    fn wait_received(&self, count: usize) -> Vec<u8>;
    /// All that the machine has got, once nothing more is on its way.
    fn received(&self) -> Vec<u8>;
}

/// Kills the server while a job is under way, starts it again, and sends the rest.
pub(crate) fn kill_in_mid_job(bench: &mut Bench, lane: LaneId, server: &mut impl Server) {
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    let program = program(20_000);
    bench.send(lane, JobId(1), &program);
    server.wait_received(500);
    server.kill();
    let lost = |report: &Report| {
        matches!(report, Report::Down { reason: LinkDownReason::Disconnected, .. })
    };
    let Report::Down { detail, .. } = bench.wait_for(lane, lost) else { unreachable!() };
    assert!(detail.contains("closed by the other side"), "{detail}");
    let end = bench.end_of_job(lane);
    let failure =
        softplug_live::reactor::JobOutcome::Failed { failure: Failure::LinkDown, status: 0 };
    assert_eq!((end.job, &end.outcome), (JobId(1), &failure));
    let received = server.received();
    assert!(received == program[..received.len()], "bytes were lost, doubled or reordered");
    let maybe = end.maybe_left as usize;
    assert!((500..program.len()).contains(&received.len()), "{end:?}");
    assert!(received.len() <= maybe, "{} of {end:?}", received.len());

    server.restart();
    bench.wait_for(lane, |report| matches!(report, Report::Up));
    let rest = &program[received.len()..];
    bench.send(lane, JobId(2), rest);
    let all = server.wait_received(program.len());
    assert!(all == program, "{} bytes, after {}", all.len(), received.len());
    let end = bench.end_of_job(lane);
    assert_eq!((end.job, end.taken), (JobId(2), rest.len() as u64));
    assert_eq!(bench.figures(lane).opened, 2);
}
