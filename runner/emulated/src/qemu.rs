//! One QEMU: its process, and the sockets that it is connected by.

use std::fs::{self, File};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::HANG;

/// Enough for the command and its files, which live in memory.
const MEMORY_MEGABYTES: &str = "512";

/// What QEMU is connected by: control, console, and the wires of both ports.
const SOCKETS: [&str; 4] = ["qmp", "console", "uart", "usb"];

/// The memory that outlives the computer: 1 MiB.
const FLASH_BYTES: u32 = 1 << 20;

/// A running QEMU. Dropping it ends it, and so does the end of the thread that started it.
pub(crate) struct Qemu {
    child: Child,
    folder: TempDir,
}

impl Qemu {
    /// Starts it in the folder of its images, with the file of its flash. `more` goes to its command line.
    pub(crate) fn start(images: &Path, flash: &Path, more: &[&str]) -> (Self, [UnixStream; 4]) {
        let folder = tempfile::tempdir().unwrap();
        let listeners = SOCKETS.map(|name| {
            let listener = UnixListener::bind(folder.path().join(name)).unwrap();
            listener.set_nonblocking(true).unwrap();
            listener
        });
        // Whatever becomes of us, no guest is left behind.
        let mut command = Command::new("setpriv");
        command.args(["--pdeathsig", "KILL", "qemu-system-x86_64", "-accel", "tcg", "-M", "pc"]);
        command.args(["-m", MEMORY_MEGABYTES, "-display", "none", "-no-reboot", "-nodefaults"]);
        command.args(["-kernel", "kernel", "-initrd", "initrd"]);
        command.args(["-append", "console=ttyS0 quiet panic=1 mitigations=off"]);
        for name in SOCKETS {
            let path = folder.path().join(name);
            command.args(["-chardev", &format!("socket,id={name},path={}", path.display())]);
        }
        command.args(["-mon", "chardev=qmp,mode=control"]);
        command.args(["-device", "isa-serial,chardev=console,iobase=0x3f8,irq=4"]);
        command.args(["-device", "isa-serial,chardev=uart,iobase=0x2f8,irq=3"]);
        command.args(["-device", "qemu-xhci,id=usb-bus"]);
        // Two controllers on one CAN bus.
        command.args(["-object", "can-bus,id=can"]);
        command.args(["-device", "kvaser_pci,canbus=can", "-device", "kvaser_pci,canbus=can"]);
        let flash = flash.display();
        let memory = format!("id=flash,mem-path={flash},size={FLASH_BYTES},share=on");
        command.args(["-object", &format!("memory-backend-file,{memory}")]);
        command.args(["-device", "ivshmem-plain,memdev=flash,master=on"]).args(more);
        let errors = File::create(folder.path().join("stderr")).unwrap();
        command.current_dir(images).stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors);
        let child = command.spawn().expect("setpriv (Debian package util-linux) starts");
        let mut qemu = Self { child, folder };
        let streams = listeners.map(|listener| qemu.accept(&listener));
        (qemu, streams)
    }

    /// What it complained of.
    pub(crate) fn errors(&self) -> String {
        fs::read_to_string(self.folder.path().join("stderr")).unwrap_or_default()
    }

    /// Ends it at once.
    pub(crate) fn kill(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    fn accept(&mut self, listener: &UnixListener) -> UnixStream {
        let begin = Instant::now();
        loop {
            if let Ok((stream, _)) = listener.accept() {
                stream.set_nonblocking(false).unwrap();
                return stream;
            }
            let ended = self.child.try_wait().unwrap();
            assert!(ended.is_none(), "QEMU ended at once ({ended:?}): {}", self.errors());
            assert!(begin.elapsed() < HANG, "QEMU does not connect: {}", self.errors());
            sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.kill();
    }
}
