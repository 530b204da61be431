//! Opening, listing and closing.

use softplug_emulated::Machine;

#[test]
fn both_ports_are_listed_and_a_lasting_name_survives_replugging() {
    let mut machine = Machine::start();
    let before = machine.run("softplug ports").with_code(0).out;
    assert!(before.contains("/dev/ttyS1") && !before.contains("ttyUSB0"), "{before}");
    machine.plug();
    let plugged = machine.run("softplug ports").with_code(0).out;
    let lasting = "/dev/serial/by-path/pci-0000:00:02.0-usb-0:1:1.0-port0";
    let line = plugged.lines().find(|line| line.contains("/dev/ttyUSB0")).expect(&plugged);
    assert!(line.contains("0403:6001") && line.contains(lasting), "{plugged}");
    machine.unplug();
    machine.until("the adapter's end", "[ ! -e /dev/ttyUSB0 ]");
    machine.plug();
    assert_eq!(machine.run("softplug ports").with_code(0).out, plugged);
}

/// So many lines of a program.
fn program(lines: u32) -> String {
    (1..=lines).map(|line| format!("N{line:05}G1X1Y2\n")).collect()
}

#[test]
fn a_program_reaches_the_other_end_of_both_ports() {
    let mut machine = Machine::start();
    machine.plug();
    let program = program(500);
    machine.write("O1.nc", program.as_bytes());
    for port in ["ttyS1", "ttyUSB0"] {
        let words = format!(
            "softplug send --json --port /dev/{port} --line '115200 8N1' --plugin \
             /plugins/xon-xoff.wasm O1.nc"
        );
        let sent = machine.run(&words).with_code(0).json();
        assert_eq!(sent["result"], "done", "{sent}");
        assert_eq!(sent["sent"], program.len(), "{sent}");
        let wire = if port == "ttyS1" { machine.uart() } else { machine.usb() };
        assert_eq!(String::from_utf8_lossy(&wire.take()), program);
    }
}
