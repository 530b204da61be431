//! Ports that are closed while something waits in them.

use softplug_emulated::Machine;

use super::{Device, XOFF, link, program};

/// Linux waits up to 30 s for what a UART that is held has not sent.
const WITHOUT_WAITING: u64 = 20;

/// A port that is held closes at once, whatever ends the command.
fn closes(device: Device, flow: &str, signals: &[&str]) {
    let mut machine = device.machine();
    machine.write("O1.nc", program(3_000).as_bytes());
    let link = link(device, "115200 8N1", "xon-xoff");
    let sending = machine.spawn(&format!("softplug send --json --flow {flow} {link} O1.nc"));
    device.wire(&machine).until_count(100);
    device.wire(&machine).say(&[XOFF]);
    machine.run("sleep 1").with_code(0);
    let begin = uptime(&mut machine);
    for signal in signals {
        machine.signal(sending, signal);
    }
    machine.wait(sending).with_code(5);
    // By the guest's clock: its time is its own.
    let seconds = uptime(&mut machine) - begin;
    assert!(seconds < WITHOUT_WAITING, "{device:?} took {seconds} s to close");
}

fn uptime(machine: &mut Machine) -> u64 {
    let uptime = machine.run("cut -d. -f1 /proc/uptime").with_code(0).out;
    uptime.trim().parse().unwrap()
}

#[test]
fn a_uart_that_is_held_closes_at_once() {
    closes(Device::Uart, "device", &["INT"]);
}

#[test]
fn a_uart_that_is_held_closes_at_once_if_it_has_to() {
    closes(Device::Uart, "device", &["INT", "INT"]);
}

#[test]
fn an_adapter_that_is_held_closes_at_once() {
    closes(Device::Usb, "host", &["INT", "INT"]);
}
