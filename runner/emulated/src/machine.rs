//! The emulated computer as tests use it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD, Engine as _};
use rustix::fs::{FlockOperation, flock};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::HANG;
use crate::console::{Console, Ran};
use crate::qemu::Qemu;
use crate::qmp::Qmp;
use crate::qmp::QmpError;
use crate::wire::Wire;

/// What the booted machine is kept in, beside its images.
const STATE: &str = "machine.state";

/// A computer of its own, with the command in it.
///
/// In the guest, `softplug` is in the path, the plug-ins are in `/plugins`, and the scripts run in
/// `/work`, which is empty.
pub struct Machine {
    qmp: Qmp,
    console: Console,
    uart: Wire,
    usb: Wire,
    processes: u32,
    qemu: Qemu,
    /// Taken by [`Self::lose_power`].
    flash: Option<TempDir>,
}

/// A program that runs in the guest.
#[derive(Copy, Clone, Debug)]
pub struct Process {
    number: u32,
    /// Its id in the guest.
    pub id: u32,
}

impl Machine {
    /// Starts one, as it is right after booting: with `/dev/ttyS1`, and no adapter.
    pub fn start() -> Self {
        let images = images();
        let lock = File::create(images.join("lock")).unwrap();
        flock(&lock, FlockOperation::LockExclusive).unwrap();
        if !images.join(STATE).exists() {
            Self::boot(&images, tempfile::tempdir().unwrap()).keep(&images);
        }
        drop(lock);
        let incoming = format!("exec:cat {STATE}");
        let flash = tempfile::tempdir().unwrap();
        let mut machine = Self::of(&images, flash, &["-S", "-incoming", &incoming]);
        let begin = Instant::now();
        while machine.qmp.ask("query-status", &json!({}))["status"] == "inmigrate" {
            assert!(begin.elapsed() < HANG, "QEMU does not go on: {}", machine.qemu.errors());
            sleep(Duration::from_millis(10));
        }
        machine.go_on();
        machine
    }

    /// Takes its power away, whatever it is doing, and boots it again. What is in its flash is left,
    /// and nothing else.
    pub fn lose_power(mut self) -> Self {
        self.qemu.kill();
        let flash = self.flash.take().expect("only taken here");
        Self::boot(&images(), flash)
    }

    fn boot(images: &Path, flash: TempDir) -> Self {
        let mut machine = Self::of(images, flash, &[]);
        machine.console.until_ready();
        // What is read once is in memory for all that go on from here.
        machine.run("softplug --version && cat /plugins/* >/dev/null").with_code(0);
        machine
    }

    /// Keeps what it is in memory, for others to go on from.
    fn keep(mut self, images: &Path) {
        self.stand_still();
        let new = format!("{STATE}.new");
        self.qmp.ask("migrate", &json!({ "uri": format!("exec:cat > {new}") }));
        let begin = Instant::now();
        loop {
            let migration = self.qmp.ask("query-migrate", &json!({}));
            match migration["status"].as_str() {
                Some("completed") => break,
                Some("failed" | "cancelled") => panic!("not kept: {migration}"),
                _ => assert!(begin.elapsed() < HANG, "not kept: {migration}"),
            }
            sleep(Duration::from_millis(20));
        }
        fs::rename(images.join(new), images.join(STATE)).unwrap();
    }

    fn of(images: &Path, flash: TempDir, more: &[&str]) -> Self {
        let file = flash.path().join("flash");
        let (qemu, [qmp, console, uart, usb]) = Qemu::start(images, &file, more);
        Self {
            qmp: Qmp::new(qmp),
            console: Console::new(console),
            uart: Wire::new(uart),
            usb: Wire::new(usb),
            processes: 0,
            qemu,
            flash: Some(flash),
        }
    }

    /// The other end of `/dev/ttyS1`.
    pub fn uart(&self) -> &Wire {
        &self.uart
    }

    /// The other end of `/dev/ttyUSB0`.
    pub fn usb(&self) -> &Wire {
        &self.usb
    }

    /// Runs a shell script in the guest to its end.
    #[track_caller]
    pub fn run(&mut self, script: &str) -> Ran {
        self.console.run(&format!("cd /work\n{script}"))
    }

    /// Writes a file of the guest.
    #[track_caller]
    pub fn write(&mut self, path: &str, content: &[u8]) {
        let text = BASE64_STANDARD.encode(content);
        let lines: Vec<_> = text.as_bytes().chunks(76).map(String::from_utf8_lossy).collect();
        let lines = lines.join("\n");
        self.run(&format!("base64 -d > {path} <<'END'\n{lines}\nEND")).with_code(0);
    }

    /// Reads a file of the guest, or several one after the other, as the shell expands the name.
    #[track_caller]
    pub fn read(&mut self, path: &str) -> Vec<u8> {
        let text = self.run(&format!("cat {path} | base64 -w0")).with_code(0).out;
        BASE64_STANDARD.decode(text).expect("the guest's base64 is right")
    }

