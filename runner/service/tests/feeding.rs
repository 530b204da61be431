//! The feeder and the writer of receptions: what they pass on is whole, between the marks, and
//! written down before.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use softplug_abi::{DeliveryId, Failure, JobId};
use softplug_live::reactor::LaneId;
use softplug_live::reservoir::{Drawn, ReservoirReader, reservoir};
use softplug_live::units::StoredDelivery;
use softplug_service::feeder::{Feeder, Feeding, Pace, Stream};
use softplug_service::jobs::{Data, Ending, Extent, FromUnit, JobSpec, Jobs, Keep, Kind, State};
use softplug_service::programs::{Quota, Quotas, Receptions, Snapshots};
use softplug_service::reception_writer::{Incoming, ReceptionWriter, ReceptionWriterNews};

/// So long that only something lost makes a test wait for it.
const PATIENCE: Duration = Duration::from_secs(30);

struct Shop {
    folder: tempfile::TempDir,
    jobs: Jobs,
    snapshots: Snapshots,
    receptions: Receptions,
}

impl Shop {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (jobs, _) = Jobs::open(&folder.path().join("state"), Keep::default()).unwrap();
        let snapshots = Snapshots::open_folder(&folder.path().join("snapshots")).unwrap();
        let receptions = Receptions::open(&folder.path().join("receptions")).unwrap();
        Self { folder, jobs, snapshots, receptions }
    }

    fn feeder(&self) -> Feeder {
        Feeder::start(self.jobs.clone(), self.snapshots.clone(), |news| panic!("{news:?}")).unwrap()
    }

    fn begun(&self, link: &str, program: &[u8], from: u64) -> (u32, Data) {
        let data = self.snapshots.take_all(&mut &*program, "O1", u64::MAX - 1).unwrap();
        let spec = JobSpec { from, ..JobSpec::send(link, "O1", data) };
        let id = self.jobs.submit(spec).unwrap().id;
        self.jobs.begin(id).unwrap();
        (id.0, data)
    }

    fn reception_writer(&self) -> (ReceptionWriter, Receiver<ReceptionWriterNews>) {
        self.reception_writer_within(Quotas::new(std::path::Path::new("."), 0))
    }

    fn reception_writer_within(
        &self,
        quotas: Quotas,
    ) -> (ReceptionWriter, Receiver<ReceptionWriterNews>) {
        let (tell, news) = channel();
        let tell = move |what| tell.send(what).unwrap();
        let (receptions, snapshots) = (self.receptions.clone(), self.snapshots.clone());
        let reception_writer =
            ReceptionWriter::start(self.jobs.clone(), receptions, snapshots, quotas, tell);
        (reception_writer.unwrap(), news)
    }
}

fn program(bytes: usize) -> Vec<u8> {
    (0..).flat_map(|n| format!("N{n} G1 X{}\n", n * 7 % 1_000).into_bytes()).take(bytes).collect()
}

/// Takes all that comes, in pieces of different sizes; `look` sees how much came.
fn drain(mut reader: ReservoirReader, mut look: impl FnMut(u64)) -> (Vec<u8>, Drawn) {
    let mut taken = Vec::new();
    let mut buffer = [0; 700];
    let begin = Instant::now();
    loop {
        let size = 1 + taken.len() * 31 % buffer.len();
        match reader.read(&mut buffer[..size]) {
            Drawn::Bytes(count) => {
                taken.extend_from_slice(&buffer[..count]);
                look(taken.len() as u64);
            }
            Drawn::Later => {
                assert!(begin.elapsed() < PATIENCE, "nothing comes behind {} bytes", taken.len());
                std::thread::yield_now();
            }
            end => return (taken, end),
        }
    }
}

fn feeding(
    job: u32,
    data: Data,
    from: u64,
    to: softplug_live::reservoir::ReservoirWriter,
) -> Feeding {
    let pace = Pace { packet: 512, characters_a_second: None };
    Feeding { job: JobId(job), data, from, gate: None, to, pace, is_check: false, status: None }
}

