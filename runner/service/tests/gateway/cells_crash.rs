//! A gateway that is killed at any moment while a cell of three works: nobody is ahead of a mark that
//! another has not reached. The gateway is this test itself, started again as a child.
//! `SOFTPLUG_CELL_KILLS=N` kills it more often.

use softplug_abi::JobId;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead as _, BufReader, Lines};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_service::config::Config;
use softplug_service::gateway::{Gateway, Running, start};
use softplug_service::jobs::BeginAt;
use softplug_service::library::Library;
use softplug_service::view::{CellChannelState, JobFilter, JobOrder, JobState};

use crate::gateway::shop::{plugins, wait_for};

const FOLDER: &str = "SOFTPLUG_CELL_FOLDER";
/// What the child does: `stand` sends a program up to its mark, `pause` has it pause then, `serve` only runs.
const DOES: &str = "SOFTPLUG_CELL_DOES";
const CHANNELS: usize = 3;
/// Longer than two cycles take.
const PATIENCE: Duration = Duration::from_secs(40);
/// Parts of a program, with a mark between any two.
const PARTS: usize = 6;
/// Blocks of a part of the first channel; others have more.
const BLOCKS: usize = 12;

#[test]
fn after_a_kill_a_cell_that_stops_lets_nobody_run_ahead() {
    kill_again_and_again("stop", "after_a_kill_a_cell_that_stops_lets_nobody_run_ahead");
}

#[test]
fn after_a_kill_a_cell_that_resumes_lets_nobody_run_ahead() {
    kill_again_and_again("resume", "after_a_kill_a_cell_that_resumes_lets_nobody_run_ahead");
}

const BEFORE: &str = "(SOFTPLUG GET G)\nG0 X1\n(SOFTPLUG WAIT 7 C1)\n";
const BEHIND: &str = "G0 X2\nM30\n";
/// Longer than it takes until something has left that should not.
const A_WHILE: Duration = Duration::from_millis(300);

/// A cell whose first channel stood at a mark when its gateway was killed, with `resume`.
struct Stood {
    folder: tempfile::TempDir,
    ptys: Vec<PtyPair>,
    test: &'static str,
}

impl Stood {
    fn new(test: &'static str, does: &str) -> Self {
        if let Some(folder) = std::env::var_os(FOLDER) {
            stand(Path::new(&folder));
        }
        let folder = tempfile::tempdir().unwrap();
        let ptys: Vec<PtyPair> = (0..CHANNELS).map(|_| PtyPair::open().unwrap()).collect();
        configure(folder.path(), &ptys, "resume");
        let program = |name: &str, text: String| {
            fs::write(folder.path().join("programs").join(name), text).unwrap();
        };
        program("A", format!("{BEFORE}{BEHIND}"));
        program("B", "(SOFTPLUG WAIT 7 C0)\nM30\n".to_owned());
        let stood = Self { folder, ptys, test };
        stood.killed(does);
        assert_eq!(stood.got(0), BEFORE);
        stood
    }

    /// Another gateway does something, and is killed.
    fn killed(&self, does: &str) {
        drop(Killed::doing(self.folder.path(), self.test, does));
    }

    fn start(&self) -> Running {
        start(Config::read(&self.folder.path().join("gateway.toml")).unwrap()).unwrap()
    }

    /// The first channel's cable is pulled, or is back.
    fn cable(&self, is_there: bool) {
        let file = self.folder.path().join("gateway.toml");
        let port = self.ptys[0].slave_path().display().to_string();
        let (from, to) = (port.as_str(), "/nonexistent/port");
        let (from, to) = if is_there { (to, from) } else { (from, to) };
        fs::write(&file, fs::read_to_string(&file).unwrap().replace(from, to)).unwrap();
    }

    fn got(&self, at: usize) -> String {
        let mut machine = [Machine::default()];
        read(&self.ptys[at..=at], &mut machine);
        String::from_utf8_lossy(&machine[0].bytes).into_owned()
    }

