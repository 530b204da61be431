//! An emulated board: its process, its lines, and a look into its memory.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use softplug_unit_slots::Geometry;
use tempfile::TempDir;

/// How long something that must come may take on a busy machine.
pub(super) const PATIENCE: Duration = Duration::from_mins(2);

const RAM: u32 = 0x2000_0000;
const FIGURES: u32 = 0x2001_FFC0;
const MAGIC: u32 = 0x5350_4655;
const PAINT: u32 = 0xA5A5_A5A5;
const SLOTS: u32 = 0x0008_0000;
const SLOTS_GEOMETRY: Geometry = Geometry { size: 512 * 1_024, erase: 4_096, granule: 4 };
/// An instruction takes 8 ns here, whatever it does: the processor has 125 million a second.
const ICOUNT: &str = "shift=3,sleep=on";
/// Its clocks take 40 ns.
const INSTRUCTIONS_A_CLOCK: u64 = 5;

/// A running board. Dropping it ends it, and so does the end of the thread that started it.
pub(super) struct Board {
    child: Child,
    folder: TempDir,
    machine: UnixStream,
    control: BufReader<UnixStream>,
}

/// What the firmware says of itself.
#[derive(Copy, Clone, Debug)]
pub(super) struct Figures {
    pub(super) static_bytes: u32,
    pub(super) heap_bytes: u32,
    pub(super) stack_bytes: u32,
    pub(super) turns: u32,
    worked: u64,
}

impl Figures {
    /// Static data, heap and stack at their highest, and the figures themselves.
    pub(super) fn ram(&self) -> u32 {
        self.static_bytes + self.heap_bytes + self.stack_bytes + 64
    }

    /// Instructions between two looks, without those of waiting.
    pub(super) fn instructions(begin: &Self, end: &Self) -> u64 {
        (end.worked - begin.worked) * INSTRUCTIONS_A_CLOCK
    }
}