#[test]
fn every_byte_arrives_and_none_before_it_was_written_down() {
    let shop = Shop::new();
    let feeder = shop.feeder();
    std::thread::scope(|scope| {
        for (link, size, from) in
            [("a", 100_000, 0), ("b", 77_777, 1_234), ("c", 3, 1), ("d", 4_096, 0)]
        {
            let (shop, feeder) = (&shop, &feeder);
            scope.spawn(move || {
                let program = program(size);
                let (id, data) = shop.begun(link, &program, from);
                let (writer, reader) = reservoir(8_192, 2_048, 6_000);
                let figures = reader.figures();
                feeder.feed(feeding(id, data, from, writer));
                let mut looks = 0;
                let (taken, end) = drain(reader, |count| {
                    looks += 1;
                    if looks % 16 == 1 {
                        let extent = shop.jobs.reader().job(JobId(id)).unwrap().extent;
                        assert!(extent.maybe >= from + count, "{extent:?}, and {count} came");
                        assert!(extent.maybe <= from + count + 2 * 6_000, "{extent:?}: too much");
                    }
                });
                assert_eq!(end, Drawn::End);
                assert!(taken == program[from as usize..], "{link}");
                assert!(figures.highest() <= 6_000, "over the high mark");
                assert_eq!(shop.jobs.reader().job(JobId(id)).unwrap().extent.maybe, size as u64);
                feeder.forget(JobId(id));
            });
        }
    });
}

#[test]
fn a_check_reads_all_and_grants_nothing_and_the_run_after_it_begins_anew() {
    let shop = Shop::new();
    let feeder = shop.feeder();
    let program = program(30_000);
    let (id, data) = shop.begun("lathe", &program, 0);
    let (writer, reader) = reservoir(8_192, 2_048, 6_000);
    feeder.feed(Feeding { is_check: true, ..feeding(id, data, 0, writer) });
    assert!(drain(reader, |_| ()) == (program.clone(), Drawn::End));
    assert_eq!(shop.jobs.reader().job(JobId(id)).unwrap().extent, Extent::default());
    let (writer, reader) = reservoir(8_192, 2_048, 6_000);
    feeder.feed(feeding(id, data, 0, writer));
    assert!(drain(reader, |_| ()) == (program, Drawn::End));
    assert_eq!(shop.jobs.reader().job(JobId(id)).unwrap().extent.maybe, 30_000);
}

#[test]
fn a_gate_that_is_moved_during_a_check_does_not_stop_the_check() {
    let shop = Shop::new();
    let feeder = shop.feeder();
    let program = program(30_000);
    let (id, data) = shop.begun("lathe", &program, 0);
    let (writer, reader) = reservoir(4_096, 1_024, 3_000);
    feeder.feed(Feeding { is_check: true, ..feeding(id, data, 0, writer) });
    // Another channel of its cell arrives at a mark, say.
    feeder.move_gate(JobId(id), Some(10));
    let (taken, end) = drain(reader, |_| {});
    assert_eq!((taken.len(), end), (program.len(), Drawn::End));
}

#[test]
fn a_machine_that_takes_nothing_gets_no_more_than_the_buffer_holds() {
    let shop = Shop::new();
    let feeder = shop.feeder();
    let (held, data) = shop.begun("held", &program(100_000), 0);
    let (writer, reader) = reservoir(8_192, 2_048, 6_000);
    feeder.feed(feeding(held, data, 0, writer));
    // While another is served as ever.
    let (other, data) = shop.begun("other", &program(60_000), 0);
    let (writer, busy) = reservoir(8_192, 2_048, 6_000);
    feeder.feed(feeding(other, data, 0, writer));
    assert_eq!(drain(busy, |_| ()).0.len(), 60_000);
    assert!((6_000 - 512..=6_000).contains(&reader.level()), "{}", reader.level());
    let extent = shop.jobs.reader().job(JobId(held)).unwrap().extent;
    assert!(extent.maybe <= 2 * 6_000, "{extent:?}");
    feeder.forget(JobId(held));
    // What it was promised is not all, and it is told so.
    let (taken, end) = drain(reader, |_| ());
    assert!(end == Drawn::Failed && taken.len() <= 6_000);
}