    /// The second channel comes to the mark.
    fn meet(&self, gateway: &Gateway) {
        let order = JobOrder { program: Some("B".to_owned()), ..JobOrder::default() };
        let job = gateway.submit("C1", &order).unwrap();
        wait_for("the other channel's end", || {
            self.got(1);
            gateway.job(JobId(job.id)).unwrap().state == JobState::Done
        });
    }

    fn comes(&self, text: &str) {
        let mut got = String::new();
        wait_for("the rest of the program", || {
            got += &self.got(0);
            got.len() >= text.len()
        });
        sleep(A_WHILE);
        assert_eq!(got + &self.got(0), text);
    }
}

/// The gateway of [`Stood`], until it is killed.
fn stand(folder: &Path) -> ! {
    let running = start(Config::read(&folder.join("gateway.toml")).unwrap()).unwrap();
    let (gateway, does) = (running.gateway(), std::env::var(DOES).unwrap());
    if does != "serve" {
        let order = JobOrder { program: Some("A".to_owned()), ..JobOrder::default() };
        let job = gateway.submit("C0", &order).unwrap();
        wait_for("a channel that waits", || {
            gateway.cell("cell").unwrap().channels[0].state == CellChannelState::Waits
        });
        if does == "pause" {
            gateway.pause(JobId(job.id)).unwrap();
        }
    }
    println!("begun");
    loop {
        sleep(Duration::from_secs(1));
    }
}

#[test]
fn a_pause_outlives_the_gateway() {
    let stood = Stood::new("a_pause_outlives_the_gateway", "pause");
    let running = stood.start();
    let gateway = running.gateway();
    wait_for("the job that goes on", || last(gateway, 0).unwrap().1 == JobState::Paused);
    let (job, _) = last(gateway, 0).unwrap();
    stood.meet(gateway);
    sleep(A_WHILE);
    assert_eq!(stood.got(0), "");
    gateway.resume(JobId(job)).unwrap();
    stood.comes(BEHIND);
    wait_for("its end", || gateway.job(JobId(job)).unwrap().state == JobState::Done);
}

#[test]
fn who_was_met_while_its_port_was_down_goes_on() {
    let stood = Stood::new("who_was_met_while_its_port_was_down_goes_on", "stand");
    stood.cable(false);
    let running = stood.start();
    stood.meet(running.gateway());
    stood.cable(true);
    running.gateway().reload().unwrap();
    stood.comes(BEHIND);
}

#[test]
fn who_stood_through_two_crashes_goes_on_where_it_stood() {
    let stood = Stood::new("who_stood_through_two_crashes_goes_on_where_it_stood", "stand");
    stood.cable(false);
    stood.killed("serve");
    stood.killed("serve");
    stood.cable(true);
    let running = stood.start();
    sleep(A_WHILE);
    assert_eq!(stood.got(0), "");
    stood.meet(running.gateway());
    stood.comes(BEHIND);
}

const LOADS: &str = "(SOFTPLUG LOAD C1 S)\n(SOFTPLUG START C1)\nG0 X1\n(SOFTPLUG WAIT 7 C2)\nM30\n";

