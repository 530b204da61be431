//! A disk that is full for a while: nothing that was acknowledged is lost, nothing goes
//! out that is not written down, it is said, and with room all goes on. The limit is the
//! process's, so there is one test in this file.

use softplug_abi::DeliveryId;
use std::fs;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use softplug_live::reactor::LaneId;
use softplug_live::reservoir::{Drawn, reservoir};
use softplug_service::feeder::{Feeder, FeederNews, Feeding, Pace};
use softplug_service::jobs::{JobSpec, Jobs, Keep, State};
use softplug_service::programs::{Quotas, Receptions, Snapshots};
use softplug_service::reception_writer::{Incoming, ReceptionWriter, ReceptionWriterNews};

/// No file may grow beyond this, or be written there.
fn limit(bytes: Option<u64>) {
    let maximum = getrlimit(Resource::Fsize).maximum;
    let current = bytes.or(maximum);
    setrlimit(Resource::Fsize, Rlimit { current, maximum }).unwrap();
}

fn next<T>(news: &Receiver<T>) -> T {
    news.recv_timeout(Duration::from_mins(1)).expect("news comes")
}

/// The next but that a delivery is over.
fn next_of_writer(news: &Receiver<ReceptionWriterNews>) -> ReceptionWriterNews {
    loop {
        match next(news) {
            ReceptionWriterNews::Over { .. } => {}
            other => return other,
        }
    }
}

