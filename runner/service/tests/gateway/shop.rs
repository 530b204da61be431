//! A shop floor for tests: a gateway in a folder of its own, and machines at the
//! other ends of ptys.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::{Duration, Instant};

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_service::config::Config;
use softplug_service::gateway::{Gateway, Running, start};
use softplug_service::library::Library;
use softplug_service::view::{LinkState, StopHow};
use tempfile::TempDir;

use crate::gateway::machine::Machine;
use crate::gateway::plugins::{flood, fragile};

/// Longer than anything here takes; only a hang gets there.
pub(crate) const HANG: Duration = Duration::from_mins(2);

/// A gateway and its machines.
pub(crate) struct Shop {
    folder: TempDir,
    running: Option<Running>,
    ptys: Vec<PtyPair>,
}

/// The plug-ins as they were built for tests.
pub(crate) fn plugins() -> PathBuf {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").filter(|folder| !folder.is_empty());
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../target/plugins");
    let folder = folder.map_or_else(beside, PathBuf::from);
    let file = folder.join("xon-xoff.wasm");
    assert!(file.is_file(), "there is no {}: run `cargo xtask build`", file.display());
    folder
}

/// Waits for something that comes about in another thread.
pub(crate) fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !there() {
        assert!(begin.elapsed() < HANG, "{what} did not come about");
        sleep(Duration::from_millis(5));
    }
}

impl Shop {
    /// So many links, each with these lines, on ptys whose masters are the machines.
    pub(crate) fn with(links: usize, lines: &str) -> Self {
        let ptys: Vec<_> = (0..links).map(|_| PtyPair::open().unwrap()).collect();
        let ports: Vec<_> = ptys.iter().map(|pty| pty.slave_path().display().to_string()).collect();
        Self::of(&ports, lines, ptys)
    }

    /// A link for each of these, and the gateway with more lines of its own.
    pub(crate) fn each(gateway: &str, lines: &[&str]) -> Self {
        let ptys: Vec<_> = lines.iter().map(|_| PtyPair::open().unwrap()).collect();
        let ports: Vec<_> = ptys.iter().map(|pty| pty.slave_path().display().to_string()).collect();
        let links: Vec<_> =
            ports.iter().zip(lines).map(|(port, lines)| (&**port, *lines)).collect();
        Self::of_links(gateway, &links, ptys)
    }

    /// One link with this machine.
    pub(crate) fn of_machine<P>(machine: &Machine<P>, lines: &str) -> Self {
        Self::of(std::slice::from_ref(&machine.port), lines, Vec::new())
    }

    /// One link with a machine that the gateway simulates.
    pub(crate) fn simulated(protocol: &str, lines: &str) -> Self {
        Self::of(&[format!("simulate:{protocol}")], lines, Vec::new())
    }

    fn of(ports: &[String], lines: &str, ptys: Vec<PtyPair>) -> Self {
        let links: Vec<_> = ports.iter().map(|port| (&**port, lines)).collect();
        Self::of_links("", &links, ptys)
    }

    /// Links, each with its port and lines.
    pub(crate) fn of_links(gateway: &str, links: &[(&str, &str)], ptys: Vec<PtyPair>) -> Self {
        let mut shop = Self::not_started(gateway, links, ptys);
        shop.start();
        shop
    }

    /// The folder of a gateway that does not run yet.
    pub(crate) fn not_started(gateway: &str, links: &[(&str, &str)], ptys: Vec<PtyPair>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let library = Library::open(&folder.path().join("state/plugins")).unwrap();
        for name in ["xon-xoff", "fanuc-rs232", "r3964"] {
            library.add_file(&plugins().join(format!("{name}.wasm"))).unwrap();
        }
        library.add(&fragile("1.0.0", Some('X'))).unwrap();
        library.add(&flood(false)).unwrap();
        library.add(&flood(true)).unwrap();
        let mut text = "[gateway]\nwatch = false\nstop-patience = \"20s\"\n".to_owned();
        text.push_str(gateway);
        for (at, (port, lines)) in links.iter().enumerate() {
            let head = format!("[[link]]\nname = \"link-{at}\"\nport = \"{port}\"\n");
            text.extend([head.as_str(), "search = [\"b\"]\n", lines]);
        }
        fs::write(folder.path().join("gateway.toml"), text).unwrap();
        Self { folder, running: None, ptys }
    }

    /// Starts the gateway, whose ports may be missing.
    pub(crate) fn start_without_ports(&mut self) {
        let config = Config::read(&self.folder.path().join("gateway.toml")).unwrap();
        self.running = Some(start(config).unwrap());
    }

