//! A gateway that is killed at any moment: what it says afterwards is true. The
//! killed one is this test itself, started again as a child. `SOFTPLUG_CRASH_ROUNDS=N` kills
//! it more often.

use crate::common::plugins;
use softplug_abi::{DeliveryId, JobId};
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use softplug_live::reactor::LaneId;
use softplug_live::reservoir::{Drawn, reservoir};
use softplug_service::feeder::{Feeder, Feeding, Pace};
use softplug_service::jobs::{Data, Ending, JobFilter, JobSpec, Jobs, Keep, Recovery, State};
use softplug_service::library::Library;
use softplug_service::programs::{ProgramName, Programs, Quotas, Receptions, Snapshots};
use softplug_service::reception_writer::{Incoming, ReceptionWriter};

const FOLDER: &str = "SOFTPLUG_CRASH_FOLDER";
const TEST: &str = "crash::what_a_killed_gateway_leaves_is_whole_and_its_book_is_true";
const LINKS: [&str; 3] = ["lathe", "mill", "drill"];

struct Shop {
    folder: PathBuf,
    jobs: Jobs,
    snapshots: Snapshots,
    receptions: Receptions,
    programs: Programs,
    library: Library,
}

impl Shop {
    fn open(folder: &Path) -> (Self, Recovery) {
        let (jobs, recovery) = Jobs::open(&folder.join("state"), Keep::default()).unwrap();
        let receptions = Receptions::open(&folder.join("receptions")).unwrap();
        receptions.recover().unwrap();
        let shop = Self {
            folder: folder.to_owned(),
            jobs,
            snapshots: Snapshots::open_folder(&folder.join("snapshots")).unwrap(),
            receptions,
            programs: Programs::open(&[folder.join("programs")]).unwrap(),
            library: Library::open(&folder.join("plugins")).unwrap(),
        };
        (shop, recovery)
    }

    /// What the machine got for a job.
    fn line(&self, job: JobId) -> PathBuf {
        self.folder.join("line").join(job.to_string())
    }
}

/// A program says its length, and all its bytes follow from its number.
fn program(number: u64) -> Vec<u8> {
    let size = 2_000 + (number * 7_919) % 60_000;
    let head = format!("%\nO{number}\n({size})\n").into_bytes();
    let body = (0_u64..).flat_map(|n| format!("N{n} G1 X{}\n", (n * number) % 997).into_bytes());
    head.into_iter().chain(body).take(size as usize).collect()
}

fn is_whole(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let number = text.lines().nth(1).and_then(|line| line.strip_prefix('O')?.parse().ok());
    number.is_some_and(|number| bytes == program(number))
}

/// Works until it is killed. Says on its output what it acknowledged.
fn work(folder: &Path) -> ! {
    let (shop, recovery) = Shop::open(folder);
    let shop = Arc::new(shop);
    let say = |text: String| {
        let mut out = std::io::stdout().lock();
        out.write_all(text.as_bytes()).and_then(|()| out.flush()).unwrap();
    };
    for job in recovery.interrupted {
        say(format!("interrupted {}\n", job.id));
    }
    let feeder =
        Feeder::start(shop.jobs.clone(), shop.snapshots.clone(), |news| panic!("{news:?}"));
    let feeder = Arc::new(feeder.unwrap());
    let ended = Arc::new(Mutex::new(BTreeSet::new()));
    let (receptions, snapshots) = (shop.receptions.clone(), shop.snapshots.clone());
    let reception_writer = ReceptionWriter::start(
        shop.jobs.clone(),
        receptions,
        snapshots,
        Quotas::new(Path::new("."), 0),
        |_| {},
    )
    .unwrap();
    let seed = u64::from(std::process::id());
    for link in LINKS {
        let (shop, feeder, ended) = (Arc::clone(&shop), Arc::clone(&feeder), Arc::clone(&ended));
        thread::spawn(move || {
            loop {
                match shop.jobs.next(link) {
                    Some(job) => run(&shop, &feeder, job.id, job.spec.data.unwrap()),
                    None => thread::sleep(Duration::from_millis(1)),
                }
                ended.lock().unwrap().insert(link);
            }
        });
    }
    for number in seed * 1_000.. {
        let link = LINKS[(number % 3) as usize];
        let name: ProgramName = format!("{link}/O{number}.nc").parse().unwrap();
        shop.programs.upload(&name, &mut &*program(number), 1 << 20, false).unwrap();
        say(format!("uploaded {name}\n"));
        let data = shop.programs.snapshot(&name, &shop.snapshots).unwrap();
        let job = shop.jobs.submit(JobSpec::send(link, name.as_str(), data)).unwrap();
        say(format!("queued {}\n", job.id));
        receive(&reception_writer, number);
        if number % 7 == 0 {
            let version = format!("1.0.{number}");
            shop.library.add(&plugins::echo("echo", &version, "")).unwrap();
            say(format!("added echo@{version}\n"));
        }
        while shop.jobs.live().len() > 12 {
            thread::sleep(Duration::from_millis(1));
        }
    }
    unreachable!("there are more numbers than the machine has time")
}

