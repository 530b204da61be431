//! Stops: jobs are parked, or finished first, and what was received is put away.

use softplug_abi::JobId;
use std::fs;

use softplug_service::Refusal;
use softplug_service::view::{JobFilter, JobState, StopHow};

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

/// A machine that ends what it sends by being quiet.
const TAPE: &str = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n\
                    settings = { preset = \"tape\", quiet-time = 300, end-quiet = 50 }\n";
const SENT: &[u8] = b"%\nO7\nN10 G1 X1\nM30\n%\n";

/// A link that has received something which cannot be put away: a file is where its folder should be.
fn stuck() -> Shop {
    let shop = Shop::with(1, TAPE);
    fs::write(shop.path("state/receptions").join(Shop::name(0)), "in the way").unwrap();
    shop.write(0, SENT);
    wait_for("the refusal", || journal_says(shop.gateway(), "; the machine is held"));
    let idle = || shop.gateway().link(&Shop::name(0)).unwrap().receiving.is_none();
    wait_for("the end of what comes", idle);
    shop
}

#[test]
fn a_stop_waits_until_what_was_received_is_put_away() {
    let mut shop = stuck();
    let link = Shop::name(0);
    let gateway = shop.gateway().clone();
    let refusal = gateway.make_way().unwrap_err();
    let text = format!("what {link} received is not put away yet");
    assert!(matches!(&refusal, Refusal::Conflict(why) if why.contains(&text)), "{refusal}");
    gateway.stop(StopHow::Park);
    wait_for("the reason", || journal_says(&gateway, "once more to give it up"));
    fs::remove_file(shop.path("state/receptions").join(&link)).unwrap();
    assert_eq!(shop.stopped(), 0);
    drop(gateway);
    shop.start();
    let receptions = shop.gateway().receptions(&link).unwrap();
    let [reception] = &receptions[..] else { panic!("{receptions:?}") };
    assert_eq!((&*reception.file, &reception.failure), ("O7", &None));
    assert_eq!(fs::read(shop.path("state/receptions").join(&link).join("O7")).unwrap(), SENT);
    assert!(journal_says(
        shop.gateway(),
        "0 jobs were interrupted, 0 wait, 0 receptions were kept"
    ));
}

#[test]
fn who_stops_again_gives_up_what_cannot_be_put_away_and_is_told_what_is_lost() {
    let mut shop = stuck();
    let gateway = shop.gateway().clone();
    gateway.stop(StopHow::Finish);
    wait_for("the reason", || journal_says(&gateway, "once more to give it up"));
    gateway.stop(StopHow::Park);
    assert_eq!(shop.stopped(), SENT.len() as u64);
    drop(gateway);
    fs::remove_file(shop.path("state/receptions").join(Shop::name(0))).unwrap();
    shop.start();
    let gateway = shop.gateway();
    let lost = format!("{} bytes that \"{}\" received are lost", SENT.len(), Shop::name(0));
    assert!(journal_says(gateway, &lost));
    let jobs = gateway.jobs(&JobFilter::default()).unwrap();
    let [job] = &jobs[..] else { panic!("{jobs:?}") };
    let reason = job.message.as_ref().unwrap();
    let is_told = reason.ends_with(&format!("{} bytes of it are lost", SENT.len()));
    assert!(job.state == JobState::Failed && is_told, "{job:?}");
    assert!(journal_says(gateway, "0 jobs were interrupted, 0 wait, 0 receptions were kept"));
}
