//! Links whose plug-ins run in a front-end unit: to whoever uses the gateway they are as others are.

use softplug_abi::JobId;
use std::fs;
use std::path::Path;
use std::thread::{self, JoinHandle};

use softplug_live::pty::PtyPair;
use softplug_live::units::TlsPrivateKey;
use softplug_machines::fanuc::Press;
use softplug_machines::kept::Received;
use softplug_service::view::{
    BusUnitView, JobFilter, JobOrigin, JobState, LinkState, StopHow, SwapOrder, SwapState,
    SwapWhen, UnitSlotView,
};
use softplug_unit::{Stop, Unit, UnitConfig};
use tempfile::TempDir;

use crate::gateway::machine::Machine;
use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, memory, send};

/// A unit with one link, in this process.
struct TestUnit {
    port: String,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
    folder: TempDir,
    /// How often it was started.
    starts: u64,
}

impl TestUnit {
    fn with(port: &str, line: &str) -> Self {
        Self::in_folder(tempfile::tempdir().unwrap(), port, line, "")
    }

    fn in_folder(folder: TempDir, port: &str, line: &str, tls: &str) -> Self {
        let text = format!(
            "name = \"unit-1\"\nlisten = \"127.0.0.1:0\"\nstate = \"state\"\n[signature]\nunsigned = true\n{tls}\
             [[link]]\nname = \"mill\"\nport = \"{port}\"\nline = \"{line}\"\nmemory_size = \"256KiB\"\n"
        );
        fs::write(folder.path().join("unit.toml"), text).unwrap();
        Self::start(folder, 1)
    }

    fn start(folder: TempDir, starts: u64) -> Self {
        let config = UnitConfig::read(&folder.path().join("unit.toml")).unwrap();
        let unit = Unit::start(config, starts << 40).unwrap();
        let (port, stop) = (format!("unit://{}/mill", unit.address()), unit.stop());
        let thread = Some(thread::spawn(move || unit.run().unwrap()));
        Self { port, stop, thread, folder, starts }
    }

    /// Stopped and started at its address: what it had not put away is lost.
    fn started_anew(mut self) -> Self {
        let address = self.port.trim_start_matches("unit://").trim_end_matches("/mill");
        let file = self.folder.path().join("unit.toml");
        let text = fs::read_to_string(&file).unwrap().replace("127.0.0.1:0", address);
        fs::write(&file, text).unwrap();
        self.stop.ask();
        self.thread.take().unwrap().join().unwrap();
        let folder = std::mem::replace(&mut self.folder, tempfile::tempdir().unwrap());
        Self::start(folder, self.starts + 1)
    }

    /// With the slave of a pty, whose master is the machine.
    fn with_pty() -> (Self, PtyPair) {
        let pty = PtyPair::open().unwrap();
        let path: &Path = pty.slave_path();
        let unit = Self::with(&path.display().to_string(), "921600 8N1");
        (unit, pty)
    }
}

