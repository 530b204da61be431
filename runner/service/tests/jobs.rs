//! Jobs: the queue, what is written down, and what a new start makes of it.

use softplug_abi::{DeliveryId, JobId};
use std::path::Path;

use proptest::prelude::*;
use softplug_host::Digest;
use softplug_live::units::StoredDelivery;
use softplug_service::jobs::{
    Advance, BeginAt, Comparison, Data, Ending, EntryFilter, Extent, FromUnit, Job, JobFilter,
    JobSpec, Jobs, Keep, Kind, Left, Note, Origin, Reason, Reception, State, Subject, Weight,
};
use softplug_service::programs::Snapshots;

const DATA: fn() -> Data = || Data { digest: Digest::of(b"G1"), size: 1_000 };

fn open(folder: &Path) -> Jobs {
    Jobs::open(folder, Keep::default()).unwrap().0
}

fn send(jobs: &Jobs, link: &str, priority: i32) -> JobId {
    jobs.submit(JobSpec { priority, ..JobSpec::send(link, "O1", DATA()) }).unwrap().id
}

fn texts(jobs: &Jobs) -> Vec<String> {
    let filter = EntryFilter { most: 1_000, ..EntryFilter::default() };
    let entries = jobs.reader().journal(&filter).unwrap();
    entries.into_iter().rev().map(|entry| entry.note.text).collect()
}

/// A plug-in, or a unit of which it is said, may be done while there is more.
#[test]
fn what_was_not_taken_of_a_job_that_is_done_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    for taken in [0, 600, 1_000] {
        let id = send(&jobs, "lathe", 0);
        jobs.begin(id).unwrap();
        let extent = Extent { surely: taken, maybe: taken };
        let job = jobs.end(id, Ending::Done, Some(Left { extent, taken, sent: taken })).unwrap();
        assert_eq!((job.state, job.extent), (State::Done, extent));
        let is_had = jobs.reader().last_sent("lathe", "O1").unwrap().is_some();
        assert_eq!(is_had, taken == 1_000, "{taken}");
    }
    let told: Vec<_> = texts(&jobs).into_iter().filter(|text| text.contains("is done")).collect();
    assert_eq!(
        told,
        [
            "job 1 is done; nothing has left",
            "job 2 is done; 600 of 1,000 bytes have left, 60 %",
            "job 3 is done",
        ]
    );
}

#[test]
fn a_job_goes_its_way_and_the_journal_tells_it() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let (low, high) = (send(&jobs, "lathe", 0), send(&jobs, "lathe", 5));
    let elsewhere = send(&jobs, "mill", 0);
    assert_eq!(jobs.next("lathe").unwrap().id, high);
    jobs.begin(high).unwrap();
    assert_eq!(jobs.next("lathe"), None);
    assert_eq!(jobs.next("mill").unwrap().id, elsewhere);
    jobs.pause(high).unwrap();
    assert_eq!(jobs.next("lathe"), None);
    jobs.resume(high).unwrap();
    jobs.end(high, Ending::Done, None).unwrap();
    jobs.pause(low).unwrap();
    assert_eq!(jobs.next("lathe"), None);
    assert_eq!(jobs.resume(low).unwrap().state, State::Queued);
    assert_eq!(jobs.next("lathe").unwrap().id, low);
    assert_eq!(jobs.abort(low).unwrap().state, State::Aborted);
    assert_eq!(jobs.next("lathe"), None);
    assert_eq!(jobs.reader().last_sent("lathe", "O1").unwrap().unwrap().job, high);
    assert_eq!(jobs.reader().last_sent("mill", "O1").unwrap(), None);
    assert_eq!(
        texts(&jobs),
        [
            "job 1 is queued: sends O1, 1000 bytes",
            "job 2 is queued: sends O1, 1000 bytes",
            "job 3 is queued: sends O1, 1000 bytes",
            "job 2 begins: sends O1, 1000 bytes",
            "job 2 is paused",
            "job 2 goes on",
            "job 2 is done",
            "job 1 is paused",
            "job 1 goes on",
            "job 1 is aborted, it had not begun",
        ]
    );
}

