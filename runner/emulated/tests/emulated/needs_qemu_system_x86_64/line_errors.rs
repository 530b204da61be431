//! Breaks and lost characters on the 16550A.

use softplug_emulated::Machine;

use super::{Device, link};

/// Breaks while the processor stands still; the UART has room for sixteen.
const TOO_MANY: usize = 20;

/// What `record` has written of the port's side when `events` have happened to it.
fn recorded(machine: &mut Machine, events: impl FnOnce(&mut Machine)) -> String {
    let recording =
        machine.spawn("softplug record --a pty: --b /dev/ttyS1 --line '9600 8N1' --out t.spt");
    machine.until_open(recording, "/dev/ttyS1");
    // The settings are in force once what comes passes through.
    machine.until("the port's settings", "softplug ports | grep -q record || true");
    events(machine);
    machine.signal(recording, "INT");
    machine.wait(recording).with_code(0);
    machine.run("cat t.spt").with_code(0).out
}

#[test]
fn a_break_is_told_from_a_nul() {
    let mut machine = Machine::start();
    let trace = recorded(&mut machine, |machine| {
        machine.uart().say(b"AB\0CD");
        machine.run("sleep 1");
        machine.send_break();
        machine.run("sleep 1");
        machine.uart().say(b"\0EF");
        machine.run("sleep 1");
    });
    println!("{trace}");
}

#[test]
fn an_overrun_fails_a_reception() {
    let mut machine = Machine::start();
    let link = link(Device::Uart, "9600 8N1", "xon-xoff");
    let receiving = machine.spawn(&format!("softplug receive --json {link} --out O1.nc"));
    machine.until_open(receiving, "/dev/ttyS1");
    machine.run("sleep 2");
    machine.uart().say(b"N1 G0\n");
    machine.run("sleep 1");
    machine.stand_still();
    for _ in 0..TOO_MANY {
        machine.send_break();
    }
    machine.go_on();
    machine.uart().say(b"N2 G1\n");
    let ran = machine.wait(receiving);
    println!("{ran}");
    println!("{}", machine.run("ls -l; cat /proc/tty/driver/serial").out);
}