    /// Starts the gateway and waits until its ports are open.
    pub(crate) fn start(&mut self) {
        self.start_without_ports();
        wait_for("open ports", || {
            let links = self.gateway().links().unwrap();
            links.iter().all(|link| !matches!(link.state, LinkState::Opening | LinkState::Down))
        });
    }

    /// Waits for the end of a stop; how many bytes of receptions it gave up.
    pub(crate) fn stopped(&mut self) -> u64 {
        let running = self.running.take().unwrap();
        running.wait_for_stop();
        let lost = running.lost();
        running.wait();
        lost
    }

    pub(crate) fn gateway(&self) -> &Gateway {
        self.running.as_ref().unwrap().gateway()
    }

    pub(crate) fn name(link: usize) -> String {
        format!("link-{link}")
    }

    /// Changes the configuration's file.
    pub(crate) fn configure(&self, change: impl FnOnce(String) -> String) {
        let file = self.folder.path().join("gateway.toml");
        let text = fs::read_to_string(&file).unwrap();
        fs::write(&file, change(text)).unwrap();
    }

    /// Where something is in the shop's folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Puts a program of so many bytes into the folder of programs.
    pub(crate) fn program(&self, name: &str, bytes: usize) -> Vec<u8> {
        self.program_in("", name, bytes)
    }

    pub(crate) fn program_in(&self, folder: &str, name: &str, bytes: usize) -> Vec<u8> {
        let mut text = format!("%\n{} (TEST)\n", if name.starts_with('O') { name } else { "O1" });
        let mut number = 10;
        while text.len() + 30 < bytes {
            let (x, y) = (number % 97, number % 89);
            let _ = writeln!(text, "N{number} G1 X{x}.5 Y-{y}.25");
            number += 10;
        }
        text += "M30\n%\n";
        let folder = self.folder.path().join("programs").join(folder);
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join(name), &text).unwrap();
        text.into_bytes()
    }

    /// Reads what a machine gets, without the control codes of flow control.
    pub(crate) fn read(&self, link: usize, count: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        wait_for("the machine's data", || {
            bytes.extend(self.take(link));
            bytes.len() >= count
        });
        bytes
    }

    /// What a machine has got by now.
    pub(crate) fn take_now(&self, link: usize) -> Vec<u8> {
        self.take(link)
    }

    /// How many bytes a machine has got by now, which are lost.
    pub(crate) fn waiting(&self, link: usize) -> usize {
        self.take(link).len()
    }

    fn take(&self, link: usize) -> Vec<u8> {
        let mut buffer = [0; 4_096];
        let mut bytes = Vec::new();
        while let ReadOutcome::Read(count) = self.ptys[link].read(&mut buffer).unwrap() {
            bytes.extend(buffer[..count].iter().filter(|byte| !matches!(byte, 0x11..=0x14)));
        }
        bytes
    }

    /// The machine takes all that comes until something is so.
    pub(crate) fn drain(&self, link: usize, mut until: impl FnMut() -> bool) {
        wait_for("what the machine is drained for", || {
            self.take(link);
            until()
        });
    }

    pub(crate) fn drain_all(&self, mut until: impl FnMut() -> bool) {
        wait_for("what the machines are drained for", || {
            for link in 0..self.ptys.len() {
                self.take(link);
            }
            until()
        });
    }

    /// The machine sends.
    pub(crate) fn write(&self, link: usize, bytes: &[u8]) {
        assert_eq!(self.ptys[link].write(bytes).unwrap(), bytes.len());
    }

    /// The machine says stop, and it has arrived.
    pub(crate) fn hold(&self, link: usize) {
        self.write(link, b"\x13");
        let name = Self::name(link);
        wait_for("the hold", || self.gateway().link(&name).unwrap().is_held);
    }

    pub(crate) fn release(&self, link: usize) {
        self.write(link, b"\x11");
    }
}

impl Drop for Shop {
    fn drop(&mut self) {
        if let Some(running) = self.running.take() {
            running.gateway().stop(StopHow::Park);
            // A machine that takes nothing would make the stop wait for it.
            let until = Instant::now() + Duration::from_secs(2);
            while Instant::now() < until && running.gateway().links().is_ok() {
                for link in 0..self.ptys.len() {
                    self.take(link);
                }
                sleep(Duration::from_millis(5));
            }
            // What cannot be put away would hold it up for ever.
            running.gateway().stop(StopHow::Park);
            running.wait();
        }
    }
}
