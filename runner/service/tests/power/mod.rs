//! Loss of power: the storage drops what was not brought onto the disk, in any
//! order and by halves. What was acknowledged is there afterwards, and no job
//! begins twice. `SOFTPLUG_POWER_SEEDS=N` tries more cases.

mod disk;

use softplug_abi::JobId;
use std::collections::BTreeMap;

use disk::Disk;
use redb::Database;
use softplug_host::Digest;
use softplug_service::jobs::{
    Advance, Data, Ending, EntryFilter, Extent, Job, JobSpec, Jobs, JobsError, Keep, Kind, Note,
    Reason, Reception, State, Step, Subject, after,
};

/// A generator that gives the same for a seed on every machine (splitmix64).
#[derive(Clone, Debug)]
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, most: u64) -> u64 {
        self.next() % most
    }
}

fn open(disk: &Disk) -> Result<Jobs, JobsError> {
    let disk = disk.clone();
    let open = move || -> Result<Database, redb::DatabaseError> {
        redb::Builder::new().set_cache_size(1 << 20).create_with_backend(disk.clone())
    };
    let keep = Keep { entries: 50, days: 10, jobs: 30 };
    Jobs::open_with(open, keep).map(|(jobs, _)| jobs)
}

/// One thing that a gateway does; tells the job as it is acknowledged.
fn deed(jobs: &Jobs, dice: &mut Dice) -> Result<Option<Job>, JobsError> {
    let live = jobs.live();
    let any = |dice: &mut Dice| live[dice.below(live.len() as u64) as usize].id;
    let ignore_state = |result: Result<Job, JobsError>| match result {
        Ok(job) => Ok(Some(job)),
        Err(JobsError::State { .. } | JobsError::NotFound(_)) => Ok(None),
        Err(error) => Err(error),
    };
    let data = Data { digest: Digest::of(b"G1"), size: 100_000 };
    match dice.below(10) {
        0 | 1 => jobs.submit(JobSpec::send("lathe", "O1", data)).map(Some),
        2 => jobs.receive("lathe").map(Some),
        3 => jobs
            .note(Note::new(Subject::Gateway, "x".repeat(dice.below(1_500) as usize)))
            .map(|()| None),
        4 => match jobs.next("lathe") {
            Some(job) => jobs.begin(job.id).map(Some),
            None => Ok(None),
        },
        _ if live.is_empty() => Ok(None),
        5 => ignore_state(jobs.pause(any(dice))),
        6 => ignore_state(jobs.resume(any(dice))),
        7 => {
            let id = any(dice);
            let grant = Some(dice.below(100_000));
            jobs.advance(&[Advance { id, grant, surely: Some(dice.below(100_000)) }])?;
            Ok(jobs.live().into_iter().find(|job| job.id == id))
        }
        8 => {
            let id = any(dice);
            let reception = Reception { file: None, bytes: 1, is_complete: true, compared: None };
            ignore_state(jobs.received(id, None, reception, None, None))
        }
        _ => {
            let ending = match dice.below(3) {
                0 => Ending::Done,
                1 => Ending::Aborted,
                _ => Ending::Failed(Reason::new("no-answer", "nobody answers")),
            };
            ignore_state(jobs.end(any(dice), ending, None))
        }
    }
}

/// The state in which a new start finds a job that was in this one.
fn recovered(job: &Job) -> State {
    after(job.state, job.has_begun(), Step::Recover).unwrap_or(job.state)
}