/// A machine that takes what comes, and never the same job twice.
fn run(shop: &Shop, feeder: &Feeder, id: JobId, data: Data) {
    shop.jobs.begin(id).unwrap();
    let (writer, mut reader) = reservoir(8_192, 2_048, 6_000);
    let pace = Pace { packet: 512, characters_a_second: None };
    let feeding = Feeding {
        job: id,
        data,
        from: 0,
        gate: None,
        to: writer,
        pace,
        is_check: false,
        status: None,
    };
    feeder.feed(feeding);
    let line = OpenOptions::new().write(true).create_new(true).open(shop.line(id));
    let mut line = line.expect("no job is sent twice");
    let mut buffer = [0; 300];
    loop {
        match reader.read(&mut buffer) {
            Drawn::Bytes(count) => line.write_all(&buffer[..count]).unwrap(),
            Drawn::Later => thread::sleep(Duration::from_micros(100)),
            Drawn::End => break,
            Drawn::Failed => panic!("{:?}", reader.failure()),
        }
    }
    feeder.forget(id);
    shop.jobs.end(id, Ending::Done, None).unwrap();
}

fn receive(reception_writer: &ReceptionWriter, number: u64) {
    let (mut writer, reader) = reservoir(64 * 1_024, 0, 64 * 1_024);
    let (link, place) = ("lathe".to_owned(), "lathe".to_owned());
    let (lane, delivery) = (LaneId(1), DeliveryId(number as u32 | 1 << 31));
    reception_writer.take(Incoming {
        lane,
        link,
        place,
        delivery,
        job: None,
        unit: None,
        bytes: reader,
    });
    let bytes = program(number);
    for piece in bytes.chunks(1_000) {
        assert_eq!(writer.write(piece), piece.len());
    }
    writer.finish();
    reception_writer.end(lane, delivery, None, 0, bytes.len() as u64);
}