#[test]
fn what_was_started_and_had_not_begun_ends_with_the_stop() {
    const TEST: &str = "what_was_started_and_had_not_begun_ends_with_the_stop";
    if let Some(folder) = std::env::var_os(FOLDER) {
        load_and_start(Path::new(&folder));
    }
    let folder = tempfile::tempdir().unwrap();
    let ptys: Vec<PtyPair> = (0..CHANNELS).map(|_| PtyPair::open().unwrap()).collect();
    configure(folder.path(), &ptys, "stop");
    let file = folder.path().join("gateway.toml");
    let whole = fs::read_to_string(&file).unwrap().replace("8N1\"", "8N1\"\nsearch = [\"parts\"]");
    let port = ptys[1].slave_path().display().to_string();
    fs::write(&file, whole.replace(&port, "/nonexistent/port")).unwrap();
    fs::create_dir_all(folder.path().join("programs/parts")).unwrap();
    fs::write(folder.path().join("programs/parts/S"), "G0 X2\nM30\n").unwrap();
    fs::write(folder.path().join("programs/A"), LOADS).unwrap();
    drop(Killed::doing(folder.path(), TEST, ""));
    fs::write(&file, whole).unwrap();
    let running = start(Config::read(&file).unwrap()).unwrap();
    let gateway = running.gateway();
    wait_for("its end", || last(gateway, 1).unwrap().1 == JobState::Aborted);
    gateway.clear_cell("cell").unwrap();
    sleep(A_WHILE);
    let mut machines: Vec<Machine> = ptys.iter().map(|_| Machine::default()).collect();
    read(&ptys, &mut machines);
    assert!(machines[1].bytes.is_empty(), "{:?}", machines[1].bytes);
}

/// The gateway of a program that has started another one, whose machine is not there.
fn load_and_start(folder: &Path) -> ! {
    let running = start(Config::read(&folder.join("gateway.toml")).unwrap()).unwrap();
    let gateway = running.gateway();
    let order = JobOrder { program: Some("A".to_owned()), ..JobOrder::default() };
    gateway.submit("C0", &order).unwrap();
    wait_for("a program that is started", || {
        let is_started = gateway.cell("cell").unwrap().channels[1].program.is_some();
        is_started && last(gateway, 1).is_some_and(|(_, state)| state == JobState::Queued)
    });
    println!("begun");
    loop {
        sleep(Duration::from_secs(1));
    }
}

/// What a machine got: lines, of which the last may not be whole.
#[derive(Default)]
struct Machine {
    bytes: Vec<u8>,
}

