//! How far a job is and how it ended: one truth wherever one looks, until somebody has seen it.

use softplug_abi::JobId;
use std::sync::Arc;
use std::time::{Duration, Instant};

use softplug_service::Gateway;
use softplug_service::jobs::BeginAt;
use softplug_service::view::{
    Change, JobFilter, JobProgress, JobState, LinkState, LinkView, StopHow,
};

use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

const XON_XOFF: &str = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n";

fn link(gateway: &Gateway) -> LinkView {
    gateway.link("link-0").unwrap()
}

/// The job's progress as the card, the job and the list of jobs have it: all the same, as long
/// as nothing moves.
fn progress(gateway: &Gateway, id: u32) -> JobProgress {
    let of_job = gateway.job(JobId(id)).unwrap().progress;
    let list = gateway.jobs(&JobFilter::default()).unwrap();
    assert_eq!(list.iter().find(|job| job.id == id).unwrap().progress, of_job);
    let link = link(gateway);
    let brief = link.job.or(link.last).expect("it is on the link");
    assert_eq!((brief.id, brief.progress), (id, of_job.clone()));
    of_job
}

#[test]
fn a_job_that_is_held_or_paused_shows_the_same_everywhere() {
    let shop = Shop::with(1, XON_XOFF);
    let gateway = shop.gateway();
    let size = shop.program("O1.nc", 60_000).len() as u64;
    let mut changes = gateway.subscribe();
    let job = gateway.submit("link-0", &send("O1.nc")).unwrap();
    shop.read(0, 30_000);
    shop.hold(0);
    // What was on its way has arrived; nothing moves any more.
    std::thread::sleep(Duration::from_millis(300));
    let held = progress(gateway, job.id);
    assert!(held.is_held && held.surely_left > 20_000, "{held:?}");
    assert!(held.surely_left <= held.maybe_left && held.maybe_left <= size, "{held:?}");
    assert_eq!(held.percent, Some((held.surely_left * 100 / size) as u8));
    assert!(held.text.ends_with("; held by the machine"), "{held:?}");
    assert!(link(gateway).is_held);
    // Who follows what happens is told the same.
    let told = |changes: &mut tokio::sync::broadcast::Receiver<Arc<Change>>| {
        let mut told = None;
        wait_for("the change", || {
            while let Ok(change) = changes.try_recv() {
                if let Change::Job(view) = &*change
                    && view.id == job.id
                {
                    told = Some(view.progress.clone());
                }
            }
            told.is_some()
        });
        told.unwrap()
    };
    let begun = Instant::now();
    while told(&mut changes) != held {
        assert!(begun.elapsed() < Duration::from_mins(1), "it is never told");
    }

    // Paused: the queue stands all the more, but the machine is not said to hold it.
    gateway.pause(JobId(job.id)).unwrap();
    wait_for("the pause", || !link(gateway).is_held);
    let paused = progress(gateway, job.id);
    assert!(!paused.is_held && paused.text.ends_with("; paused"), "{paused:?}");
    assert_eq!(link(gateway).state, LinkState::Paused);
    let holds = link(gateway).counters.holds;
    // The machine lets go meanwhile. Paused it stays, and held it is not afterwards.
    shop.release(0);
    gateway.resume(JobId(job.id)).unwrap();
    shop.drain(0, || gateway.job(JobId(job.id)).unwrap().progress.surely_left > paused.surely_left);
    assert!(!progress_now(gateway, job.id).is_held);
    gateway.pause(JobId(job.id)).unwrap();
    shop.drain(0, || link(gateway).condition.as_deref() == Some("paused"));
    std::thread::sleep(Duration::from_millis(100));
    assert!(!link(gateway).is_held);
    assert_eq!(link(gateway).counters.holds, holds, "a pause is no hold of the machine's");
    gateway.resume(JobId(job.id)).unwrap();
    shop.drain(0, || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    let done = progress(gateway, job.id);
    assert_eq!((done.surely_left, done.maybe_left, done.percent), (size, size, Some(100)));
    assert_eq!((link(gateway).unseen_count, link(gateway).trouble), (0, Vec::new()));
}

fn progress_now(gateway: &Gateway, id: u32) -> JobProgress {
    gateway.job(JobId(id)).unwrap().progress
}

#[test]
fn what_ended_badly_is_trouble_until_somebody_has_seen_it_also_after_a_restart() {
    let mut shop = Shop::with(1, XON_XOFF);
    shop.program("O1.nc", 400_000);
    std::fs::write(shop.path("programs/bad.nc"), b"G1 X\x13\n").unwrap();
    let gateway = shop.gateway().clone();
    // One that fails its check, one that is aborted, one that is taken out of the queue.
    let failed = gateway.submit("link-0", &send("bad.nc")).unwrap().id;
    wait_for("the failure", || gateway.job(JobId(failed)).unwrap().state == JobState::Failed);
    let aborted = gateway.submit("link-0", &send("O1.nc")).unwrap().id;
    let queued = gateway.submit("link-0", &send("O1.nc")).unwrap().id;
    shop.read(0, 20_000);
    gateway.abort(JobId(queued)).unwrap();
    gateway.abort(JobId(aborted)).unwrap();
    shop.drain(0, || gateway.job(JobId(aborted)).unwrap().state == JobState::Aborted);
    wait_for("the line's end", || link(&gateway).state == LinkState::Idle);
    let view = link(&gateway);
    let unseen: Vec<_> = view.unseen.iter().map(|job| job.id).collect();
    assert_eq!((unseen, view.unseen_count), (vec![aborted, failed], 2));
    let last = view.last.clone().unwrap();
    assert_eq!((last.id, last.state), (aborted, JobState::Aborted));
    assert!(last.ended_ms.is_some() && last.progress.surely_left > 0, "{last:?}");
    let trouble = view.trouble.join("; ");
    let says = format!("job {aborted}, O1.nc, aborted: {}", last.progress.text);
    assert!(trouble.contains(&says) && trouble.contains("and 1 before it"), "{trouble}");

    // A new one does not hide them; neither does another start of the gateway.
    drop(gateway);
    let begun = shop.gateway().submit("link-0", &send("O1.nc")).unwrap().id;
    shop.read(0, 20_000);
    shop.gateway().stop(StopHow::Park);
    wait_for("the stop", || {
        shop.drain(0, || true);
        shop.gateway().links().is_err()
    });
    shop.stopped();
    shop.start();
    let gateway = shop.gateway();
    let view = link(gateway);
    let unseen: Vec<_> = view.unseen.iter().map(|job| job.id).collect();
    assert_eq!(unseen, [begun, aborted, failed]);
    assert_eq!(view.last.map(|last| (last.id, last.state)), Some((begun, JobState::Interrupted)));
    assert!(view.trouble[0].contains("interrupted"), "{:?}", view.trouble);

    // Seen: this one and those before it.
    assert!(gateway.acknowledge(JobId(999)).is_err());
    let seen = gateway.acknowledge(JobId(aborted)).unwrap();
    assert_eq!((seen.id, seen.is_unseen, seen.state), (aborted, false, JobState::Aborted));
    assert_eq!(link(gateway).unseen.iter().map(|job| job.id).collect::<Vec<_>>(), [begun]);
    wait_for("the journal", || journal_says(gateway, "have been seen"));
    // Who restarts it has seen it.
    let again = gateway.restart(JobId(begun), BeginAt::Start).unwrap().id;
    assert_eq!((link(gateway).unseen_count, link(gateway).trouble), (0, Vec::new()));
    let early = gateway.acknowledge(JobId(again)).unwrap_err().to_string();
    assert!(early.contains("when it has ended"), "{early}");
    gateway.abort(JobId(again)).unwrap();
    shop.drain(0, || gateway.job(JobId(again)).unwrap().state == JobState::Aborted);
}

#[test]
fn what_a_job_waits_for_is_said_with_what_to_do() {
    let shop = Shop::with(1, "plugin = \"fanuc-rs232\"\nline = \"921600 7E2\"\n");
    let gateway = shop.gateway();
    shop.program("O1.nc", 2_000);
    let job = gateway.submit("link-0", &send("O1.nc")).unwrap();
    wait_for("what is awaited", || progress_now(gateway, job.id).awaits.is_some());
    let waits = progress(gateway, job.id);
    let awaits = waits.awaits.unwrap();
    assert!(awaits.contains("DC1") && awaits.contains("press READ at the control"), "{awaits}");
    assert_eq!(waits.text, format!("nothing has left yet; {awaits}"));
    assert_eq!((waits.surely_left, waits.percent), (0, Some(0)));
    // READ is pressed.
    shop.write(0, b"\x11");
    shop.drain(0, || progress_now(gateway, job.id).awaits.is_none());
    shop.drain(0, || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
}
