//! Transfers over TCP, both ends on Windows.

use crate::wine::{Machine, Wine};

/// More than any buffer between holds.
fn program() -> Vec<u8> {
    (1..=2_000).fold(b"%\nO0001\n".to_vec(), |mut text, n| {
        text.extend(format!("N{n} G01 X{}.{:03} F200\n", n % 100, n % 1_000).bytes());
        text
    })
}

#[test]
fn a_program_is_sent_to_a_machine_that_holds_the_line() {
    let wine = Wine::new();
    wine.write("O0001.nc", program());
    let machine = wine.simulate("xon-xoff --rate 200 --buffer 512 --expect O0001.nc");
    let line = "--line 115200~8N1 --plugin xon-xoff";
    let sent = wine.run(&format!("send --port {} {line} O0001.nc", machine.port));
    let sent = sent.with_code(0);
    assert!(sent.out.contains("held"), "{sent:?}");
    let machine = machine.end().with_code(0);
    assert!(machine.out.contains("as expected"), "{machine:?}");
}

#[test]
fn a_program_of_the_machine_is_received() {
    let wine = Wine::new();
    // One block of 3964R.
    let block = &program()[..1_024];
    wine.write("O0002.nc", block);
    let machine = wine.simulate("r3964 --send O0002.nc");
    let came = wine.run(&format!(
        "receive --port {} --line 115200~8E1 --plugin r3964 --wait 20 --out came.nc",
        machine.port
    ));
    came.with_code(0);
    assert_eq!(wine.read("came.nc"), block);
    machine.end().with_code(0);
}

#[test]
fn what_passes_between_two_ports_is_recorded() {
    let wine = Wine::new();
    wine.write("O0003.nc", &program()[..4_000]);
    let from = wine.simulate("xon-xoff --punch O0003.nc --punch-after 2");
    let to = wine.simulate("xon-xoff --expect O0003.nc --quiet-time 10");
    let record = format!(
        "record --a {} --b {} --line 115200~8N1 --idle 4 --out seen.spt",
        from.port, to.port
    );
    let record = wine.run(&record).with_code(0);
    assert!(wine.path("seen.spt").exists(), "{record:?}");
    let to = to.end();
    assert!(to.out.contains("as expected"), "{to:?} {record:?}");
    drop::<Machine>(from);
}

#[test]
fn nobody_there_is_said_with_the_exit_code_of_ports() {
    let wine = Wine::new();
    wine.write("O0001.nc", "G1\n");
    let line = "--line 9600~8N1 --plugin xon-xoff";
    let ran = wine.run(&format!("send --port tcp://127.0.0.1:9 {line} O0001.nc")).with_code(6);
    assert!(ran.err.contains("no connection to 127.0.0.1:9"), "{ran:?}");
}