/// Runs until the power fails, and looks at what the next start finds.
fn lose_power(seed: u64) {
    let mut dice = Dice(seed);
    let mut disk = Disk::new(Dice(seed ^ 0x5eed));
    let mut acknowledged: BTreeMap<JobId, Job> = BTreeMap::new();
    // A database gets its name when it is whole.
    drop(open(&disk).unwrap());
    // Several times on the same disk: damage must not add up either.
    for life in 0..4 {
        disk.fail_after(dice.below(if life == 0 { 400 } else { 150 }));
        let mut under_way = None;
        let jobs = open(&disk);
        if let Ok(jobs) = &jobs {
            for job in acknowledged.values_mut() {
                job.state = recovered(job);
            }
            loop {
                let before = jobs.live();
                match deed(jobs, &mut dice) {
                    Ok(Some(job)) => drop(acknowledged.insert(job.id, job)),
                    Ok(None) => {}
                    Err(JobsError::Store(_)) => {
                        under_way = Some(before);
                        break;
                    }
                    Err(error) => panic!("seed {seed}: {error}"),
                }
            }
        }
        drop(jobs);
        disk = disk.after_power_loss();
        let jobs = open(&disk).unwrap_or_else(|error| panic!("seed {seed}, life {life}: {error}"));
        let highest = acknowledged.keys().last().copied().unwrap_or(JobId::NONE);
        for (id, known) in &mut acknowledged {
            let found = match jobs.reader().job(*id) {
                Ok(found) => found,
                // Old ones that have ended are not kept for ever.
                Err(JobsError::NotFound(_)) if known.state.is_final() => continue,
                Err(error) => panic!("seed {seed}, life {life}: job {id}: {error}"),
            };
            assert!(
                !known.has_begun() || found.state != State::Queued,
                "seed {seed}: {id} begins again"
            );
            assert!(!matches!(found.state, State::Running), "seed {seed}: {id} runs by itself");
            // The deed that the power cut short may have come through or not.
            let is_cut_short = under_way.is_some();
            let is_as_known =
                found.state == recovered(known) && found.extent.maybe >= known.extent.maybe;
            assert!(
                is_as_known || (is_cut_short && !known.state.is_final()),
                "seed {seed}, life {life}: {known:?} became {found:?}"
            );
            assert!(found.extent.maybe >= known.extent.maybe || found.state.is_final());
            *known = found;
        }
        let new = jobs.submit(JobSpec::new("lathe", Kind::Fetch, "fetch")).unwrap();
        assert!(new.id > highest, "seed {seed}: number {} is given twice", new.id);
        acknowledged.insert(new.id, new);
        let entries =
            jobs.reader().journal(&EntryFilter { most: 1_000, ..EntryFilter::default() }).unwrap();
        assert!(entries.windows(2).all(|pair| pair[0].number == pair[1].number + 1));
    }
}

#[test]
fn what_was_acknowledged_survives_a_loss_of_power() {
    let seeds = std::env::var("SOFTPLUG_POWER_SEEDS");
    let seeds = seeds.map_or(60, |text| text.parse().expect("a number"));
    for seed in 0..seeds {
        lose_power(seed);
    }
}

#[test]
fn the_storage_of_the_test_does_lose_what_was_not_synced() {
    use redb::StorageBackend;
    let mut lost = 0;
    for seed in 0..50 {
        let disk = Disk::new(Dice(seed));
        disk.set_len(4_096).unwrap();
        disk.write(0, &[1; 4_096]).unwrap();
        disk.sync_data().unwrap();
        disk.write(0, &[2; 2_048]).unwrap();
        disk.write(2_048, &[3; 2_048]).unwrap();
        let disk = disk.after_power_loss();
        let mut bytes = vec![0; 4_096];
        disk.read(0, &mut bytes).unwrap();
        assert!(bytes.chunks(512).all(|sector| sector.iter().all(|byte| *byte == sector[0])));
        lost += u32::from(bytes.contains(&1));
    }
    assert!((10..=50).contains(&lost), "{lost}");
}

#[test]
fn a_full_disk_refuses_and_says_so_and_what_was_acknowledged_stays() {
    let disk = Disk::new(Dice(7));
    let jobs = open(&disk).unwrap();
    let data = Data { digest: Digest::of(b"G1"), size: 1_000 };
    let first = jobs.submit(JobSpec::send("lathe", "O1", data)).unwrap();
    jobs.begin(first.id).unwrap();
    disk.allow_no_growth();
    let mut acknowledged = vec![first.id];
    let error = loop {
        match jobs.submit(JobSpec {
            fields: vec![("text".into(), "x".repeat(3_000))],
            ..JobSpec::send("mill", "O1", data)
        }) {
            Ok(job) => acknowledged.push(job.id),
            Err(error) => break error,
        }
    };
    assert!(error.is_full(), "{error}");
    assert!(error.to_string().ends_with("; make room on the disk"), "{error}");
    // Nothing that was acknowledged is lost, now or after a loss of power, and it goes on with room.
    let live = |jobs: &Jobs| jobs.live().iter().map(|job| job.id).collect::<Vec<_>>();
    assert_eq!(live(&jobs), acknowledged);
    assert_eq!(jobs.reader().job(first.id).unwrap().state, State::Running);
    disk.allow_growth();
    jobs.advance(&[Advance { id: first.id, grant: Some(500), surely: None }]).unwrap();
    jobs.end(first.id, Ending::Aborted, None).unwrap();
    drop(jobs);
    let jobs = open(&disk.after_power_loss()).unwrap();
    assert_eq!(live(&jobs), acknowledged[1..]);
    assert_eq!(jobs.reader().job(first.id).unwrap().extent, Extent { surely: 0, maybe: 500 });
}