#[test]
fn refusals_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let snapshots = Snapshots::open_folder(&folder.path().join("snapshots")).unwrap();
    let id = send(&jobs, "lathe", 0);
    let refused = |result: Result<Job, _>| {
        result
            .map(|job| job.id)
            .map_err(|error: softplug_service::jobs::JobsError| error.to_string())
    };
    assert_eq!(refused(jobs.pause(JobId(7))), Err("there is no job 7".to_owned()));
    assert_eq!(refused(jobs.resume(id)), Err("job 1 is queued: it cannot be resumed".to_owned()));
    assert_eq!(
        refused(jobs.end(id, Ending::Done, None)),
        Err("job 1 is queued: it cannot be ended".to_owned())
    );
    assert_eq!(
        refused(jobs.restart(id, BeginAt::Start, None, &snapshots)),
        Err("job 1 is queued: it can be restarted when it has ended".to_owned())
    );
    jobs.abort(id).unwrap();
    assert_eq!(
        refused(jobs.begin(id)),
        Err("job 1 is aborted: it cannot be begun; restart it, from a block if need be".to_owned())
    );
    let fetch = jobs.submit(JobSpec::new("lathe", Kind::Fetch, "fetch")).unwrap().id;
    jobs.abort(fetch).unwrap();
    assert_eq!(
        refused(jobs.restart(fetch, BeginAt::Block(2), None, &snapshots)),
        Err("the job has no program, and so no blocks".to_owned())
    );
    assert!(jobs.restart(fetch, BeginAt::Start, None, &snapshots).is_ok());
    let behind = JobSpec { from: 1_001, ..JobSpec::send("lathe", "O1", DATA()) };
    assert!(jobs.submit(behind).is_err());
    for _ in 0..1_000 {
        let taken = jobs.submit(JobSpec::send("full", "O1", DATA()));
        assert!(taken.is_ok(), "a queue takes a thousand");
    }
    assert_eq!(
        refused(jobs.submit(JobSpec::send("full", "O1", DATA()))),
        Err("1000 jobs wait on \"full\", no more are taken: abort some, or wait".to_owned())
    );
}

#[test]
fn a_second_gateway_is_kept_out() {
    let folder = tempfile::tempdir().unwrap();
    let _jobs = open(folder.path());
    let error = Jobs::open(folder.path(), Keep::default()).map(drop).unwrap_err();
    assert!(
        error
            .to_string()
            .ends_with("another gateway uses them; each needs a state folder of its own"),
        "{error}"
    );
}

#[test]
fn what_is_no_database_is_refused_and_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("jobs.redb");
    let refused = || Jobs::open(folder.path(), Keep::default()).map(drop).unwrap_err().to_string();
    drop(open(folder.path()));
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, "").unwrap();
    let text = refused();
    assert!(text.contains("the file is empty; put a copy of it in its place"), "{text}");
    assert_eq!(std::fs::read(&path).unwrap(), b"");
    std::fs::write(&path, &whole[..100]).unwrap();
    refused();
    assert_eq!(std::fs::read(&path).unwrap(), whole[..100]);
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    assert!(refused().contains("it is no file"), "{}", refused());
}

#[test]
fn what_was_under_way_is_interrupted_by_a_new_start_and_never_begun_again() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let ids: Vec<_> = (0..5).map(|_| send(&jobs, "lathe", 0)).collect();
    let begun = |id: JobId, link: &str| {
        // Each on a link of its own, so that all can be under way.
        let spec = JobSpec::send(link, "O1", DATA());
        assert_eq!(jobs.submit(spec).unwrap().id, id);
        jobs.begin(id).unwrap();
    };
    begun(JobId(6), "a");
    begun(JobId(7), "b");
    begun(JobId(8), "c");
    jobs.advance(&[
        Advance { id: JobId(6), grant: Some(400), surely: Some(100) },
        Advance { id: JobId(7), grant: Some(300), surely: None },
        Advance { id: JobId(99), grant: Some(300), surely: None },
    ])
    .unwrap();
    jobs.advance(&[Advance { id: JobId(6), grant: None, surely: Some(900) }]).unwrap();
    jobs.pause(JobId(7)).unwrap();
    jobs.end(JobId(8), Ending::Done, None).unwrap();
    jobs.pause(ids[1]).unwrap();
    let receiving = jobs.receive("lathe").unwrap().id;
    drop(jobs);

    let (jobs, recovery) = Jobs::open(folder.path(), Keep::default()).unwrap();
    let interrupted: Vec<_> = recovery.interrupted.iter().map(|job| job.id).collect();
    assert_eq!((interrupted, recovery.queued), (vec![JobId(6), JobId(7), receiving], 4));
    let job = jobs.reader().job(JobId(6)).unwrap();
    assert_eq!((job.state, job.extent), (State::Interrupted, Extent { surely: 400, maybe: 400 }));
    assert_eq!(jobs.reader().job(JobId(7)).unwrap().extent, Extent { surely: 0, maybe: 300 });
    assert_eq!(jobs.reader().job(JobId(8)).unwrap().state, State::Done);
    assert_eq!(jobs.reader().job(ids[1]).unwrap().state, State::Paused);
    assert_eq!((jobs.next("a"), jobs.next("b")), (None, None));
    assert_eq!(jobs.next("lathe").unwrap().id, ids[0]);
    assert!(texts(&jobs).contains(
        &"job 7 is interrupted: the gateway ended in the middle of it; nothing has surely left, up to 300 of 1,000 bytes may have".to_owned()
    ));
    // Numbers go on.
    assert_eq!(send(&jobs, "lathe", 0), receiving.next());
    drop(jobs);
    assert_eq!(Jobs::open(folder.path(), Keep::default()).unwrap().1.interrupted, []);
}

