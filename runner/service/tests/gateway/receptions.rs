//! What a machine sends: kept in versions, compared with what it was sent, never overwritten.

use softplug_abi::JobId;
use std::io::Read;

use softplug_live::store::Mark;
use softplug_service::jobs::{Jobs, Keep};
use softplug_service::programs::Receptions;
use softplug_service::view::{JobFilter, JobState, ReceptionView, StopHow};

use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

#[test]
fn what_a_machine_sends_is_kept_in_versions_compared_and_never_overwritten() {
    let lines = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n\
                 settings = { preset = \"tape\", quiet-time = 300, end-quiet = 50 }\n";
    let shop = Shop::with(1, lines);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let program = shop.program("O77.nc", 2_000);
    let job = gateway.submit(&link, &send("O77.nc")).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
    wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);

    let mut changed = program.clone();
    changed[1_000] ^= 1;
    let broken_off = &program[..500];
    let all = || gateway.receptions(&link).unwrap();
    for (count, bytes) in (1..).zip([&program[..], &changed, broken_off, broken_off]) {
        shop.write(0, bytes);
        wait_for("the reception", || all().len() == count);
        let filter = JobFilter { link: Some(link.clone()), ..JobFilter::default() };
        wait_for("its end", || gateway.jobs(&filter).unwrap()[0].ended_ms.is_some());
    }
    let of = |file: &str| -> (ReceptionView, Vec<u8>) {
        let mut bytes = Vec::new();
        let mut download = gateway.download_reception(&link, file).unwrap();
        download.file.read_to_end(&mut bytes).unwrap();
        let view = all().into_iter().find(|reception| reception.file == file);
        (view.unwrap_or_else(|| panic!("{file}: {:?}", all())), bytes)
    };
    let (same, bytes) = of("O77");
    assert_eq!(bytes, program);
    let compared = same.compared.unwrap();
    assert_eq!((compared.job, compared.is_same, compared.differs_at), (Some(job.id), true, None));
    let (other, bytes) = of("O77-2");
    assert_eq!(bytes, changed);
    let compared = other.compared.unwrap();
    assert_eq!((compared.is_same, compared.differs_at), (false, Some(1_000)));
    assert!(same.failure.is_none() && other.failure.is_none());
    let failed: Vec<_> =
        all().into_iter().filter(|reception| reception.failure.is_some()).collect();
    assert_eq!(failed.len(), 2, "{failed:?}");
    for reception in failed {
        assert!(reception.file.ends_with(".failed"), "{reception:?}");
        assert_eq!(of(&reception.file).1, broken_off);
        let job = gateway.job(JobId(reception.job.unwrap())).unwrap();
        assert_eq!(job.state, JobState::Failed);
    }
}

#[test]
fn what_came_before_a_kill_belongs_to_a_job() {
    let mut shop = Shop::with(1, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    let link = Shop::name(0);
    let killed = {
        let (jobs, _) = Jobs::open(&shop.path("state"), Keep::default()).unwrap();
        let receptions = Receptions::open(&shop.path("state/receptions")).unwrap();
        let job = jobs.receive(&link).unwrap().id;
        // The second is of a job that nobody knows any more.
        for (id, text) in [(job, "%\nO1\nN10"), (JobId(9_999), "N20 G1")] {
            let mut arrival = receptions.begin(&link, id).unwrap();
            arrival.write(text.as_bytes()).unwrap();
            std::mem::forget(arrival);
        }
        job
    };
    shop.start();
    let gateway = shop.gateway();
    let all = gateway.receptions(&link).unwrap();
    assert_eq!(all.len(), 2, "{all:?}");
    for reception in &all {
        let job = gateway.job(JobId(reception.job.expect("it has a job"))).unwrap();
        assert_eq!(
            (job.state, job.answer.as_ref()),
            (JobState::Interrupted, Some(&reception.file))
        );
        assert_eq!(job.link, link);
        assert!(reception.failure.is_some() && reception.file.ends_with(".failed"));
    }
    let first = all.iter().find(|reception| reception.bytes == 8).unwrap();
    assert_eq!(first.job.map(JobId), Some(killed));
    // Once: the next start finds nothing new.
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    shop.start();
    assert_eq!(shop.gateway().receptions(&link).unwrap(), all);
}

#[test]
fn of_what_was_lost_with_a_gateway_that_was_killed_the_next_start_says_so() {
    let mut shop = Shop::with(2, "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n");
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    let (link, other) = (Shop::name(0), Shop::name(1));
    let (kept, lost, unknown) = {
        let (jobs, _) = Jobs::open(&shop.path("state"), Keep::default()).unwrap();
        let receptions = Receptions::open(&shop.path("state/receptions")).unwrap();
        let begun = |link: &str| jobs.receive(link).unwrap().id;
        let (kept, empty, none, unknown) =
            (begun(&link), begun(&link), begun(&link), begun(&other));
        let mut arrival = receptions.begin(&link, kept).unwrap();
        arrival.write(b"%\nO1\nN10").unwrap();
        std::mem::forget((arrival, receptions.begin(&link, empty).unwrap()));
        // Of this one the file has its name, and the job was not told.
        let mut arrival = receptions.begin(&other, unknown).unwrap();
        arrival.write(b"%\nO2\nM30").unwrap();
        arrival.end(None, Mark::Complete).unwrap();
        (kept, [empty, none], unknown)
    };
    shop.start();
    let gateway = shop.gateway();
    let why = |job| gateway.job(job).unwrap().message.unwrap();
    for job in lost {
        assert!(why(job).ends_with("; nothing of it is on the disk"), "{}", why(job));
    }
    for job in [kept, unknown] {
        assert_eq!(why(job), "the gateway ended in the middle of it");
    }
    let said = "4 jobs were interrupted, 0 wait, 1 receptions were kept as failed, 2 were lost with \
                the gateway: nothing of them is on the disk";
    wait_for("the journal", || journal_says(gateway, said));
}
