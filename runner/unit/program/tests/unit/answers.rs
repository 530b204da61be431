//! A unit at a computer that speaks RK512, whose memory is read by a job.

use std::fs;
use std::net::SocketAddr;
use std::time::Instant;

use softplug_host::{Digest, lint};
use softplug_machines::r3964::rk512::{Area, Computer};
use softplug_unit_protocol::ToUnit;
use softplug_unit_slots::{FileDevice, Geometry, Options, Slots, Trust};
use tempfile::TempDir;

use crate::machine::Machine;
use crate::raw_server::RawServer;
use crate::shop::{PATIENCE, RunningUnit, built, start_unit};

pub(crate) struct Shop {
    machine: Machine<Computer>,
    unit: SocketAddr,
    _running: RunningUnit,
    _folder: TempDir,
}

impl Shop {
    /// The unit has the plug-in from its first start on.
    pub(crate) fn new() -> Self {
        let machine = Machine::rk512();
        machine.tell(|_, computer| computer.memory.set(Area::Db(5), vec![7; 100]));
        let folder = tempfile::tempdir().unwrap();
        let text = format!(
            "name = \"unit-1\"\nlisten = \"127.0.0.1:0\"\nstate = \"state\"\n[signature]\nunsigned = true\n\
             [[link]]\nname = \"mill\"\nport = \"{}\"\nline = \"115200 8N1\"\nmemory_size = \"256KiB\"\n\
             settings = {{ layer = \"rk512\" }}\n",
            machine.port
        );
        fs::write(folder.path().join("unit.toml"), text).unwrap();
        install(&folder);
        let (running, unit) = start_unit(&folder, 1);
        Self { machine, unit, _running: running, _folder: folder }
    }

    pub(crate) fn unit(&self) -> SocketAddr {
        self.unit
    }

    /// Ten words of a data block, and the unit has the job.
    pub(crate) fn begin_to_read(server: &mut RawServer) {
        server.ask_until(|heard| heard.iter().any(|message| message.starts_with("Up")));
        let manifest = lint(&built("r3964")).unwrap().manifest;
        let kind = manifest.job_kind("read").unwrap();
        let fields = [("area", "DB"), ("block", "5"), ("offset", "0"), ("count", "10")];
        let fields = manifest.jobs[usize::from(kind)].records(fields).unwrap();
        let (link, job, size, check, fields) = (0, 9, 0, false, &*fields);
        server.say(&ToUnit::Begin { link, job, kind, size, check, fields });
        server.say(&ToUnit::End { link, job, pass: 0, size: 0 });
        server.until(|heard| heard.iter().any(|message| message.starts_with("Credit")));
    }

    /// The computer has answered, and the unit has had time to hear it.
    pub(crate) fn until_it_was_read(&self) {
        let begin = Instant::now();
        while self.machine.tell(|_, computer| computer.served.is_empty()) {
            assert!(begin.elapsed() < PATIENCE, "nobody read it");
        }
    }
}

fn install(folder: &TempDir) {
    fs::create_dir_all(folder.path().join("state")).unwrap();
    let geometry = Geometry { size: 256 << 10, erase: 4_096, granule: 4 };
    let file = FileDevice::open(&folder.path().join("state/mill.slots"), geometry).unwrap();
    let options = Options { trust: Trust::unsigned_too(&[]), attempts: 3, most_erases: 10 };
    let mut slots = Slots::open(file, options).unwrap();
    let module = built("r3964");
    let digest = *Digest::of(&module).as_bytes();
    slots.begin(module.len() as u32, digest, None).unwrap();
    slots.write(0, &module).unwrap();
    slots.finish().unwrap();
    slots.start_trial().unwrap();
}
