//! A COM port of wine's, which is a pty with a simulated machine on it.

use std::os::unix::fs::symlink;

use crate::wine::{Machine, Wine, native, prefix};

/// A machine of this system, as a COM port of Windows.
fn machine(number: u8, words: &str, wine: &Wine) -> Machine {
    let mut command = native();
    command.arg("simulate").args(words.split(' ')).arg("--once").current_dir(wine.path(""));
    let machine = Machine::new(command);
    let devices = prefix().join("dosdevices");
    let link = devices.join(format!("com{number}"));
    let _ = std::fs::remove_file(&link);
    symlink(&machine.port, link).unwrap();
    machine
}

#[test]
fn a_program_is_sent_through_a_com_port() {
    let wine = Wine::new();
    let program = "N1 G01 X10 Y20\n".repeat(300);
    wine.write("O0001.nc", &program);
    let machine = machine(7, "xon-xoff --buffer 512 --expect O0001.nc", &wine);
    let line = "--line 38400~8N1 --plugin xon-xoff";
    wine.run(&format!("send --port COM7 {line} O0001.nc")).with_code(0);
    let machine = machine.end().with_code(0);
    assert!(machine.out.contains("as expected"), "{machine:?}");
}

#[test]
fn a_program_is_received_through_a_com_port() {
    let wine = Wine::new();
    // One block of 3964R; the pty knows no parity.
    let program = "N1 G01 X10 Y20\n".repeat(60);
    wine.write("O0002.nc", &program);
    let machine = machine(8, "r3964 --send O0002.nc", &wine);
    let line = "--line 38400~8N1 --plugin r3964 --wait 30";
    wine.run(&format!("receive --port COM8 {line} --out came.nc")).with_code(0);
    assert_eq!(wine.read("came.nc"), program.as_bytes());
    machine.end().with_code(0);
}

#[test]
fn a_com_port_that_is_not_there_is_not_found() {
    let wine = Wine::new();
    wine.write("O0001.nc", "G1\n");
    let line = "--line 9600~8N1 --plugin xon-xoff";
    let ran = wine.run(&format!("send --port COM77 {line} O0001.nc")).with_code(6);
    assert!(ran.err.contains("there is no COM77"), "{ran:?}");
}
