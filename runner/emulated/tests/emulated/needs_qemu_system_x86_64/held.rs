//! A machine that holds the line in mid-transfer, and what is aborted meanwhile.

use softplug_emulated::{Machine, Wire};

use super::gateway::{Gateway, judge_figures};
use super::{Device, XOFF, XON, link, program};

/// Characters after which the machine holds.
const HOLDS_AFTER: usize = 600;
/// Characters that may be under way when it does: of the pacing, and in a UART or an adapter.
const UNDER_WAY: usize = 256;

/// The machine holds after some characters, for good.
fn hold(wire: &Wire) {
    let mut came = 0;
    wire.answer_with(move |bytes: &[u8]| {
        let before = came;
        came += bytes.len();
        if before < HOLDS_AFTER && came >= HOLDS_AFTER { vec![XOFF] } else { Vec::new() }
    });
}

/// What has come, once the machine has held and nothing more comes.
fn settled(machine: &mut Machine, device: Device) -> Vec<u8> {
    device.wire(machine).until_count(HOLDS_AFTER);
    loop {
        let before = device.wire(machine).seen().len();
        machine.run("sleep 1").with_code(0);
        let seen = device.wire(machine).seen();
        if seen.len() == before {
            return seen;
        }
    }
}

/// Nothing of an aborted program may leave once the machine lets go.
fn aborted_in_a_hold(device: Device, flow: &str) {
    let mut machine = device.machine();
    let more = format!("line = \"115200 8N1\"\nflow = \"{flow}\"");
    let gateway = Gateway::start(&mut machine, device, "xon-xoff", &more);
    let program = program(3_000);
    hold(device.wire(&machine));
    let job = gateway.submit(&mut machine, "O1.nc", &program);
    let held = settled(&mut machine, device);
    assert!(held.len() < HOLDS_AFTER + UNDER_WAY, "{} came before it stood still", held.len());

    gateway.ask(&mut machine, &format!("job abort {job}")).with_code(0);
    let job = gateway.ended(&mut machine, job);
    assert_eq!(job["state"], "aborted", "{job}");
    device.wire(&machine).say(&[XON]);
    let seen = settled(&mut machine, device);
    assert!(program.as_bytes().starts_with(&held));
    assert_eq!(
        seen.len(),
        held.len(),
        "this left after the abort: {:?}",
        text(&seen[held.len()..])
    );
    judge_figures(&job, seen.len());
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn nothing_of_an_aborted_program_leaves_a_uart_that_held() {
    aborted_in_a_hold(Device::Uart, "device");
}

#[test]
fn nothing_of_an_aborted_program_leaves_a_uart_that_the_plug_in_held() {
    aborted_in_a_hold(Device::Uart, "host");
}

#[test]
fn nothing_of_an_aborted_program_leaves_an_adapter_that_the_plug_in_held() {
    aborted_in_a_hold(Device::Usb, "host");
}

/// What `send` says has been sent is what the machine got.
fn send_says(device: Device, flow: &str) {
    let mut machine = device.machine();
    let program = program(3_000);
    machine.write("O1.nc", program.as_bytes());
    let link = link(device, "115200 8N1", "xon-xoff");
    hold(device.wire(&machine));
    let sending = machine.spawn(&format!("softplug send --json --flow {flow} {link} O1.nc"));
    let held = settled(&mut machine, device);
    machine.signal(sending, "INT");
    let ran = machine.wait(sending).with_code(5);
    let seen = settled(&mut machine, device);
    assert_eq!(text(&seen[held.len()..]), "");
    let said = ran.json();
    let sent = said["sent"].as_u64().unwrap() as usize;
    assert!(sent <= seen.len() && seen.len() - sent < UNDER_WAY, "{} left: {said}", seen.len());
    let maybe = said["may_have_left"].as_u64().unwrap() as usize;
    assert!((seen.len()..seen.len() + UNDER_WAY).contains(&maybe), "{} left: {said}", seen.len());
    let message = said["message"].as_str().unwrap();
    assert!(message.starts_with("aborted after "), "{said}");
}

#[test]
fn send_counts_what_left_a_uart_that_held() {
    send_says(Device::Uart, "device");
}

#[test]
fn send_counts_what_left_an_adapter() {
    send_says(Device::Usb, "host");
}

#[test]
fn a_hold_of_the_uart_ends_and_the_program_arrives_whole() {
    let mut machine = Machine::start();
    let program = program(1_000);
    machine.write("O1.nc", program.as_bytes());
    let link = link(Device::Uart, "115200 8N1", "xon-xoff");
    hold(machine.uart());
    let sending = machine.spawn(&format!("softplug send --json --flow device {link} O1.nc"));
    let held = settled(&mut machine, Device::Uart);
    assert!(held.len() < HOLDS_AFTER + UNDER_WAY, "{} came before it stood still", held.len());
    machine.uart().say(&[XON]);
    let said = machine.wait(sending).with_code(0).json();
    assert_eq!(said["sent"], program.len(), "{said}");
    assert_eq!(text(&machine.uart().seen()), program);
}