#[test]
fn what_the_link_knows_narrows_what_was_granted_and_never_widens_it() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let end = |link: &str, granted, left| {
        let id = send(&jobs, link, 0);
        jobs.begin(id).unwrap();
        jobs.advance(&[Advance { id, grant: Some(granted), surely: Some(100) }]).unwrap();
        let reason = Reason::new("link-down", "the port is gone");
        jobs.end(id, Ending::Failed(reason), Some(Left { extent: left, taken: 7, sent: 8 }))
            .unwrap()
            .extent
    };
    assert_eq!(
        end("a", 400, Extent { surely: 200, maybe: 210 }),
        Extent { surely: 200, maybe: 210 }
    );
    assert_eq!(
        end("b", 400, Extent { surely: 50, maybe: 900 }),
        Extent { surely: 100, maybe: 400 }
    );
    assert_eq!(end("c", 400, Extent { surely: 0, maybe: 0 }), Extent { surely: 100, maybe: 100 });
}

#[test]
fn a_job_is_done_again_from_a_block_with_the_data_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let snapshots = Snapshots::open_folder(&folder.path().join("snapshots")).unwrap();
    let program = "%\nO1\nN10 G0\nN20 G1\nN30 M30\n%\n";
    let data = snapshots.take_all(&mut program.as_bytes(), "O1", 1_000).unwrap();
    let first = jobs
        .submit(JobSpec {
            fields: vec![("from_block".into(), "2".into()), ("from_sequence".into(), "20".into())],
            ..JobSpec::send("lathe", "O1", data)
        })
        .unwrap();
    jobs.begin(first.id).unwrap();
    jobs.end(first.id, Ending::Interrupted("stopped".into()), None).unwrap();

    let again = jobs.restart(first.id, BeginAt::Block(4), None, &snapshots).unwrap();
    assert_eq!(
        (again.spec.from, again.spec.from_block, again.spec.restarts),
        (12, 4, Some(first.id))
    );
    assert_eq!(&program[12..18], "N20 G1");
    assert!(again.id != first.id && again.state == State::Queued);
    let again = jobs.restart(first.id, BeginAt::Byte(5), None, &snapshots).unwrap();
    assert_eq!(again.spec.from, 5);
    let by_plug_in =
        jobs.restart(first.id, BeginAt::Block(4), Some("from_line"), &snapshots).unwrap();
    assert_eq!(
        (by_plug_in.spec.from, &by_plug_in.spec.fields[..]),
        (0, &[("from_line".into(), "4".into())][..])
    );
    for at in [BeginAt::Block(0), BeginAt::Block(7), BeginAt::Byte(31)] {
        assert!(jobs.restart(first.id, at, None, &snapshots).is_err(), "{at:?}");
    }
    // What was sent in part does not count as what the machine has.
    let partial = jobs.next("lathe").unwrap();
    jobs.begin(partial.id).unwrap();
    jobs.end(partial.id, Ending::Done, None).unwrap();
    assert_eq!(jobs.reader().last_sent("lathe", "O1").unwrap(), None);
    assert_eq!(jobs.reader().needed_data().unwrap().len(), 1);
}

