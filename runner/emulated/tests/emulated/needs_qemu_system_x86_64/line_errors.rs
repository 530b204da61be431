//! Breaks and lost characters on the 16550A.

use softplug_emulated::{Machine, Process, Ran};

use super::{Device, link};

/// Breaks while the processor stands still; the UART has room for sixteen.
const TOO_MANY: usize = 20;

/// What `record` has written of the port's side when `events` have happened to it.
fn recorded(machine: &mut Machine, events: impl FnOnce(&mut Machine)) -> String {
    let recording =
        machine.spawn("softplug record --a pty: --b /dev/ttyS1 --line '9600 8N1' --out t.spt");
    Device::Uart.until_set(machine);
    events(machine);
    machine.signal(recording, "INT");
    machine.wait(recording).with_code(0);
    let trace = machine.run("cat t.spt").with_code(0).out;
    trace.split_once("---\n").expect("a trace has a head").1.to_owned()
}

/// Gives the guest time to take what has come, so that a break stays in its place: QEMU has it
/// pass what still waits.
fn pause(machine: &mut Machine) {
    machine.run("sleep 1").with_code(0);
}

#[test]
fn a_break_is_told_from_a_nul() {
    let mut machine = Machine::start();
    let trace = recorded(&mut machine, |machine| {
        machine.uart().say(b"AB\0CD");
        pause(machine);
        machine.send_break();
        pause(machine);
        machine.uart().say(b"\0EF");
        pause(machine);
    });
    let events: Vec<_> = trace.lines().filter(|line| line.starts_with(['<', '!'])).collect();
    let [first, line_event, last] = &events[..] else { panic!("{trace}") };
    assert!(first.contains(" 41 42 00 43 44 "), "{trace}");
    assert!(line_event.starts_with("! ") && line_event.ends_with(" break"), "{trace}");
    assert!(last.contains(" 00 45 46 "), "{trace}");
}

/// A reception that has begun, with its first line.
fn receiving(machine: &mut Machine) -> Process {
    let link = link(Device::Uart, "9600 8N1", "xon-xoff");
    let options = "--set xon_at_open=on --set quiet_time=5000 --json --out O1.nc";
    let receiving = machine.spawn(&format!("softplug receive {link} {options}"));
    // The XON with which the link opens.
    machine.uart().until_count(1);
    machine.uart().say(b"N1 G0\n");
    pause(machine);
    receiving
}

/// The end of a reception that must not pass for a good one.
fn failed(machine: &mut Machine, receiving: Process, failure: &str) -> Ran {
    machine.uart().say(b"N2 G1\n");
    let ran = machine.wait(receiving).with_code(1);
    assert_eq!(ran.json()["failure"], failure, "{ran}");
    let files = machine.run("ls").with_code(0).out;
    assert!(files.contains("O1.nc.failed\n") && !files.contains("O1.nc\n"), "{files}");
    let came = String::from_utf8_lossy(&machine.read("O1.nc.failed")).into_owned();
    assert!(came.starts_with("N1 G0\n") && came.ends_with("N2 G1\n"), "{came:?}");
    ran
}

#[test]
fn a_break_in_a_reception_fails_it() {
    let mut machine = Machine::start();
    let receiving = receiving(&mut machine);
    machine.send_break();
    pause(&mut machine);
    failed(&mut machine, receiving, "line-error");
}

#[test]
fn lost_characters_fail_a_reception() {
    let mut machine = Machine::start();
    let receiving = receiving(&mut machine);
    machine.stand_still();
    for _ in 0..TOO_MANY {
        machine.send_break();
    }
    machine.go_on();
    pause(&mut machine);
    let ran = failed(&mut machine, receiving, "overrun");
    assert!(ran.err.contains("characters were lost in the port"), "{ran}");
}