#[test]
fn a_snapshot_that_is_gone_or_too_short_fails_the_job() {
    let shop = Shop::new();
    let feeder = shop.feeder();
    let (id, data) = shop.begun("lathe", &program(10_000), 0);
    let (writer, reader) = reservoir(8_192, 2_048, 6_000);
    feeder.feed(feeding(id, Data { size: 20_000, ..data }, 0, writer));
    assert_eq!(drain(reader, |_| ()).1, Drawn::Failed);
    let nothing = || Ok::<_, softplug_service::disk::DiskError>(std::collections::BTreeSet::new());
    assert_eq!(shop.snapshots.collect_garbage(nothing).unwrap(), Some(10_000));
    let (writer, reader) = reservoir(8_192, 2_048, 6_000);
    feeder.feed(feeding(id, data, 0, writer));
    assert_eq!(drain(reader, |_| ()), (Vec::new(), Drawn::Failed));
}

#[test]
fn a_stream_is_held_back_and_written_down_too() {
    let shop = Shop::new();
    let spec = JobSpec::new("lathe", Kind::Send, "send");
    let id = shop.jobs.submit(spec).unwrap().id;
    shop.jobs.begin(id).unwrap();
    let (writer, reader) = reservoir(4_096, 1_024, 3_000);
    let (figures, jobs) = (reader.figures(), shop.jobs.clone());
    let program = program(50_000);
    let source = program.clone();
    let upload = std::thread::spawn(move || {
        let mut stream = Stream::new(jobs, id, writer);
        stream.write_all(&source).unwrap();
        stream.finish();
    });
    let (taken, end) = drain(reader, |count| {
        assert!(shop.jobs.live()[0].extent.maybe >= count);
    });
    upload.join().unwrap();
    assert!(end == Drawn::End && taken == program);
    assert!(figures.highest() <= 3_000);

    let (writer, reader) = reservoir(4_096, 1_024, 3_000);
    let mut stream = Stream::new(shop.jobs.clone(), id, writer);
    drop(reader);
    assert_eq!(stream.write(b"G1").unwrap_err().kind(), std::io::ErrorKind::BrokenPipe);
}

