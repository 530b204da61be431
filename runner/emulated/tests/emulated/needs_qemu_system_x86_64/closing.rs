//! Ports that are closed while something waits in them.

use super::{Device, XOFF, link, program};

/// Linux waits up to 30 s for what a UART that is held has not sent.
const WITHOUT_WAITING: u64 = 20;

#[test]
fn a_port_that_is_held_closes_at_once() {
    for (device, flow) in [(Device::Uart, "device"), (Device::Usb, "host")] {
        let mut machine = device.machine();
        machine.write("O1.nc", program(3_000).as_bytes());
        let link = link(device, "115200 8N1", "xon-xoff");
        let sending = machine.spawn(&format!("softplug send --json --flow {flow} {link} O1.nc"));
        device.wire(&machine).until_count(100);
        device.wire(&machine).say(&[XOFF]);
        machine.run("sleep 1").with_code(0);
        // In the guest's own time, from the second signal, which waits for nothing, to the end.
        let begin = uptime(&mut machine);
        machine.signal(sending, "INT");
        machine.signal(sending, "INT");
        let ran = machine.wait(sending);
        assert_ne!(ran.code, 0, "{ran}");
        let seconds = uptime(&mut machine) - begin;
        assert!(seconds < WITHOUT_WAITING, "{device:?} took {seconds} s to close");
        let ports = machine.run("softplug ports --json").with_code(0).json();
        assert!(!ports.to_string().contains("softplug (process"), "{ports}");
    }
}

fn uptime(machine: &mut softplug_emulated::Machine) -> u64 {
    let uptime = machine.run("cut -d. -f1 /proc/uptime").with_code(0).out;
    uptime.trim().parse().unwrap()
}