fn kill_again_and_again(policy: &str, test: &str) {
    if let Some(folder) = std::env::var_os(FOLDER) {
        work(Path::new(&folder));
    }
    let kills: u32 = std::env::var("SOFTPLUG_CELL_KILLS").map_or(4, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let ptys: Vec<PtyPair> = (0..CHANNELS).map(|_| PtyPair::open().unwrap()).collect();
    configure(folder.path(), &ptys, policy);
    let mut machines: Vec<Machine> = (0..CHANNELS).map(|_| Machine::default()).collect();
    // Not random: each time at another moment of the work, in µs.
    let mut moment = 150_000_u64;
    for kill in 0..kills {
        let child = Killed::start(folder.path(), test);
        moment = (moment * 1_103 + 77_777) % 900_000;
        let until = Instant::now() + Duration::from_micros(moment);
        while Instant::now() < until {
            read(&ptys, &mut machines);
            sleep(Duration::from_millis(1));
        }
        drop(child);
        read(&ptys, &mut machines);
        nobody_is_ahead(&machines, kill);
    }
    // What is left is done without a kill: all of a cycle comes everywhere.
    let whole = |machines: &[Machine]| machines.iter().map(Machine::cycles).min().unwrap();
    let before = whole(&machines);
    let child = Killed::start(folder.path(), test);
    let begin = Instant::now();
    while whole(&machines) < before + 2 {
        read(&ptys, &mut machines);
        sleep(Duration::from_millis(1));
        assert!(
            begin.elapsed() < PATIENCE,
            "the cell does not go on after {kills} kills: {}",
            fs::read_to_string(folder.path().join("seen")).unwrap_or_default()
        );
    }
    drop(child);
    nobody_is_ahead(&machines, kills);
}

fn configure(folder: &Path, ptys: &[PtyPair], policy: &str) {
    let library = Library::open(&folder.join("state/plugins")).unwrap();
    library.add_file(&plugins().join("xon-xoff.wasm")).unwrap();
    let mut text =
        "[gateway]\nwatch = false\n[defaults]\nplugin = \"xon-xoff\"\nline = \"38400 8N1\"\n"
            .to_owned();
    for (at, pty) in ptys.iter().enumerate() {
        let port = pty.slave_path().display();
        let _ = writeln!(text, "[[link]]\nname = \"C{at}\"\nport = \"{port}\"");
    }
    let _ = writeln!(
        text,
        "[[cell]]\nname = \"cell\"\nchannels = [\"C0\", \"C1\", \"C2\"]\naxes = [\"G\"]\nafter-crash = \"{policy}\""
    );
    fs::write(folder.join("gateway.toml"), text).unwrap();
    fs::create_dir_all(folder.join("programs")).unwrap();
}

/// The gateway and its operator, until they are killed.
fn work(folder: &Path) -> ! {
    let running = start(Config::read(&folder.join("gateway.toml")).unwrap()).unwrap();
    let gateway = running.gateway();
    if gateway.cell("cell").unwrap().is_stopped {
        gateway.clear_cell("cell").unwrap();
    }
    // Whose program was cut off begins again behind what has surely left.
    for at in 0..CHANNELS {
        let Some((id, JobState::Interrupted)) = last(gateway, at) else { continue };
        let last = gateway.job(JobId(id)).unwrap().last_block.unwrap_or(0);
        // All may have left: then its last block does no harm.
        let restarted = gateway.restart(JobId(id), BeginAt::Block(last + 1));
        restarted.or_else(|_| gateway.restart(JobId(id), BeginAt::Block(last))).unwrap();
    }
    println!("begun");
    loop {
        go_on(folder, gateway);
        fs::write(folder.join("seen"), seen(gateway)).unwrap();
        sleep(Duration::from_millis(5));
    }
}

/// For whoever looks why it does not go on.
fn seen(gateway: &Gateway) -> String {
    let cell = gateway.cell("cell").unwrap();
    let mut seen = String::new();
    for channel in cell.channels {
        let _ = writeln!(
            seen,
            "{}: {}, job {:?}, {} of {} words",
            channel.link, channel.text, channel.job, channel.words_passed, channel.words
        );
    }
    for job in gateway.jobs(&JobFilter { limit: Some(9), ..JobFilter::default() }).unwrap() {
        let of = job.restart_of;
        let _ = writeln!(
            seen,
            "{} {} {:?} of {of:?} from {}: {}",
            job.id, job.link, job.state, job.start_byte, job.progress.text
        );
    }
    seen
}

/// The newest job of a channel.
fn last(gateway: &Gateway, at: usize) -> Option<(u32, JobState)> {
    let filter = JobFilter { link: Some(format!("C{at}")), ..JobFilter::default() };
    let jobs = gateway.jobs(&filter).unwrap();
    jobs.iter().max_by_key(|job| job.id).map(|job| (job.id, job.state))
}

/// Gives each channel its program of the cycle, and begins the next one when all are done. May be
/// broken off at any point.
fn go_on(folder: &Path, gateway: &Gateway) {
    let file = folder.join("cycle");
    let cycle = fs::read_to_string(&file).map_or(0, |text| text.parse().unwrap());
    let mut is_over = true;
    for at in 0..CHANNELS {
        let name = format!("{cycle}-{at}");
        let filter = JobFilter { link: Some(format!("C{at}")), ..JobFilter::default() };
        let jobs = gateway.jobs(&filter).unwrap();
        let newest = jobs.iter().max_by_key(|job| job.id);
        let is_given = newest.is_some_and(|job| job.program.as_deref() == Some(&name));
        is_over &= cycle == 0 || newest.is_some_and(|job| is_given && job.state == JobState::Done);
        if cycle > 0 && !is_given {
            fs::write(folder.join("programs").join(&name), program(cycle, at)).unwrap();
            let order = JobOrder { program: Some(name), ..JobOrder::default() };
            gateway.submit(&format!("C{at}"), &order).unwrap();
        }
    }
    if is_over {
        let new = folder.join("cycle.new");
        fs::write(&new, (cycle + 1).to_string()).unwrap();
        fs::rename(new, file).unwrap();
    }
}

fn program(cycle: u32, at: usize) -> String {
    let mut text = String::new();
    for part in 0..PARTS {
        for block in 0..BLOCKS * (1 + (at + part) % 3) {
            let _ = writeln!(text, "(C{cycle} P{part} B{block})");
        }
        let mark = u64::from(cycle) * 100 + part as u64;
        let _ = writeln!(text, "(SOFTPLUG WAIT {mark} C0 C1 C2)");
    }
    text.push_str("(END)\n");
    text
}

/// A gateway that is killed when it is dropped.
struct Killed {
    child: Child,
    /// Whoever writes into a pipe that nobody reads ends.
    _said: Lines<BufReader<ChildStdout>>,
}

impl Killed {
    fn start(folder: &Path, test: &str) -> Self {
        Self::doing(folder, test, "")
    }

    fn doing(folder: &Path, test: &str, what: &str) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", &format!("gateway::cells_crash::{test}"), "--nocapture"]);
        let command = command.env(FOLDER, folder).env(DOES, what);
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
        wait_for("a gateway that has begun", || {
            said.next().is_some_and(|line| line.unwrap() == "begun")
        });
        Self { child, _said: said }
    }
}

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read(ptys: &[PtyPair], machines: &mut [Machine]) {
    let mut buffer = [0; 4_096];
    for (pty, machine) in ptys.iter().zip(machines) {
        while let Ok(ReadOutcome::Read(count)) = pty.read(&mut buffer) {
            let data = buffer[..count].iter().filter(|byte| !matches!(byte, 0x11..=0x14));
            machine.bytes.extend(data);
        }
    }
}

