//! The kernel's own XON/XOFF as a partner that this project did not write: the
//! slave of a pty with IXON set, with another program on it.

#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use rustix::termios::{Action as Flow, tcflow};
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{Action, Failure, LineParameters, Micros};
use softplug_link::LinkHost;
use softplug_live::station::{Station, StationOptions, Turn};
use softplug_live::transfer::{SendOptions, SendOutcome, send};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_native::{NativeInstance, NativePlugin};

/// No test waits longer.
const PATIENCE: Micros = Micros::from_secs(60);

fn settings(asked: &[(&str, &str)]) -> SettingValues {
    let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes()).unwrap();
    manifest.resolve_settings(asked.iter().copied()).unwrap()
}

fn station(baud: u32, options: StationOptions) -> (Station<NativeInstance>, PathBuf) {
    let port = Port::open(&PortSpec::Pty, &PortOptions::new(LineParameters::new(baud))).unwrap();
    let path = port.slave_path().unwrap().to_owned();
    (Station::new(port, NativePlugin::XonXoff.instantiate(), options).unwrap(), path)
}

fn program(bytes: usize) -> Vec<u8> {
    let block = |n: usize| format!("N{n} G1 X{}.{:03} Z-{}\n", n % 90, n % 1_000, n % 70);
    (0..).flat_map(|n| block(n).into_bytes()).take(bytes).collect()
}

/// Ends its process when dropped.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Takes deliveries in, but puts bytes away only while the partner is stopped, a
/// few at a time: however slow the partner is, it has to be stopped.
struct SlowDisk {
    received: Vec<u8>,
    waiting: u32,
    drained: u32,
    stops: u32,
    is_stopped: bool,
    /// How the delivery ended.
    end: Option<Result<(), Failure>>,
}

impl LinkHost for SlowDisk {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::Deliver { bytes, .. } => {
                self.received.extend(*bytes);
                self.waiting += bytes.len() as u32;
            }
            Action::State { name } => {
                self.is_stopped = *name == "stopped";
                self.stops += u32::from(self.is_stopped);
            }
            Action::DeliveryEnd { failure, .. } => self.end = Some(failure.map_or(Ok(()), Err)),
            _ => {}
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}

mod needs_stty {
    use super::*;

    /// `stty ixon` and a plain `cat` send to us; the kernel stops them at our
    /// XOFF and lets them go on at our XON.
    #[test]
    fn the_kernel_obeys_our_xoff_while_cat_sends() {
        // The kernel stops cat, but what is in the pty by then comes all the same.
        let options = StationOptions {
            settings: settings(&[
                ("low_mark", "30000"),
                ("high_mark", "45000"),
                ("quiet_time", "30000"),
                ("end_mark", "25"),
                ("end_quiet", "200"),
                ("xoff_repeat", "0"),
            ]),
            delivery_room: 65_536,
            ..StationOptions::default()
        };
        let (mut station, path) = station(0, options);
        let mut disk = SlowDisk {
            received: Vec::new(),
            waiting: 0,
            drained: 0,
            stops: 0,
            is_stopped: false,
            end: None,
        };
        station.open(&mut disk).unwrap();
        let set = Command::new("stty").arg("-F").arg(&path).args(["raw", "-echo", "ixon"]).status();
        assert!(set.unwrap().success());
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("program.nc");
        let mut program = program(400_000);
        program.push(b'%');
        std::fs::write(&file, &program).unwrap();
        let slave = File::options().write(true).open(&path).unwrap();
        let cat = Command::new("cat").arg(&file).stdout(slave).stdin(Stdio::null()).spawn();
        let _cat = Ended(cat.unwrap());
        let end = station.now() + PATIENCE;
        while disk.end.is_none() && station.now() < end {
            let turn = station.turn(station.now() + Micros::from_millis(1), &mut disk).unwrap();
            assert_eq!(turn, Turn::Live);
            let put_away = if disk.is_stopped { disk.waiting.min(2_000) } else { 0 };
            disk.waiting -= put_away;
            disk.drained += put_away;
        }
        assert_eq!(disk.end, Some(Ok(())), "{} bytes came", disk.received.len());
        assert!(disk.received == program, "what came is not what was sent");
        assert!(disk.stops >= 5, "only {} stops", disk.stops);
    }
}

/// The kernel sends 13 and 11 for a helper that calls tcflow; we obey both.
#[test]
fn we_obey_the_kernels_stop_and_start() {
    let options = StationOptions { settings: settings(&[]), ..StationOptions::default() };
    let (mut station, path) = station(115_200, options);
    // Opened before anything is sent, so that nothing is echoed or lost.
    let slave = open_raw(&path);
    let holder = slave.try_clone().unwrap();
    let program = program(60_000);
    let expected = program.len();
    let reader = thread::spawn(move || read_exactly(slave, expected));
    let done = std::sync::Arc::new(AtomicBool::new(false));
    let ended = std::sync::Arc::clone(&done);
    let helper = thread::spawn(move || {
        let mut holds = 0;
        while !ended.load(Ordering::Relaxed) {
            tcflow(&holder, Flow::IOff).unwrap();
            thread::park_timeout(Duration::from_millis(20));
            tcflow(&holder, Flow::IOn).unwrap();
            thread::park_timeout(Duration::from_millis(20));
            holds += 1;
        }
        holds
    });
    let request =
        SendOptions { check: true, size: Some(expected as u64), ..SendOptions::default() };
    let stop = AtomicBool::new(false);
    let report =
        send(&mut station, &mut Cursor::new(&program), &request, &stop, &mut |_| {}).unwrap();
    done.store(true, Ordering::Relaxed);
    let received = reader.join().unwrap();
    let holds: u64 = helper.join().unwrap();
    assert_eq!(report.outcome, SendOutcome::Done);
    assert!(received == program, "what arrived is not what was sent");
    assert!(report.holds >= 20, "only {} holds obeyed of {holds}", report.holds);
}

fn open_raw(path: &Path) -> File {
    let slave = File::options().read(true).write(true).open(path).unwrap();
    let mut attributes = rustix::termios::tcgetattr(&slave).unwrap();
    attributes.make_raw();
    let now = rustix::termios::OptionalActions::Now;
    rustix::termios::tcsetattr(&slave, now, &attributes).unwrap();
    slave
}

fn read_exactly(mut slave: File, bytes: usize) -> Vec<u8> {
    let mut received = vec![0; bytes];
    slave.read_exact(&mut received).unwrap();
    received
}