impl Board {
    pub(super) fn start() -> Self {
        let by_hand = || {
            let target = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../target");
            target.join("thumbv7em-none-eabihf/firmware/softplug-unit-mps2")
        };
        let firmware = std::env::var_os("SOFTPLUG_FIRMWARE").map_or_else(by_hand, PathBuf::from);
        assert!(firmware.is_file(), "no {}: run `cargo xtask test`", firmware.display());
        let folder = tempfile::tempdir().unwrap();
        let listeners = ["control", "machine"].map(|name| {
            let listener = UnixListener::bind(folder.path().join(name)).unwrap();
            listener.set_nonblocking(true).unwrap();
            listener
        });
        // Whatever becomes of us, no board is left behind.
        let mut command = Command::new("setpriv");
        command.args(["--pdeathsig", "KILL", "qemu-system-arm", "-M", "mps2-an386", "-nodefaults"]);
        command.args(["-display", "none", "-icount", ICOUNT, "-kernel"]).arg(&firmware);
        for name in ["control", "machine"] {
            let path = folder.path().join(name);
            command.args(["-chardev", &format!("socket,id={name},path={}", path.display())]);
        }
        command.args(["-chardev", "socket,id=uplink,host=127.0.0.1,port=0,server=on,wait=off"]);
        command.args(["-serial", "chardev:machine", "-serial", "chardev:uplink"]);
        command.args(["-mon", "chardev=control,mode=control"]);
        let errors = File::create(folder.path().join("stderr")).unwrap();
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors).spawn().unwrap();
        let [control, machine] = listeners.map(|listener| accept(&listener, &mut child, &folder));
        machine.set_nonblocking(true).unwrap();
        let mut board = Self { child, folder, machine, control: BufReader::new(control) };
        board.answer();
        board.ask("qmp_capabilities", &json!({}));
        board.until(|figures| figures.turns > 0);
        board
    }

    /// The port at which its uplink is.
    pub(super) fn uplink(&mut self) -> u16 {
        let devices = self.ask("query-chardev", &json!({}));
        let uplink = devices.as_array().unwrap().iter().find(|one| one["label"] == "uplink");
        let name = uplink.unwrap()["filename"].as_str().unwrap();
        // disconnected:tcp:127.0.0.1:4711,server=on
        let behind = name.split("127.0.0.1:").nth(1).unwrap();
        behind.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
    }

    /// All of RAM stays but what the program initialises; flash stays.
    pub(super) fn lose_power(&mut self) {
        self.ask("system_reset", &json!({}));
    }

    /// Characters from the machine.
    pub(super) fn say(&mut self, bytes: &[u8]) {
        self.machine.set_nonblocking(false).unwrap();
        self.machine.write_all(bytes).unwrap();
        self.machine.set_nonblocking(true).unwrap();
    }

    /// What has come to the machine.
    pub(super) fn heard(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self.machine.read_to_end(&mut bytes) {
            Ok(_) => panic!("the board has ended: {}", self.errors()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => bytes,
            Err(error) => panic!("the line to the machine: {error}"),
        }
    }

    /// So many characters to the machine.
    pub(super) fn hear(&mut self, count: usize) -> Vec<u8> {
        let begin = Instant::now();
        let mut bytes = Vec::new();
        while bytes.len() < count {
            assert!(begin.elapsed() < PATIENCE, "{:?}", String::from_utf8_lossy(&bytes));
            bytes.extend(self.heard());
            sleep(Duration::from_millis(2));
        }
        bytes
    }

    pub(super) fn figures(&mut self) -> Figures {
        let words = words(&self.memory(FIGURES, 64));
        let (limit, start) = (words[3], words[4]);
        let painted = if limit < start { self.memory(limit, start - limit) } else { Vec::new() };
        let unused = self::words(&painted).iter().take_while(|word| **word == PAINT).count();
        let is_there = words[0] == MAGIC;
        Figures {
            static_bytes: words[1],
            heap_bytes: words[2],
            stack_bytes: painted.len() as u32 - 4 * unused as u32,
            turns: if is_there { words[9] } else { 0 },
            worked: u64::from(words[5]) | u64::from(words[6]) << 32,
        }
    }

    pub(super) fn until(&mut self, is_so: impl Fn(&Figures) -> bool) {
        let begin = Instant::now();
        loop {
            let figures = self.figures();
            if is_so(&figures) {
                return;
            }
            assert!(begin.elapsed() < PATIENCE, "{figures:?}; {}", self.errors());
            sleep(Duration::from_millis(20));
        }
    }

    /// The emulated board has more RAM than this; nothing was ever written there.
    pub(super) fn is_untouched_beyond(&mut self, bytes: u32) {
        let beyond = self.memory(RAM + bytes, 0x40_0000 - bytes);
        assert!(beyond.iter().all(|byte| *byte == 0), "RAM beyond {bytes} bytes was written to");
    }

    /// The flash of the slots.
    pub(super) fn slots(&mut self) -> (Vec<u8>, Geometry) {
        (self.memory(SLOTS, SLOTS_GEOMETRY.size), SLOTS_GEOMETRY)
    }

    fn memory(&mut self, at: u32, bytes: u32) -> Vec<u8> {
        let file = self.folder.path().join("memory");
        self.ask("pmemsave", &json!({ "val": at, "size": bytes, "filename": file }));
        fs::read(file).unwrap()
    }

    fn errors(&self) -> String {
        fs::read_to_string(self.folder.path().join("stderr")).unwrap_or_default()
    }

    fn ask(&mut self, command: &str, arguments: &Value) -> Value {
        let line = json!({ "execute": command, "arguments": arguments }).to_string() + "\n";
        self.control.get_mut().write_all(line.as_bytes()).unwrap();
        loop {
            let mut answer = self.answer();
            assert!(answer.get("error").is_none(), "{command}: {answer}");
            if let Some(value) = answer.get_mut("return") {
                return value.take();
            }
        }
    }

    fn answer(&mut self) -> Value {
        let mut line = String::new();
        self.control.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|error| {
            panic!("{error}: {line:?}; {}", self.errors());
        })
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

fn accept(listener: &UnixListener, child: &mut Child, folder: &TempDir) -> UnixStream {
    let begin = Instant::now();
    loop {
        if let Ok((stream, _)) = listener.accept() {
            stream.set_nonblocking(false).unwrap();
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
            stream.set_write_timeout(Some(PATIENCE)).unwrap();
            return stream;
        }
        let errors = || fs::read_to_string(folder.path().join("stderr")).unwrap_or_default();
        assert!(child.try_wait().unwrap().is_none(), "QEMU has ended: {}", errors());
        assert!(begin.elapsed() < PATIENCE, "QEMU does not connect: {}", errors());
        sleep(Duration::from_millis(10));
    }
}
