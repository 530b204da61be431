//! Stops: jobs are parked, or finished first.

use softplug_abi::JobId;
use softplug_service::Refusal;
use softplug_service::view::{JobState, StopHow};

use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

const LINES: &str = "plugin = \"xon-xoff\"\nline = \"115200 8N1\"\n";

#[test]
fn a_stop_parks_jobs_and_says_how_far_they_were() {
    let mut shop = Shop::with(1, LINES);
    let gateway = shop.gateway().clone();
    shop.program("O1.nc", 400_000);
    let job = gateway.submit(&Shop::name(0), &send("O1.nc")).unwrap();
    shop.read(0, 20_000);
    gateway.stop(StopHow::Park);
    shop.stopped();
    assert!(matches!(gateway.links(), Err(Refusal::Unavailable(_))));
    drop(gateway);
    shop.start();
    let job = shop.gateway().job(JobId(job.id)).unwrap();
    assert_eq!(job.state, JobState::Interrupted);
    assert!(
        job.progress.maybe_left >= 20_000 && job.progress.surely_left <= job.progress.maybe_left,
        "{job:?}"
    );
    assert!(job.last_block.is_some(), "{job:?}");
    assert!(journal_says(shop.gateway(), "the gateway has stopped"));
}

#[test]
fn a_stop_that_finishes_ends_what_runs_and_begins_nothing() {
    let mut shop = Shop::with(1, LINES);
    let gateway = shop.gateway().clone();
    let program = shop.program("O1.nc", 60_000);
    let next = shop.program("O2.nc", 500);
    let running = gateway.submit(&Shop::name(0), &send("O1.nc")).unwrap();
    let waiting = gateway.submit(&Shop::name(0), &send("O2.nc")).unwrap();
    let mut got = shop.read(0, 10_000);
    gateway.stop(StopHow::Finish);
    wait_for("the stop", || !gateway.ready().is_ready);
    let refusal = gateway.submit(&Shop::name(0), &send("O2.nc")).unwrap_err();
    assert!(matches!(refusal, Refusal::Unavailable(_)), "{refusal}");
    got.extend(shop.read(0, program.len() - got.len()));
    shop.stopped();
    drop(gateway);
    assert_eq!(got, program);

    shop.start();
    let job = shop.gateway().job(JobId(running.id)).unwrap();
    assert_eq!((job.state, job.progress.surely_left), (JobState::Done, program.len() as u64));
    // What waited goes on waiting for its turn, which has come.
    assert_eq!(shop.read(0, next.len()), next);
    let is_done = || shop.gateway().job(JobId(waiting.id)).unwrap().state == JobState::Done;
    wait_for("the next job", is_done);
}

#[test]
fn who_is_tired_of_waiting_stops_again_and_the_job_is_parked() {
    let mut shop = Shop::with(1, LINES);
    let gateway = shop.gateway().clone();
    shop.program("O1.nc", 400_000);
    let job = gateway.submit(&Shop::name(0), &send("O1.nc")).unwrap();
    shop.read(0, 5_000);
    gateway.stop(StopHow::Finish);
    shop.read(0, 5_000);
    assert_eq!(gateway.job(JobId(job.id)).unwrap().state, JobState::Running);
    gateway.stop(StopHow::Park);
    shop.stopped();
    drop(gateway);
    shop.start();
    assert_eq!(shop.gateway().job(JobId(job.id)).unwrap().state, JobState::Interrupted);
}