    /// Starts a program in the guest: one command, as the shell reads it.
    #[track_caller]
    pub fn spawn(&mut self, command: &str) -> Process {
        self.processes += 1;
        let number = self.processes;
        let script = format!(
            "cat > /run/{number}.sh <<'END-OF-COMMAND'\n\
             echo $$ > /run/{number}.new; mv /run/{number}.new /run/{number}.pid\n\
             exec {command}\n\
             END-OF-COMMAND\n\
             ( sh /run/{number}.sh >/run/{number}.out 2>/run/{number}.err\n\
             echo $? > /run/{number}.new; mv /run/{number}.new /run/{number}.code ) &\n\
             until [ -e /run/{number}.pid ]; do usleep 10000; done; cat /run/{number}.pid"
        );
        let id = self.run(&script).with_code(0).out.trim().parse().unwrap();
        Process { number, id }
    }

    /// What a program has printed so far.
    #[track_caller]
    pub fn printed(&mut self, process: Process) -> String {
        let number = process.number;
        self.run(&format!("cat /run/{number}.out /run/{number}.err")).with_code(0).out
    }

    /// Waits until a program has printed this.
    #[track_caller]
    pub fn until_printed(&mut self, process: Process, text: &str) {
        let number = process.number;
        self.until(
            &format!("{text:?} of process {number}"),
            &format!("cat /run/{number}.out /run/{number}.err | grep -qF '{text}'"),
        );
    }

    /// Waits for a program's end.
    #[track_caller]
    pub fn wait(&mut self, process: Process) -> Ran {
        let number = process.number;
        self.until(&format!("the end of process {number}"), &format!("[ -e /run/{number}.code ]"));
        let code = self.run(&format!("cat /run/{number}.code")).out.trim().parse().unwrap();
        let out = self.run(&format!("cat /run/{number}.out")).out;
        let err = self.run(&format!("cat /run/{number}.err")).out;
        Ran { code, out, err }
    }

    /// Sends a signal to a program, named as for `kill`.
    #[track_caller]
    pub fn signal(&mut self, process: Process, signal: &str) {
        self.run(&format!("kill -{signal} {}", process.id)).with_code(0);
    }

    /// Waits until a program has the port open.
    #[track_caller]
    pub fn until_open(&mut self, process: Process, port: &str) {
        let id = process.id;
        self.until(
            &format!("{port} open in process {}", process.number),
            &format!("ls -l /proc/{id}/fd 2>/dev/null | grep -q ' {port}$'"),
        );
    }

    /// Waits until a condition of the shell holds in the guest.
    #[track_caller]
    pub fn until(&mut self, what: &str, condition: &str) {
        // The guest's time stands still while the host is busy, so it is counted here.
        let begin = Instant::now();
        while self
            .run(&format!(
                "for i in 1 2 3 4 5; do {condition} && exit 0; usleep 100000; done; exit 1"
            ))
            .code
            != 0
        {
            if begin.elapsed() > HANG {
                let all =
                    self.run("for f in /run/*.out /run/*.err; do echo == $f; cat $f; done; ps").out;
                panic!("waited in vain for {what}; in the guest:\n{all}");
            }
        }
    }

    /// Plugs the adapter in, always into the same socket, and waits for its device.
    #[track_caller]
    pub fn plug(&mut self) {
        let adapter = json!({
            "driver": "usb-serial", "bus": "usb-bus.0", "port": "1", "id": "adapter",
            "chardev": "usb", "serial": "EMULATED1",
        });
        let begin = Instant::now();
        // One that was pulled out a moment ago is not gone at once.
        while let Err(error) = self.qmp.try_ask("device_add", &adapter) {
            assert!(begin.elapsed() < HANG, "the adapter cannot be plugged in: {error}");
            sleep(Duration::from_millis(20));
        }
        self.until("/dev/ttyUSB0", "[ -c /dev/ttyUSB0 ]");
        self.run("udevadm settle").with_code(0);
    }

    /// Pulls the adapter out, in whatever it is doing.
    #[track_caller]
    pub fn unplug(&mut self) {
        self.qmp.ask("device_del", &json!({ "id": "adapter" }));
    }

    /// A break on the line to `/dev/ttyS1`.
    #[track_caller]
    pub fn send_break(&mut self) {
        self.qmp.ask("chardev-send-break", &json!({ "id": "uart" }));
    }

    /// Stops the processor; what is on the wires goes on.
    #[track_caller]
    pub fn stand_still(&mut self) {
        self.qmp.ask("stop", &json!({}));
    }

    /// Lets the processor go on.
    #[track_caller]
    pub fn go_on(&mut self) {
        self.qmp.ask("cont", &json!({}));
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        // In good order if it can; the process is killed right after.
        let _: Result<Value, QmpError> = self.qmp.try_ask("quit", &json!({}));
    }
}

/// The folder of the images.
fn images() -> PathBuf {
    let folder = std::env::var_os("SOFTPLUG_EMULATED").map(PathBuf::from);
    folder.filter(|folder| folder.join("initrd").is_file()).expect(
        "the emulated computer's images are made by `cargo xtask test --emulated`, which names \
         their folder in SOFTPLUG_EMULATED",
    )
}