impl Machine {
    /// The furthest part of each cycle of which anything came, and the last mark that came whole.
    fn reached(&self) -> BTreeMap<u32, (usize, Option<usize>)> {
        let text = String::from_utf8_lossy(&self.bytes);
        let mut reached: BTreeMap<u32, (usize, Option<usize>)> = BTreeMap::new();
        for line in text.split_inclusive('\n') {
            // A program that begins again may have cut a block off.
            let line = line.rsplit_once('(').map_or(line, |(_, line)| line);
            if let Some(mark) =
                line.strip_prefix("SOFTPLUG WAIT ").filter(|_| line.ends_with(")\n"))
            {
                let number: u64 = mark.split(' ').next().unwrap().parse().unwrap();
                let entry = reached.entry((number / 100) as u32).or_default();
                entry.1 = entry.1.max(Some((number % 100) as usize));
            } else if let Some((cycle, part)) = block(line) {
                let entry = reached.entry(cycle).or_default();
                entry.0 = entry.0.max(part);
            }
        }
        reached
    }

    /// Cycles of which the last mark has come.
    fn cycles(&self) -> usize {
        let reached = self.reached();
        reached.values().filter(|(_, mark)| *mark == Some(PARTS - 1)).count()
    }
}

fn block(line: &str) -> Option<(u32, usize)> {
    let mut words = line.trim_end_matches([')', '\n']).split(' ');
    let cycle = words.next()?.strip_prefix('C')?.parse().ok()?;
    let part = words.next()?.strip_prefix('P')?.parse().ok()?;
    words.next()?.strip_prefix('B')?;
    Some((cycle, part))
}

fn nobody_is_ahead(machines: &[Machine], kill: u32) {
    let all: Vec<_> = machines.iter().map(Machine::reached).collect();
    for (ahead, reached) in all.iter().enumerate() {
        for (cycle, (part, _)) in reached.iter().filter(|(_, (part, _))| *part > 0) {
            for (behind, other) in all.iter().enumerate() {
                let mark = other.get(cycle).and_then(|(_, mark)| *mark);
                assert!(
                    mark >= Some(part - 1),
                    "kill {kill}: C{ahead} is in part {part} of cycle {cycle}, C{behind} came to mark {mark:?}"
                );
            }
        }
    }
}
