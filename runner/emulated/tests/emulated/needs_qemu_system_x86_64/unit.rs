//! A front-end unit that is fed over a CAN bus, with its plug-ins in an MTD device.

use serde_json::Value;
use softplug_emulated::{Machine, Process};

use super::gateway::Gateway;
use super::{XOFF, XON, program};

/// The gateway is at `can0`, the unit at `can1`: two controllers on one bus.
const TWO_CONTROLLERS: &str = "for i in can0 can1; do
    /sbin/ip link set $i type can bitrate 1000000 && /sbin/ip link set $i up || exit
done";
/// One that carries CAN FD.
const VIRTUAL_FD: &str =
    "ip link add vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up";

fn start_unit(machine: &mut Machine, interface: &str) -> Process {
    let configuration = format!(
        "name = \"unit-17\"\ncan = \"{interface}/17\"\nstate = \"unit\"\n\
         [signature]\nunsigned = true\n\
         [[link]]\nname = \"mill\"\nport = \"/dev/ttyS1\"\nline = \"115200 8N1\"\n\
         memory = \"/dev/mtd0\"\nbuffer = \"4KiB\"\n"
    );
    machine.write("unit.toml", configuration.as_bytes());
    let unit = machine.spawn("softplug unit run unit.toml --json");
    machine.until_printed(unit, "ready");
    unit
}

/// What the only unit on the bus says of itself.
fn found(machine: &mut Machine, bus: &str) -> Value {
    let listed = machine.run(&format!("softplug unit list {bus} --json")).with_code(0).json();
    let units = listed["units"].as_array().unwrap();
    assert_eq!(units.len(), 1, "{listed}");
    units[0].clone()
}

/// Another plug-in that does the same: the module with a section more.
fn another(machine: &mut Machine, plugin: &str, into: &str) {
    let mut module = machine.read(&format!("/plugins/{plugin}.wasm"));
    module.extend_from_slice(&[0, 5, 4, b'n', b'o', b't', b'e']);
    machine.write(into, &module);
}

fn sha256(machine: &mut Machine, file: &str) -> String {
    let said = machine.run(&format!("sha256sum {file}")).with_code(0).out;
    said.split_whitespace().next().unwrap().to_owned()
}

/// A control that holds the line now and then.
fn control() -> impl FnMut(&[u8]) -> Vec<u8> + Send + 'static {
    let (mut came, mut is_held) = (0, false);
    move |bytes| {
        came += bytes.len();
        let holds = came % 4_096 < 256;
        let changes = holds != std::mem::replace(&mut is_held, holds);
        match (changes, holds) {
            (true, true) => vec![XOFF, XON],
            _ => Vec::new(),
        }
    }
}

#[test]
fn a_unit_on_a_can_bus_is_flashed_restarted_swapped_and_cut_off() {
    let mut machine = Machine::start();
    machine.run(TWO_CONTROLLERS).with_code(0);
    start_unit(&mut machine, "can1");
    let flash = "softplug unit flash unit://can0/17";
    machine.run(&format!("{flash} /plugins/fanuc-rs232.wasm")).with_code(0);
    machine.run(&format!("{flash}/mill /plugins/xon-xoff.wasm")).with_code(0);
    let first = sha256(&mut machine, "/plugins/xon-xoff.wasm");
    let listed = found(&mut machine, "can0");
    assert_eq!((&listed["address"], &listed["name"]), (&"can0/17".into(), &"unit-17".into()));
    let slot_b = &listed["links"][0]["slots"][1];
    assert_eq!(slot_b["sha256"], *first, "{listed}");

    let mut machine = machine.lose_power();
    machine.run(TWO_CONTROLLERS).with_code(0);
    start_unit(&mut machine, "can1");
    let listed = found(&mut machine, "can0");
    assert_eq!(listed["links"][0]["runs"], *first, "{listed}");

    machine.uart().answer_with(control());
    let gateway = Gateway::with_port(&mut machine, "unit://can0/17", "xon-xoff", "");
    let text = program(15_385);
    let job = gateway.submit(&mut machine, "part.nc", &text);
    another(&mut machine, "xon-xoff", "another.wasm");
    let second = sha256(&mut machine, "another.wasm");
    machine.uart().until_count(2_000);
    for cut in 0..5 {
        let before = machine.uart().seen().len();
        machine.run("ip link set can0 down").with_code(0);
        if cut % 2 == 0 {
            // Longer than a session lives without a word.
            machine.run("sleep 4").with_code(0);
        }
        machine.run("ip link set can0 up").with_code(0);
        // More than the unit had.
        machine.uart().until_count(before + 6_000);
        if cut == 2 {
            let words = "plugin add another.wasm --library state/plugins";
            machine.run(&format!("softplug {words}")).with_code(0);
            let swap = format!("link swap lathe xon-xoff@sha256:{second} --when now");
            gateway.ask(&mut machine, &swap).with_code(0);
        }
    }
    let ended = gateway.ended(&mut machine, job);
    assert_eq!(ended["state"], "done", "{ended}");
    let came = machine.uart().seen();
    assert!(came == text.as_bytes(), "{} of {} bytes, altered", came.len(), text.len());
    gateway.ask(&mut machine, "link show lathe --json").with_code(0);
    machine.signal(gateway.process, "TERM");
    machine.wait(gateway.process).with_code(0);
    let listed = found(&mut machine, "can0");
    assert_eq!(listed["links"][0]["runs"], *second, "{listed}");
}

#[test]
fn frames_of_can_fd_carry_a_program_too() {
    let mut machine = Machine::start();
    machine.run(VIRTUAL_FD).with_code(0);
    start_unit(&mut machine, "vcan0");
    machine.uart().answer_with(control());
    let gateway = Gateway::with_port(&mut machine, "unit://vcan0/17/mill", "xon-xoff", "");
    let text = program(1_000);
    let job = gateway.submit(&mut machine, "part.nc", &text);
    let ended = gateway.ended(&mut machine, job);
    assert_eq!(ended["state"], "done", "{ended}");
    assert!(machine.uart().seen() == text.as_bytes());
}