/// Lets a child work for so long, and kills it; tells what it acknowledged.
fn kill_one(folder: &Path, after: Duration) -> Vec<String> {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([TEST, "--exact", "--nocapture"])
        .env(FOLDER, folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let out = child.stdout.take().unwrap();
    let reader = thread::spawn(move || BufReader::new(out).lines().map_while(Result::ok).collect());
    thread::sleep(after);
    assert!(child.try_wait().unwrap().is_none(), "it has ended by itself");
    child.kill().unwrap();
    child.wait().unwrap();
    let mut said: Vec<String> = reader.join().unwrap();
    // The last line may be cut.
    said.retain(|line| line.contains(' '));
    said
}

fn check(folder: &Path, said: &[String]) -> (usize, usize) {
    let (shop, recovery) = Shop::open(folder);
    let all =
        shop.jobs.reader().list(&JobFilter { most: 100_000, ..JobFilter::default() }).unwrap();
    for job in &all {
        let left = fs::read(shop.line(job.id)).unwrap_or_default();
        let what = || format!("{job:?}, and {} bytes have left", left.len());
        assert!(
            matches!(job.state, State::Queued | State::Done | State::Failed | State::Interrupted),
            "{}",
            what()
        );
        if job.spec.program.is_none() || job.spec.data.is_none() {
            continue;
        }
        let bytes = left.len() as u64;
        assert!(job.extent.surely <= bytes && bytes <= job.extent.maybe, "{}", what());
        assert!(job.state != State::Queued || left.is_empty(), "{}", what());
        let mut program = Vec::new();
        shop.snapshots.open(job.spec.data.unwrap()).unwrap().read_to_end(&mut program).unwrap();
        assert!(is_whole(&program), "the snapshot of {}", what());
        assert!(program.starts_with(&left), "{}", what());
        assert!(job.state != State::Done || left.len() == program.len(), "{}", what());
        if job.state == State::Interrupted && bytes > 0 {
            assert!(shop.snapshots.between(job).unwrap().last_begun.is_some());
        }
    }
    let known: BTreeSet<_> = all.iter().map(|job| job.id).collect();
    for line in said {
        match line.split_once(' ') {
            Some(("queued", id)) => assert!(known.contains(&JobId(id.parse().unwrap())), "{line}"),
            Some(("uploaded", name)) => {
                let mut bytes = Vec::new();
                let (mut file, _) = shop.programs.download(&name.parse().unwrap()).unwrap();
                file.read_to_end(&mut bytes).unwrap();
                assert!(is_whole(&bytes), "{line}");
            }
            Some(("added", plugin)) => {
                drop(shop.library.resolve(&plugin.parse().unwrap()).unwrap());
            }
            _ => {}
        }
    }
    for program in shop.programs.list().unwrap() {
        let (mut file, _) = shop.programs.download(&program.name.parse().unwrap()).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        assert!(is_whole(&bytes), "{}", program.name);
    }
    let mut received = 0;
    for file in shop.receptions.list("lathe").unwrap() {
        let mut bytes = Vec::new();
        shop.receptions.read("lathe", &file.name).unwrap().0.read_to_end(&mut bytes).unwrap();
        assert!(file.is_failed || is_whole(&bytes), "{}", file.name);
        received += usize::from(!file.is_failed);
    }
    // Each that the book calls complete is there.
    for job in all.iter().filter(|job| job.state == State::Done) {
        if let Some(name) = job.reception.as_ref().and_then(|reception| reception.file.as_ref()) {
            assert!(File::open(folder.join("receptions/lathe").join(name)).is_ok(), "{job:?}");
        }
    }
    (recovery.interrupted.len(), received)
}

#[test]
fn what_a_killed_gateway_leaves_is_whole_and_its_book_is_true() {
    if let Some(folder) = std::env::var_os(FOLDER) {
        work(Path::new(&folder));
    }
    let rounds = std::env::var("SOFTPLUG_CRASH_ROUNDS");
    let rounds: u64 = rounds.map_or(30, |text| text.parse().expect("a number"));
    let (mut interrupted, mut received) = (0, 0);
    let mut folder = tempfile::tempdir().unwrap();
    for round in 0.. {
        // It has to meet jobs and receptions in the middle: a slow computer takes longer to them.
        let enough = round as usize / 4;
        if round >= rounds && interrupted > enough && received > enough {
            break;
        }
        assert!(round < 10 * rounds, "{interrupted} jobs interrupted, {received} receptions");
        // Several on the same folder: damage must not add up either.
        if round % 10 == 0 {
            folder = tempfile::tempdir().unwrap();
            fs::create_dir(folder.path().join("line")).unwrap();
        }
        // Spread over a start, its recovery and the work after it.
        let longest = 250 * (1 + round / rounds);
        let after = Duration::from_micros(3_000 + round * 7_919 % longest * 1_000);
        let said = kill_one(folder.path(), after);
        let (now_interrupted, now_received) = check(folder.path(), &said);
        interrupted += now_interrupted;
        received += now_received;
    }
}