impl Drop for TestUnit {
    fn drop(&mut self) {
        self.stop.ask();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

fn shop(unit: &TestUnit, plugin: &str, ptys: Vec<PtyPair>) -> Shop {
    let lines = format!("plugin = \"{plugin}\"\n");
    Shop::of_links("", &[(&unit.port, &lines)], ptys)
}

#[test]
fn a_program_reaches_the_machine_and_is_told_as_elsewhere() {
    let (unit, pty) = TestUnit::with_pty();
    let shop = shop(&unit, "xon-xoff", vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let program = shop.program("O1.nc", 50_000);
    let job = gateway.submit(&link, &send("O1.nc")).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
    wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    let job = gateway.job(JobId(job.id)).unwrap();
    let size = program.len() as u64;
    assert_eq!((job.progress.taken, job.progress.size), (size, Some(size)), "{job:?}");
    wait_for("the line's end", || gateway.link(&link).unwrap().state == LinkState::Idle);
    wait_for("the counters", || gateway.link(&link).unwrap().counters.bytes_out >= size);
}

#[test]
fn a_job_is_held_paused_resumed_and_aborted() {
    let (unit, pty) = TestUnit::with_pty();
    let shop = shop(&unit, "xon-xoff", vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    shop.program("long.nc", 400_000);
    let job = gateway.submit(&link, &send("long.nc")).unwrap();
    shop.read(0, 5_000);
    shop.hold(0);
    shop.release(0);
    wait_for("the release", || !gateway.link(&link).unwrap().is_held);
    assert_eq!(gateway.pause(JobId(job.id)).unwrap().state, JobState::Paused);
    assert_eq!(gateway.resume(JobId(job.id)).unwrap().state, JobState::Running);
    shop.read(0, 1_000);
    gateway.abort(JobId(job.id)).unwrap();
    shop.drain(0, || gateway.job(JobId(job.id)).unwrap().state == JobState::Aborted);
}

#[test]
fn of_a_unit_that_was_started_anew_no_job_is_shown_and_the_unit_is_to_blame() {
    let (unit, pty) = TestUnit::with_pty();
    let shop = shop(&unit, "xon-xoff", vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    shop.program("long.nc", 400_000);
    let job = gateway.submit(&link, &send("long.nc")).unwrap();
    shop.read(0, 5_000);
    shop.hold(0);
    wait_for("the hold", || gateway.link(&link).unwrap().is_held);
    let _unit = unit.started_anew();
    wait_for("the job's end", || {
        gateway.job(JobId(job.id)).unwrap().state == JobState::Interrupted
    });
    let message = gateway.job(JobId(job.id)).unwrap().message.unwrap();
    assert_eq!(message, "the unit, or its plug-in, ended in the middle of it");
    let shown = || gateway.link(&link).unwrap();
    wait_for("the link", || shown().state == LinkState::Idle && !shown().is_held);
}

#[test]
fn what_the_machine_sends_is_a_reception() {
    let (unit, pty) = TestUnit::with_pty();
    let shop = shop(&unit, "xon-xoff", vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let text = b"N10 G1 X1\n".repeat(2_000);
    for (part, written) in text.chunks(500).zip(1..) {
        shop.write(0, part);
        // A pty takes no more than a few thousand bytes that nobody has read.
        let came = || gateway.link(&link).unwrap().counters.bytes_in;
        wait_for("the unit", || came() >= written * 500);
    }
    let received = || gateway.receptions(&link).unwrap();
    wait_for("the reception", || !received().is_empty());
    let [reception] = &received()[..] else { panic!("{:?}", received()) };
    assert_eq!((reception.bytes, &reception.failure), (text.len() as u64, &None));
    let file = shop.path("state/receptions").join(&link).join(&reception.file);
    assert!(fs::read(&file).unwrap() == text, "{}", file.display());
}

#[test]
fn what_a_unit_has_of_a_reception_while_the_gateway_starts_anew_is_kept_too() {
    let (unit, pty) = TestUnit::with_pty();
    let mut shop = shop(&unit, "xon-xoff", vec![pty]);
    let link = Shop::name(0);
    let text: Vec<u8> = (0..400).flat_map(|n| format!("N{n:04} G1\n").into_bytes()).collect();
    let (first, rest) = text.split_at(1_500);
    shop.write(0, first);
    let came = |shop: &Shop| shop.gateway().link(&link).unwrap().counters.bytes_in;
    wait_for("the first part", || came(&shop) >= first.len() as u64);
    wait_for("its job", || !shop.gateway().jobs(&JobFilter::default()).unwrap().is_empty());
    shop.gateway().stop(StopHow::Park);
    shop.stopped();
    shop.write(0, rest);
    shop.start();
    wait_for("the end", || {
        let jobs = shop.gateway().jobs(&JobFilter::default()).unwrap();
        jobs.len() > 1 && jobs.iter().all(|job| job.ended_ms.is_some())
    });
    let mut receptions = shop.gateway().receptions(&link).unwrap();
    receptions.sort_by_key(|reception| reception.job);
    let read = |file: &str| fs::read(shop.path("state/receptions").join(&link).join(file)).unwrap();
    let mut next = 0;
    for piece in receptions.iter().map(|reception| read(&reception.file)) {
        // What was not yet told as stored comes once more.
        let overlap = (0..=next).rev().find(|at| text[*at..].starts_with(&piece));
        let at = overlap.unwrap_or_else(|| panic!("nothing between is missing: {receptions:?}"));
        next = next.max(at + piece.len());
    }
    assert_eq!(next, text.len(), "{receptions:?}");
}

#[test]
fn a_reception_that_waits_while_its_link_gets_another_name_is_kept_once() {
    let (unit, pty) = TestUnit::with_pty();
    let lines = "plugin = \"xon-xoff\"\nquota = { receptions = 1 }\n";
    let shop = Shop::of_links("", &[(&unit.port, lines)], vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let kept = || {
        let folders = [&*link, "mill"].map(|link| shop.path("state/receptions").join(link));
        let files = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
        let whole =
            files.map(|file| file.unwrap().path()).filter(|file| file.extension().is_none());
        let mut texts: Vec<_> = whole.map(|file| fs::read_to_string(file).unwrap()).collect();
        texts.sort_unstable();
        texts
    };
    let is_idle = |link: &str| gateway.link(link).unwrap().state == LinkState::Idle;
    shop.write(0, b"N1 G1\n");
    wait_for("the first", || kept() == ["N1 G1\n"] && is_idle(&link));
    shop.write(0, b"N2 G1\n");
    wait_for("the second", || journal_says(gateway, "\"link-0\" receives cannot be put away"));
    wait_for("its end", || is_idle(&link));
    shop.configure(|text| {
        let text = text.replace("name = \"link-0\"", "name = \"mill\"");
        text.replace("quota = { receptions = 1 }\n", "")
    });
    gateway.reload().unwrap();
    wait_for("the link", || is_idle("mill"));
    // Behind all that the unit says again.
    shop.write(0, b"N3 G1\n");
    wait_for("the third", || kept().iter().any(|text| text.starts_with("N3")) && is_idle("mill"));
    wait_for("the second", || kept().iter().any(|text| text.starts_with("N2")));
    assert_eq!(kept(), ["N1 G1\n", "N2 G1\n", "N3 G1\n"]);
}

#[test]
fn the_panel_gets_the_program_that_it_asks_for() {
    let panel = Machine::fanuc();
    let unit = TestUnit::with(&panel.port, "9600 8N2");
    let shop = shop(&unit, "fanuc-rs232", Vec::new());
    let gateway = shop.gateway();
    let program = shop.program_in("b", "O1234", 2_000);
    panel.tell(|now, control| control.press(now, Press::Request("O1234".to_owned())));
    let kept = program.strip_prefix(b"%\n").unwrap().strip_suffix(b"\n").unwrap().to_vec();
    wait_for("the program", || match panel.tell(|_, control| control.report()).received {
        Received::Bytes(bytes) => bytes == kept,
        Received::Digest { .. } => false,
    });
    let asked_for = || {
        let jobs = gateway.jobs(&JobFilter::default()).unwrap();
        jobs.into_iter().find(|job| job.origin == JobOrigin::Panel)
    };
    wait_for("the job", || asked_for().is_some_and(|job| job.state == JobState::Done));
}

/// The answer of a job comes before its end.
#[test]
fn jobs_read_and_write_the_machines_memory_and_the_machine_reads_files() {
    let machine = Machine::rk512();
    let unit = TestUnit::with(&machine.port, "115200 8N1");
    let lines = "plugin = \"r3964\"\nsettings = { layer = \"rk512\" }\n";
    let shop = Shop::of_links("", &[(&unit.port, lines)], Vec::new());
    memory::read_and_write(&machine, &shop);
    memory::read_from_files(&machine, &shop);
}

#[test]
fn a_plug_in_is_swapped_in_the_middle_of_a_job() {
    let (unit, pty) = TestUnit::with_pty();
    let shop = shop(&unit, "xon-xoff", vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let program = shop.program("O1.nc", 200_000);
    let job = gateway.submit(&link, &send("O1.nc")).unwrap();
    let mut got = shop.read(0, 20_000);
    let (settings, probation) = (None, None);
    let order = SwapOrder { plugin: "xon-xoff".into(), settings, when: SwapWhen::Now, probation };
    let swap = gateway.swap(&link, &order).unwrap();
    assert!(matches!(swap.state, SwapState::Done | SwapState::Probation), "{swap:?}");
    got.extend(shop.read(0, program.len() - got.len()));
    assert_eq!(got, program);
    wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    wait_for("the swap", || journal_says(gateway, "runs in place of"));
}

#[test]
fn a_plug_in_that_traps_is_started_again_and_can_be_quarantined() {
    let (unit, pty) = TestUnit::with_pty();
    let shop = shop(&unit, "fragile", vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    shop.write(0, b"X");
    wait_for("the fault", || journal_says(gateway, "is started again"));
    wait_for("the plug-in", || gateway.link(&link).unwrap().state == LinkState::Idle);
    gateway.quarantine(&link).unwrap();
    wait_for("the quarantine", || gateway.link(&link).unwrap().state == LinkState::Quarantined);
    gateway.release(&link).unwrap();
    wait_for("the plug-in", || gateway.link(&link).unwrap().state == LinkState::Idle);
}

#[test]
fn units_on_a_bus_are_fed_in_turn_and_shown() {
    let units = [TestUnit::with_pty(), TestUnit::with_pty()];
    let bus = "[[bus]]\nname = \"hall\"\nrate = 320_000\nefficiency = 0.5\nswitch = \"2ms\"\n";
    let lines = "plugin = \"xon-xoff\"\nbus = \"hall\"\n";
    let (units, ptys): (Vec<_>, Vec<_>) = units.into_iter().unzip();
    let ports = [&*units[0].port, &*units[1].port].map(|port| (port, lines));
    let shop = Shop::of_links(bus, &ports, ptys);
    let gateway = shop.gateway();
    let program = shop.program("O1.nc", 30_000);
    let submit = |at| gateway.submit(&Shop::name(at), &send("O1.nc")).unwrap();
    let jobs = [submit(0), submit(1)];
    for at in 0..2 {
        assert_eq!(shop.read(at, program.len()), program);
    }
    for job in jobs {
        wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    }
    let shown = || gateway.buses().unwrap();
    wait_for("the units' buffers", || shown()[0].units.iter().all(|unit| unit.buffer > 0));
    let is_confirmed = |slot: &UnitSlotView| slot.runs && slot.state == "confirmed";
    let has_proved = |unit: &BusUnitView| unit.slots.iter().any(is_confirmed);
    wait_for("the trials' end", || shown()[0].units.iter().all(has_proved));
    let [bus] = &shown()[..] else { panic!("{:?}", shown()) };
    assert_eq!((bus.name.as_str(), bus.rate, bus.efficiency), ("hall", 320_000.0, 0.5));
    assert!(bus.measured.load.is_some_and(|load| load > 0.0 && load < 1.1), "{bus:?}");
    assert!(bus.measured.efficiency.is_some_and(|part| part < 1.0), "{bus:?}");
    let links: Vec<_> = bus.units.iter().map(|unit| unit.link.clone()).collect();
    assert_eq!(links, [Shop::name(0), Shop::name(1)]);
    for (unit, of) in bus.units.iter().zip(&units) {
        assert_eq!((unit.port.as_str(), unit.buffer), (of.port.as_str(), 65_536));
        let running: Vec<_> = unit.slots.iter().filter(|slot| slot.runs).collect();
        assert!(matches!(running[..], [slot] if slot.digest.is_some()), "{unit:?}");
    }

    shop.configure(|text| text.replace("rate = 320_000", "rate = 640_000"));
    let view = gateway.reload().unwrap();
    assert_eq!((view.buses, view.untouched), (vec!["hall".to_owned()], 2));
    wait_for("the journal", || journal_says(gateway, "was read again; buses: hall"));
    wait_for("the bus", || shown()[0].rate > 600_000.0);
}

#[test]
fn a_unit_is_reached_with_tls_and_keys_change_by_a_reload() {
    let (keys, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let file = |name: &str| keys.path().join(name);
    let make = |name: &str| TlsPrivateKey::make(&file(name)).unwrap().public();
    let (ours, later) = (make("gateway.key"), make("later.key"));
    let unit_key = TlsPrivateKey::make(&folder.path().join("unit.key")).unwrap().public();
    let pty = PtyPair::open().unwrap();
    let tls = format!("[tls]\nkey = \"unit.key\"\ngateways = [\"{ours}\", \"{later}\"]\n");
    let port = pty.slave_path().display().to_string();
    let unit = TestUnit::in_folder(folder, &port, "921600 8N1", &tls);
    let key = format!("key = \"{}\"\n", file("gateway.key").display());
    let lines = format!("plugin = \"xon-xoff\"\nunit-key = \"{unit_key}\"\n");
    let shop = Shop::of_links(&key, &[(&unit.port, &lines)], vec![pty]);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let send_one = || {
        let program = shop.program("O1.nc", 20_000);
        let job = gateway.submit(&link, &send("O1.nc")).unwrap();
        assert_eq!(shop.read(0, program.len()), program);
        wait_for("the job's end", || gateway.job(JobId(job.id)).unwrap().state == JobState::Done);
    };
    send_one();
    let changed = |from: &str, to: &str| {
        shop.configure(|text| text.replace(from, to));
        let view = gateway.reload().unwrap();
        assert_eq!(view.changed[0].keys, ["unit-key"]);
        assert!(view.needs_restart.is_empty());
    };
    // A key that the unit has not, and that of the unit again.
    let (right, wrong) = (unit_key.to_string(), later.to_string());
    changed(&right, &wrong);
    let says = format!("has the key {right}, and not {wrong}");
    wait_for("the refusal", || journal_says(gateway, &says));
    changed(&wrong, &right);
    wait_for("the unit", || gateway.link(&link).unwrap().state == LinkState::Idle);
    // Another key of the gateway, which the unit has too.
    changed("gateway.key", "later.key");
    wait_for("the unit", || gateway.link(&link).unwrap().state == LinkState::Idle);
    send_one();
}

#[test]
fn an_endpoint_on_a_unit_is_refused() {
    let text = "[[link]]\nname = \"a\"\nport = \"unit://127.0.0.1:7640/mill\"\nplugin = \"xon-xoff\"\n\
                endpoint = { listen = \"127.0.0.1:4001\" }\n";
    let refused = softplug_service::Config::parse(Path::new("gateway.toml"), text).unwrap_err();
    assert!(refused.to_string().contains("which has no endpoint"), "{refused}");
}