#[test]
fn receptions_are_jobs_that_do_not_keep_others_from_being_sent() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let sending = send(&jobs, "lathe", 0);
    let coming = jobs.receive("lathe").unwrap();
    assert_eq!((coming.state, coming.spec.origin), (State::Running, Origin::Machine));
    assert_eq!(jobs.next("lathe").unwrap().id, sending);
    let compared = Some(Comparison { with: 1, differs_at: Some(17) });
    let reception = Reception { file: Some("O1-2".into()), bytes: 30, is_complete: true, compared };
    let ended = jobs.received(coming.id, Some("O1".into()), reception.clone(), None, None).unwrap();
    assert_eq!((ended.state, ended.reception), (State::Done, Some(reception.clone())));

    let failed = jobs.receive("lathe").unwrap();
    let reason = Reason::new("no-end-mark", "reception ended without the end mark");
    let cut = Reception {
        file: Some("O1.failed".into()),
        is_complete: false,
        compared: None,
        ..reception.clone()
    };
    assert_eq!(
        jobs.received(failed.id, None, cut, Some(reason), None).unwrap().state,
        State::Failed
    );
    assert_eq!(
        texts(&jobs)[2..],
        [
            "job 2: 30 bytes of O1 came; kept as O1-2; differs from what job 1 sent at byte 17",
            "job 3: the machine sends",
            "job 3: 30 bytes came, not all: reception ended without the end mark; kept as O1.failed",
        ]
    );
    // An answer belongs to the job that asked for it, which ends by itself.
    let fetch = jobs.submit(JobSpec::new("mill", Kind::Fetch, "fetch")).unwrap().id;
    jobs.begin(fetch).unwrap();
    assert_eq!(jobs.received(fetch, None, reception, None, None).unwrap().state, State::Running);
    let ended = jobs.end(fetch, Ending::Done, None).unwrap();
    assert!(ended.reception.is_some() && ended.state == State::Done);
}

#[test]
fn lists_and_the_journal_are_bounded_and_can_be_filtered() {
    let folder = tempfile::tempdir().unwrap();
    let keep = Keep { entries: 20, days: 1, jobs: 10 };
    let (jobs, _) = Jobs::open(folder.path(), keep).unwrap();
    let kept = send(&jobs, "waiting", 0);
    for _ in 0..40 {
        let id = send(&jobs, "lathe", 0);
        jobs.abort(id).unwrap();
    }
    let all = jobs.reader().list(&JobFilter { most: 1_000, ..JobFilter::default() }).unwrap();
    assert!((10..=14).contains(&all.len()), "{}", all.len());
    assert_eq!(all.last().unwrap().id, kept);
    assert!(all.windows(2).all(|pair| pair[0].id > pair[1].id));
    let filter = JobFilter { state: Some(State::Queued), most: 5, ..JobFilter::default() };
    assert_eq!(jobs.reader().list(&filter).unwrap().len(), 1);
    let filter =
        JobFilter { link: Some("lathe".into()), before: Some(40), most: 3, ..JobFilter::default() };
    let ids: Vec<_> = jobs.reader().list(&filter).unwrap().iter().map(|job| job.id).collect();
    assert_eq!(ids, [39, 38, 37].map(JobId));

    jobs.note(Note::new(Subject::Fault, "it trapped").of_link("mill").weighing(Weight::Alarm))
        .unwrap();
    let entries =
        jobs.reader().journal(&EntryFilter { most: 1_000, ..EntryFilter::default() }).unwrap();
    assert_eq!(entries.len(), 20);
    assert!(entries.windows(2).all(|pair| pair[0].number == pair[1].number + 1));
    let filter = EntryFilter { at_least: Weight::Warning, most: 10, ..EntryFilter::default() };
    let alarms = jobs.reader().journal(&filter).unwrap();
    assert_eq!((alarms.len(), &*alarms[0].note.text), (1, "it trapped"));
    let filter = EntryFilter { before: Some(entries[5].number), most: 2, ..EntryFilter::default() };
    assert_eq!(jobs.reader().journal(&filter).unwrap(), entries[6..8]);
    // Aged ones go when enough others came.
    let keep = Keep { days: 0, ..keep };
    drop(jobs);
    std::thread::sleep(std::time::Duration::from_millis(5));
    let (jobs, _) = Jobs::open(folder.path(), keep).unwrap();
    for number in 0..64 {
        jobs.note(Note::new(Subject::Gateway, format!("note {number}"))).unwrap();
    }
    let entries =
        jobs.reader().journal(&EntryFilter { most: 1_000, ..EntryFilter::default() }).unwrap();
    assert!(entries.iter().all(|entry| entry.note.text.starts_with("note")));
}

/// What a gateway or a person may do, at random.
#[derive(Clone, Debug)]
enum Deed {
    Submit(i32),
    Begin,
    Pause(JobId),
    Resume(JobId),
    Abort(JobId),
    End(JobId, bool),
    Grant(JobId, u64),
    Restart,
}

