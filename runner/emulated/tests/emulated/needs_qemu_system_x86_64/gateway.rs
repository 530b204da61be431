//! A gateway in the guest, with one link.

use serde_json::Value;
use softplug_emulated::{Machine, Process, Ran};

use super::Device;

/// The link's name.
pub(super) const LINK: &str = "lathe";

/// A gateway that runs.
pub(super) struct Gateway {
    pub(super) process: Process,
    environment: String,
}

impl Gateway {
    /// Starts one with a link on this port; `more` are further lines of its configuration.
    #[track_caller]
    pub(super) fn start(machine: &mut Machine, device: Device, plugin: &str, more: &str) -> Self {
        let gateway = Self::with_port(machine, device.path(), plugin, more);
        machine.until_open(gateway.process, device.path());
        gateway
    }

    /// Starts one with a link on this port, which may open later.
    #[track_caller]
    pub(super) fn with_port(machine: &mut Machine, port: &str, plugin: &str, more: &str) -> Self {
        let configuration = format!(
            "[http]\nlisten = \"127.0.0.1:8117\"\ntokens = \"tokens.toml\"\n\
             [[link]]\nname = \"{LINK}\"\nport = \"{port}\"\nplugin = \"{plugin}\"\n{more}\n"
        );
        machine.write("gateway.toml", configuration.as_bytes());
        let prepared = machine
            .run(&format!(
                "mkdir -p programs
                 softplug plugin add /plugins/{plugin}.wasm --library state/plugins >/dev/null &&
                 softplug gateway token --name t --role admin --json"
            ))
            .with_code(0)
            .json();
        let (token, sha256) = (&prepared["token"], &prepared["entry"]["sha256"]);
        let tokens = format!("[[token]]\nname = \"t\"\nrole = \"admin\"\nsha256 = {sha256}\n");
        machine.write("tokens.toml", tokens.as_bytes());
        let process = machine.spawn("softplug gateway run gateway.toml --json");
        machine.until_printed(process, "address");
        let environment =
            format!("export SOFTPLUG_GATEWAY=http://127.0.0.1:8117 SOFTPLUG_TOKEN={token}\n");
        Self { process, environment }
    }

    /// What a verb of the command says that speaks with it.
    #[track_caller]
    pub(super) fn ask(&self, machine: &mut Machine, words: &str) -> Ran {
        machine.run(&format!("{}softplug {words}", self.environment))
    }

    /// Gives it a program to send; the job's number.
    #[track_caller]
    pub(super) fn submit(&self, machine: &mut Machine, name: &str, program: &str) -> u64 {
        machine.write(&format!("programs/{name}"), program.as_bytes());
        let words = format!("job submit {LINK} {name} --json");
        let job = self.ask(machine, &words).with_code(0).json();
        job["id"].as_u64().expect("a job has a number")
    }

    /// A job as it is.
    #[track_caller]
    pub(super) fn job(&self, machine: &mut Machine, id: u64) -> Value {
        self.ask(machine, &format!("job show {id} --json")).with_code(0).json()
    }

    /// A job that has ended.
    #[track_caller]
    pub(super) fn ended(&self, machine: &mut Machine, id: u64) -> Value {
        self.ask(machine, &format!("job wait {id} --json"));
        self.job(machine, id)
    }
}

/// What a plug-in is given at once of a program, and what a UART or an adapter may have besides.
const AT_ONCE: usize = 512 + 256;
/// What a plug-in may have taken and not passed on, and what may be on its way.
const IN_THE_PLUG_IN: usize = 1_024 + 256;

/// Holds what a job says of its program against what the other end saw: neither is ever told as
/// left what has not, nor as not left what has.
#[track_caller]
pub(super) fn judge_figures(job: &Value, seen: usize) {
    let figure = |name: &str| job[name].as_u64().unwrap_or_else(|| panic!("no {name}: {job}"));
    let (surely, maybe) = (figure("surely_left") as usize, figure("maybe_left") as usize);
    assert!(surely <= seen && seen <= maybe, "{seen} were seen: {job}");
    assert!(maybe - seen <= AT_ONCE, "{seen} were seen: {job}");
    assert!(seen - surely <= IN_THE_PLUG_IN, "{seen} were seen: {job}");
    let sent = figure("sent") as usize;
    assert!(sent <= seen, "{seen} were seen: {job}");
}