#[test]
fn while_the_disk_is_full_nothing_is_lost_and_with_room_it_goes_on() {
    // Else the signal ends the process.
    let seen = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, seen).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (jobs, _) = Jobs::open(&folder.path().join("state"), Keep::default()).unwrap();
    let snapshots = Snapshots::open_folder(&folder.path().join("snapshots")).unwrap();
    let receptions = Receptions::open(&folder.path().join("receptions")).unwrap();

    // A reception: the machine is held where the disk ends.
    let (tell, news) = channel();
    let tell = move |what| tell.send(what).unwrap();
    let quotas = Quotas::new(folder.path(), 0);
    let reception_writer =
        ReceptionWriter::start(jobs.clone(), receptions.clone(), snapshots.clone(), quotas, tell)
            .unwrap();
    let (mut writer, reader) = reservoir(10_000, 0, 10_000);
    let (link, place) = ("lathe".to_owned(), "lathe".to_owned());
    reception_writer.take(Incoming {
        lane: LaneId(1),
        link,
        place,
        delivery: DeliveryId(1),
        job: None,
        unit: None,
        bytes: reader,
    });
    assert!(matches!(next_of_writer(&news), ReceptionWriterNews::Begun(_)));
    let database = fs::metadata(folder.path().join("state/jobs.redb")).unwrap().len();
    let most = database + 12_345;
    let program: Vec<u8> =
        (0..).map(|n: u32| (n % 251) as u8).take(most as usize + 50_000).collect();
    limit(Some(most));
    let mut given = 0;
    let said = loop {
        given += writer.write(&program[given..]);
        match news.try_recv() {
            Ok(ReceptionWriterNews::Stuck { why, .. }) => break why,
            Ok(other) => panic!("{other:?}"),
            Err(_) => std::thread::yield_now(),
        }
    };
    assert!(said.contains("what comes on \"lathe\" cannot be written: "), "{said}");
    given += writer.write(&program[given..]);
    assert_eq!((writer.level(), writer.write(&program[given..])), (10_000, 0));
    // A unit forgets what is told as read.
    let written: u64 = fs::read_dir(folder.path().join("receptions/lathe"))
        .unwrap()
        .map(|file| file.unwrap().metadata().unwrap().len())
        .sum();
    assert!((1..=written).contains(&writer.consumed()), "{written} of {}", writer.consumed());
    limit(None);
    assert!(matches!(next_of_writer(&news), ReceptionWriterNews::GoesOn { .. }));
    while given < program.len() {
        given += writer.write(&program[given..]);
        std::thread::yield_now();
    }
    writer.finish();
    reception_writer.end(LaneId(1), DeliveryId(1), None, 0, given as u64);
    let ReceptionWriterNews::Kept(job) = next_of_writer(&news) else { panic!("it is kept") };
    assert_eq!(job.state, State::Done);
    let file = job.reception.unwrap().file.unwrap();
    assert!(fs::read(folder.path().join("receptions/lathe").join(file)).unwrap() == program);

    // One whose beginning is refused first: it is taken once, also for its name.
    let (mut writer, reader) = reservoir(10_000, 0, 10_000);
    let (link, place) = ("lathe".to_owned(), "lathe".to_owned());
    reception_writer.take(Incoming {
        lane: LaneId(1),
        link,
        place,
        delivery: DeliveryId(2),
        job: None,
        unit: None,
        bytes: reader,
    });
    assert!(matches!(next_of_writer(&news), ReceptionWriterNews::Begun(_)));
    limit(Some(1));
    assert_eq!(writer.write(b"O1"), 2);
    assert!(matches!(next_of_writer(&news), ReceptionWriterNews::Stuck { .. }));
    limit(None);
    assert!(matches!(next_of_writer(&news), ReceptionWriterNews::GoesOn { .. }));
    assert_eq!(writer.write(b"234\nM30\n"), 8);
    writer.finish();
    reception_writer.end(LaneId(1), DeliveryId(2), None, 0, 10);
    let ReceptionWriterNews::Kept(job) = next_of_writer(&news) else { panic!("it is kept") };
    assert_eq!(job.reception.unwrap().file.as_deref(), Some("O1234"));
    let file = folder.path().join("receptions/lathe/O1234");
    assert_eq!(fs::read(file).unwrap(), b"O1234\nM30\n");

    // What is told is the same each time: no name of a file that is gone again stands in it.
    limit(Some(1));
    let refused = || snapshots.take_all(&mut &program[..], "O2", 1 << 20).unwrap_err().to_string();
    let told = [refused(), refused()];
    limit(None);
    assert!(told[0] == told[1] && told[0].contains("make room on the disk"), "{told:?}");

    // A job: what can't be written down does not go out.
    let data = snapshots.take_all(&mut &program[..60_000], "O1", 1 << 20).unwrap();
    let id = jobs.submit(JobSpec::send("lathe", "O1", data)).unwrap().id;
    jobs.begin(id).unwrap();
    let (tell, news) = channel();
    let tell = move |what| tell.send(what).unwrap();
    let feeder = Feeder::start(jobs.clone(), snapshots.clone(), tell).unwrap();
    let (to, mut reader) = reservoir(8_192, 2_048, 6_000);
    let pace = Pace { packet: 512, characters_a_second: None };
    limit(Some(1));
    feeder.feed(Feeding {
        job: id,
        data,
        from: 0,
        gate: None,
        to,
        pace,
        is_check: false,
        status: None,
    });
    let stalled = next(&news);
    let mut buffer = [0; 1_000];
    let drawn = reader.read(&mut buffer);
    let refused = jobs.submit(JobSpec::send("lathe", "O1", data)).map(drop);
    limit(None);
    assert!(
        matches!(&stalled, FeederNews::Stalled(why) if why.ends_with("make room on the disk")),
        "{stalled:?}"
    );
    assert_eq!(drawn, Drawn::Later);
    assert!(refused.unwrap_err().is_full());
    assert_eq!(next(&news), FeederNews::GoesOn);
    let mut taken = Vec::new();
    loop {
        match reader.read(&mut buffer) {
            Drawn::Bytes(count) => taken.extend_from_slice(&buffer[..count]),
            Drawn::Later => std::thread::yield_now(),
            end => break assert_eq!(end, Drawn::End),
        }
    }
    assert!(taken == program[..60_000]);
    assert_eq!(jobs.reader().job(id).unwrap().extent.maybe, 60_000);
}
