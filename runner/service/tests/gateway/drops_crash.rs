//! A gateway that is killed at any moment while files come into its drop folder: each becomes one
//! job, and none is sent twice. The gateway is this test itself, started again as a child.
//! `SOFTPLUG_DROP_KILLS=N` kills it more often.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_service::config::Config;
use softplug_service::gateway::start;
use softplug_service::jobs::{JobFilter, Jobs, Keep, Origin};
use softplug_service::library::Library;

use crate::gateway::shop::{plugins, wait_for};

const FOLDER: &str = "SOFTPLUG_DROP_FOLDER";
const TEST: &str = "gateway::drops_crash::a_killed_gateway_makes_one_job_of_each_file";
/// Files that come for each kill.
const FILES: usize = 12;

#[test]
fn a_killed_gateway_makes_one_job_of_each_file() {
    if let Some(folder) = std::env::var_os(FOLDER) {
        serve(Path::new(&folder));
    }
    let kills: usize = std::env::var("SOFTPLUG_DROP_KILLS").map_or(8, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let pty = PtyPair::open().unwrap();
    configure(folder.path(), &pty);
    let mut got = Vec::new();
    // Not random: each time at another moment of the work, in µs.
    let mut moment = 150_000_u64;
    for kill in 0..kills {
        for file in 0..FILES {
            let name = format!("O{:04}.nc", kill * FILES + file);
            fs::write(at("staged"), text(&name)).unwrap();
            fs::rename(at("staged"), at("in").join(name)).unwrap();
        }
        moment = (moment * 1_103 + 77_777) % 400_000;
        run(folder.path(), Duration::from_micros(moment), || read(&pty, &mut got));
    }
    let files = kills * FILES;
    // What is left is done without a kill.
    let put_away = || list(&at("in/done")).len() + list(&at("in/failed")).len();
    let running = start(Config::read(&at("gateway.toml")).unwrap()).unwrap();
    wait_for("all to be put away", || {
        read(&pty, &mut got);
        put_away() >= 2 * files && list(&at("in/work")).is_empty()
    });
    running.gateway().stop(softplug_service::view::StopHow::Park);
    running.wait();

    let (jobs, _) = Jobs::open(&at("state"), Keep::default()).unwrap();
    let all = jobs.reader().list(&JobFilter { most: 100_000, ..JobFilter::default() }).unwrap();
    let mut by_program: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    for job in all.iter().filter(|job| job.spec.origin == Origin::Drop) {
        by_program.entry(job.spec.program.clone().unwrap()).or_default().push(job.id.0);
    }
    let sent = String::from_utf8(got).unwrap();
    let mut interrupted = 0;
    for number in 0..files {
        let name = format!("O{number:04}.nc");
        let ids = by_program.remove(&name).unwrap_or_default();
        let [id] = ids[..] else { panic!("{name} became the jobs {ids:?}") };
        let shelves = ["in/done", "in/failed"].map(|shelf| at(shelf).join(&name));
        let there: Vec<&PathBuf> = shelves.iter().filter(|path| path.exists()).collect();
        let [path] = there[..] else { panic!("{name} is at {there:?}") };
        assert_eq!(fs::read_to_string(path).unwrap(), text(&name));
        let result = fs::read_to_string(path.with_extension("nc.txt")).unwrap();
        assert!(result.starts_with(&format!("Job {id} is ")), "{name}: {result}");
        let begun = sent.matches(&format!("({name})")).count();
        let is_done = path.starts_with(at("in/done"));
        interrupted += usize::from(!is_done);
        assert!(begun <= 1, "{name} was begun {begun} times");
        assert!(
            !is_done || sent.contains(&text(&name)),
            "{name} was not sent as a whole: {result}"
        );
    }
    assert_eq!(by_program, BTreeMap::new());
    assert_eq!(put_away(), 2 * files, "no results but theirs");
    assert!(interrupted <= kills, "{interrupted} of {files} were interrupted by {kills} kills");
}

fn text(name: &str) -> String {
    format!("({name})\n{}M30\n", "G1 X1.5 Y2.5\n".repeat(20))
}

fn configure(folder: &Path, pty: &PtyPair) {
    let library = Library::open(&folder.join("state/plugins")).unwrap();
    library.add_file(&plugins().join("xon-xoff.wasm")).unwrap();
    let port = pty.slave_path().display();
    fs::write(
        folder.join("gateway.toml"),
        format!(
            "[gateway]\nwatch = false\n[[link]]\nname = \"lathe\"\nport = \"{port}\"\n\
             plugin = \"xon-xoff\"\nline = \"115200 8N1\"\n\
             drop = {{ folder = \"in\", settle = \"0s\", look = \"100ms\" }}\n"
        ),
    )
    .unwrap();
    fs::create_dir(folder.join("in")).unwrap();
}

/// The gateway, until it is killed.
fn serve(folder: &Path) -> ! {
    let _running = start(Config::read(&folder.join("gateway.toml")).unwrap()).unwrap();
    println!("begun");
    loop {
        sleep(Duration::from_secs(1));
    }
}

/// Lets a gateway work for so long, and kills it.
fn run(folder: &Path, long: Duration, mut meanwhile: impl FnMut()) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([TEST, "--exact", "--nocapture"])
        .env(FOLDER, folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let begun = lines.any(|line| line.is_ok_and(|line| line.contains("begun")));
    let until = Instant::now() + long;
    while Instant::now() < until {
        meanwhile();
        sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    meanwhile();
    assert!(begun, "the gateway did not start");
}

fn read(pty: &PtyPair, got: &mut Vec<u8>) {
    let mut buffer = [0; 4_096];
    while let ReadOutcome::Read(count) = pty.read(&mut buffer).unwrap() {
        got.extend(buffer[..count].iter().filter(|byte| !matches!(byte, 0x11..=0x14)));
    }
}

/// What is not hidden.
fn list(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.filter(|path| !path.file_name().unwrap().as_encoded_bytes().starts_with(b".")).collect()
}