fn kept(news: &Receiver<ReceptionWriterNews>) -> softplug_service::jobs::Job {
    loop {
        match news.recv_timeout(Duration::from_mins(1)).expect("news comes") {
            ReceptionWriterNews::Kept(job) => return *job,
            ReceptionWriterNews::Begun(job) => assert_eq!(job.state, State::Running),
            ReceptionWriterNews::Over { .. } => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn receptions_are_put_away_named_and_compared() {
    let shop = Shop::new();
    let (reception_writer, news) = shop.reception_writer();
    let sent = b"%\nO7\nN10 G1 X1\n%\n";
    let data = shop.snapshots.take_all(&mut &sent[..], "lathes/O7.nc", 1_000).unwrap();
    let job = shop.jobs.submit(JobSpec::send("lathe", "lathes/O7.nc", data)).unwrap().id;
    shop.jobs.begin(job).unwrap();
    shop.jobs.end(job, Ending::Done, None).unwrap();

    let receive = |delivery: u32, bytes: &[u8], name: Option<&str>, failure: Option<Failure>| {
        let (mut writer, reader) = reservoir(64, 0, 64);
        let (link, place) = ("lathe".to_owned(), "from lathe".to_owned());
        let lane = LaneId(1);
        reception_writer.take(Incoming {
            lane,
            link,
            place,
            delivery: DeliveryId(delivery),
            job: None,
            unit: None,
            bytes: reader,
        });
        let mut rest = bytes;
        while !rest.is_empty() {
            let count = writer.write(rest);
            rest = &rest[count..];
            std::thread::yield_now();
        }
        if let Some(name) = name {
            reception_writer.name(lane, DeliveryId(delivery), name.to_owned());
        }
        writer.finish();
        reception_writer.end(lane, DeliveryId(delivery), failure, 0, bytes.len() as u64);
        kept(&news)
    };
    let same = receive(1, sent, Some("O7"), None);
    let reception = same.reception.clone().unwrap();
    assert_eq!((same.state, reception.file.as_deref()), (State::Done, Some("O7")));
    assert_eq!(reception.compared.unwrap().differs_at, None);
    let other = receive(1, b"%\nO7\nN10 G1 X2\n%\n", None, None).reception.unwrap();
    assert_eq!(other.file.as_deref(), Some("O7-2"));
    assert_eq!(other.compared.unwrap().differs_at, Some(13));
    let failed = receive(2, b"%\nO7\nN1", Some("O7"), Some(Failure::NoEndMark));
    let reception = failed.reception.unwrap();
    assert_eq!((failed.state, reception.file.as_deref()), (State::Failed, Some("O7.failed")));
    assert_eq!((reception.is_complete, reception.bytes), (false, 7));
    let nothing = receive(3, b"", None, Some(Failure::Aborted));
    assert_eq!(nothing.reception.unwrap().file, None);
    let names: Vec<_> = shop.receptions.list("from lathe").unwrap();
    assert_eq!(names.len(), 3);
    assert_eq!(std::fs::read(shop.folder.path().join("receptions/from lathe/O7")).unwrap(), sent);
}

#[test]
fn what_is_under_way_when_the_gateway_ends_is_kept_as_failed() {
    let shop = Shop::new();
    let (reception_writer, news) = shop.reception_writer();
    let (mut writer, reader) = reservoir(64, 0, 64);
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
    writer.write(b"O1 half");
    drop(reception_writer);
    let job = kept(&news);
    assert_eq!((job.state, job.reception.unwrap().bytes), (State::Failed, 7));
    assert_eq!(shop.receptions.list("lathe").unwrap()[0].name, "O1.failed");
    assert_eq!(shop.jobs.live(), []);
}

#[test]
fn a_delivery_that_waits_for_a_quota_and_is_said_again_is_kept_once() {
    let shop = Shop::new();
    let quotas = Quotas::new(shop.folder.path(), 0);
    let none = Quota { receptions: 0, ..Quota::default() };
    quotas.set(BTreeMap::from([("mill".to_owned(), none)]));
    let (reception_writer, news) = shop.reception_writer_within(quotas.clone());
    let said = StoredDelivery { unit: 7, delivery: DeliveryId(1) };
    let say = |lane: u32, link: &str, text: &[u8]| {
        let (mut writer, bytes) = reservoir(64, 0, 64);
        reception_writer.take(Incoming {
            lane: LaneId(lane),
            link: link.to_owned(),
            place: "mill".to_owned(),
            delivery: said.delivery,
            job: None,
            unit: Some(FromUnit { port: "unit://10.0.0.17:7640/mill".to_owned(), said }),
            bytes,
        });
        assert_eq!(writer.write(text), text.len());
        writer.finish();
        reception_writer.end(LaneId(lane), said.delivery, None, 0, text.len() as u64);
        writer
    };
    let first = say(1, "mill", b"O1 M30");
    let ReceptionWriterNews::Stuck { .. } = news.recv_timeout(Duration::from_mins(1)).unwrap()
    else {
        panic!("the quota is reached")
    };
    // Its lane is closed, and another one opened, of a link that is called otherwise now.
    reception_writer.lose(LaneId(1));
    let again = say(2, "mill-2", b"O1 M30");
    assert!(!first.is_abandoned() && !again.is_abandoned());
    quotas.set(BTreeMap::new());
    while !again.is_abandoned() {
        std::thread::yield_now();
    }
    drop(reception_writer);
    assert!(first.is_abandoned());
    let kept: Vec<_> =
        news.iter().filter(|news| matches!(news, ReceptionWriterNews::Kept(_))).collect();
    assert_eq!((kept.len(), shop.receptions.list("mill").unwrap().len()), (1, 1), "{kept:?}");
    assert_eq!(
        shop.jobs.reader().stored_delivery("unit://10.0.0.17:7640/mill").unwrap(),
        Some(said)
    );
}

#[test]
fn of_a_delivery_that_is_given_up_the_unit_has_the_rest() {
    let shop = Shop::new();
    let (reception_writer, news) = shop.reception_writer();
    let (mut writer, bytes) = reservoir(64, 0, 64);
    let said = StoredDelivery { unit: 7, delivery: DeliveryId(1) };
    reception_writer.take(Incoming {
        lane: LaneId(1),
        link: "mill".to_owned(),
        place: "mill".to_owned(),
        delivery: said.delivery,
        job: None,
        unit: Some(FromUnit { port: "unit://10.0.0.17:7640/mill".to_owned(), said }),
        bytes,
    });
    writer.write(b"O1 half");
    drop(writer);
    reception_writer.lose(LaneId(1));
    assert_eq!(kept(&news).state, State::Failed);
    assert_eq!(shop.jobs.reader().stored_delivery("unit://10.0.0.17:7640/mill").unwrap(), None);
}

#[test]
fn while_the_disk_takes_nothing_nothing_is_read_and_nothing_is_lost() {
    let shop = Shop::new();
    let (reception_writer, news) = shop.reception_writer();
    // A file where the link's folder should be: nothing can be written.
    let place = shop.folder.path().join("receptions/lathe");
    std::fs::write(&place, "in the way").unwrap();
    let (mut writer, reader) = reservoir(64, 0, 64);
    let incoming = Incoming {
        lane: LaneId(1),
        link: "lathe".to_owned(),
        place: "lathe".to_owned(),
        delivery: DeliveryId(1),
        job: None,
        unit: None,
        bytes: reader,
    };
    reception_writer.take(incoming);
    assert_eq!(writer.write(&[b'X'; 100]), 64);
    let said = Mutex::new(Vec::new());
    let said = Arc::new(said);
    loop {
        match news.recv_timeout(Duration::from_mins(1)).unwrap() {
            ReceptionWriterNews::Stuck { link, why } => {
                said.lock().unwrap().push(why);
                assert_eq!((&*link, writer.level()), ("lathe", 64));
                std::fs::remove_file(&place).unwrap();
            }
            ReceptionWriterNews::GoesOn { .. } => break,
            _ => {}
        }
    }
    writer.finish();
    reception_writer.end(LaneId(1), DeliveryId(1), None, 0, 64);
    let job = kept(&news);
    assert_eq!((job.state, job.reception.unwrap().bytes), (State::Done, 64));
    assert_eq!(said.lock().unwrap().len(), 1);
}

/// A link whose receptions cannot be put away, as a file is where their folder should be: what it
/// received, as a whole.
fn received(
    reception_writer: &ReceptionWriter,
    delivery: u32,
    unit: Option<StoredDelivery>,
    text: &[u8],
) -> softplug_live::reservoir::ReservoirWriter {
    let (mut writer, bytes) = reservoir(64, 0, 64);
    let port = "unit://10.0.0.17:7640/lathe".to_owned();
    let unit = unit.map(|said| FromUnit { port, said });
    reception_writer.take(Incoming {
        lane: LaneId(1),
        link: "lathe".to_owned(),
        place: "lathe".to_owned(),
        delivery: DeliveryId(delivery),
        job: None,
        unit,
        bytes,
    });
    assert_eq!(writer.write(text), text.len());
    writer.finish();
    let size = text.len() as u64;
    reception_writer.end(LaneId(1), DeliveryId(delivery), None, 0, size);
    writer
}

/// The next news of a kind that matters to these tests.
fn next_but_begun(news: &Receiver<ReceptionWriterNews>) -> ReceptionWriterNews {
    loop {
        match news.recv_timeout(Duration::from_mins(1)).expect("news comes") {
            ReceptionWriterNews::Begun(_) => {}
            news => return news,
        }
    }
}

#[test]
fn at_the_end_what_the_disk_does_not_take_is_tried_until_it_does() {
    let shop = Shop::new();
    let (reception_writer, news) = shop.reception_writer();
    let place = shop.folder.path().join("receptions/lathe");
    std::fs::write(&place, "in the way").unwrap();
    for (delivery, text) in [(1, b"O1 M30"), (2, b"O2 M30")] {
        received(&reception_writer, delivery, None, text);
    }
    assert!(matches!(next_but_begun(&news), ReceptionWriterNews::Stuck { .. }));
    reception_writer.lose(LaneId(1));
    reception_writer.finish();
    assert!(matches!(next_but_begun(&news), ReceptionWriterNews::Stuck { .. }), "it is told anew");
    std::fs::remove_file(&place).unwrap();
    let mut kept = Vec::new();
    let mut over = 0;
    while over < 2 {
        match next_but_begun(&news) {
            ReceptionWriterNews::GoesOn { .. } => {}
            ReceptionWriterNews::Kept(job) => kept.push((job.state, job.reception.unwrap().bytes)),
            ReceptionWriterNews::Over { link } => over += usize::from(link == "lathe"),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(kept, [(State::Done, 6); 2]);
    drop(reception_writer);
    assert!(news.try_recv().is_err(), "nothing is left to be done");
}

#[test]
fn what_is_given_up_at_the_end_is_told_as_lost_and_its_job_says_so() {
    for is_asked in [true, false] {
        let shop = Shop::new();
        let (reception_writer, news) = shop.reception_writer();
        std::fs::write(shop.folder.path().join("receptions/lathe"), "in the way").unwrap();
        for (delivery, text) in [(1, &b"O1 M30"[..]), (2, b"O2")] {
            received(&reception_writer, delivery, None, text);
        }
        if is_asked {
            reception_writer.give_up();
        }
        drop(reception_writer);
        let news: Vec<_> = news.iter().collect();
        let lost = news.iter().filter_map(|news| match news {
            ReceptionWriterNews::Lost { link, job, bytes, .. } if link == "lathe" => {
                Some((job.unwrap(), *bytes))
            }
            _ => None,
        });
        let lost: Vec<_> = lost.collect();
        assert_eq!(lost.iter().map(|(_, bytes)| *bytes).collect::<Vec<_>>(), [6, 2], "{news:?}");
        for (job, bytes) in lost {
            let job = shop.jobs.reader().job(job).unwrap();
            let reason = job.reason.unwrap().text;
            assert_eq!((job.state, job.reception.unwrap().file), (State::Failed, None));
            assert!(reason.ends_with(&format!("; {bytes} bytes of it are lost")), "{reason}");
        }
        let over = news.iter().filter(|news| matches!(news, ReceptionWriterNews::Over { .. }));
        assert_eq!((over.count(), shop.jobs.live().len()), (2, 0));
    }
}

#[test]
fn what_a_unit_has_yet_is_not_waited_for_at_the_end() {
    let shop = Shop::new();
    let (reception_writer, news) = shop.reception_writer();
    std::fs::write(shop.folder.path().join("receptions/lathe"), "in the way").unwrap();
    let said = StoredDelivery { unit: 7, delivery: DeliveryId(1) };
    let writer = received(&reception_writer, 1, Some(said), b"O1 M30");
    assert!(matches!(next_but_begun(&news), ReceptionWriterNews::Stuck { .. }));
    reception_writer.finish();
    let ReceptionWriterNews::Kept(job) = next_but_begun(&news) else { panic!("its job ends") };
    assert_eq!(job.state, State::Failed);
    assert!(matches!(next_but_begun(&news), ReceptionWriterNews::Over { .. }));
    assert_eq!(shop.jobs.reader().stored_delivery("unit://10.0.0.17:7640/lathe").unwrap(), None);
    assert_eq!(writer.consumed(), 0);
}