fn deed() -> impl Strategy<Value = Deed> {
    let id = (1..12_u32).prop_map(JobId);
    prop_oneof![
        (-3..3_i32).prop_map(Deed::Submit),
        Just(Deed::Begin),
        id.clone().prop_map(Deed::Pause),
        id.clone().prop_map(Deed::Resume),
        id.clone().prop_map(Deed::Abort),
        (id.clone(), any::<bool>()).prop_map(|(id, done)| Deed::End(id, done)),
        (id, 0..1_000_u64).prop_map(|(id, to)| Deed::Grant(id, to)),
        Just(Deed::Restart),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_is_done_one_job_at_a_time_has_the_link_and_none_begins_twice(
        deeds in proptest::collection::vec(deed(), 1..60),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let mut jobs = open(folder.path());
        let mut begun = std::collections::BTreeSet::new();
        for deed in deeds {
            // What is refused changes nothing, and is not looked at here.
            match deed {
                Deed::Submit(priority) => drop(send(&jobs, "lathe", priority)),
                Deed::Begin => {
                    if let Some(job) = jobs.next("lathe") {
                        jobs.begin(job.id).unwrap();
                        prop_assert!(begun.insert(job.id), "{} began twice", job.id);
                    }
                }
                Deed::Pause(id) => drop(jobs.pause(id)),
                Deed::Resume(id) => drop(jobs.resume(id)),
                Deed::Abort(id) => drop(jobs.abort(id)),
                Deed::End(id, true) => drop(jobs.end(id, Ending::Done, None)),
                Deed::End(id, false) => drop(jobs.end(id, Ending::Aborted, None)),
                Deed::Grant(id, to) => {
                    jobs.advance(&[Advance { id, grant: Some(to), surely: None }]).unwrap();
                }
                Deed::Restart => {
                    let before = jobs.live();
                    drop(jobs);
                    let (again, recovery) = Jobs::open(folder.path(), Keep::default()).unwrap();
                    for job in before {
                        let now = again.reader().job(job.id).unwrap();
                        prop_assert_eq!(now.extent, job.extent);
                        let expected = if job.has_begun() { State::Interrupted } else { job.state };
                        prop_assert_eq!(now.state, expected);
                        prop_assert_eq!(recovery.interrupted.contains(&now), job.has_begun());
                    }
                    jobs = again;
                }
            }
            prop_assert!(jobs.live().iter().filter(|job| job.occupies()).count() <= 1);
        }
    }
}

#[test]
fn what_was_sent_is_known_by_its_file_and_by_the_name_that_it_says_of_itself() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = open(folder.path());
    let named = Some("O4711".to_owned());
    let spec = JobSpec { named, ..JobSpec::send("lathe", "parts/flange.nc", DATA()) };
    let job = jobs.submit(spec).unwrap();
    assert_eq!(job.other_name(), Some("O4711"));
    jobs.begin(job.id).unwrap();
    jobs.end(job.id, Ending::Done, None).unwrap();
    for name in ["flange", "O4711"] {
        assert_eq!(
            jobs.reader().last_sent("lathe", name).unwrap().map(|sent| sent.job),
            Some(job.id)
        );
    }
    assert!(
        texts(&jobs)[0].ends_with("sends parts/flange.nc (O4711), 1000 bytes"),
        "{:?}",
        texts(&jobs)
    );
    let named = Some("O0012".to_owned());
    let same = jobs.submit(JobSpec { named, ..JobSpec::send("lathe", "12.nc", DATA()) }).unwrap();
    assert_eq!(same.other_name(), None);
}

#[test]
fn the_last_delivery_of_a_unit_that_is_stored_is_known_after_a_start() {
    let folder = tempfile::tempdir().unwrap();
    let port = "unit://10.0.0.17:7640/mill";
    let said = |delivery| StoredDelivery { unit: 1 << 40, delivery: DeliveryId(delivery) };
    let stored = |delivery| FromUnit { port: port.to_owned(), said: said(delivery) };
    let reception = Reception { file: None, bytes: 3, is_complete: true, compared: None };
    {
        let (jobs, _) = Jobs::open(folder.path(), Keep::default()).unwrap();
        assert_eq!(jobs.reader().stored_delivery(port).unwrap(), None);
        for delivery in [3, 4] {
            let coming = jobs.receive("mill").unwrap();
            let kept =
                jobs.received(coming.id, None, reception.clone(), None, Some(stored(delivery)));
            assert_eq!(kept.unwrap().state, State::Done);
        }
        let local = jobs.receive("mill").unwrap();
        jobs.received(local.id, None, reception, None, None).unwrap();
    }
    let (jobs, _) = Jobs::open(folder.path(), Keep::default()).unwrap();
    assert_eq!(jobs.reader().stored_delivery(port).unwrap(), Some(said(4)));
    assert_eq!(jobs.reader().stored_delivery("lathe").unwrap(), None);
}
