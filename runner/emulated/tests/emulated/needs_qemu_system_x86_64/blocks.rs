//! 3964R with a partner that answers at once: no block that was right is refused, and no attempt
//! is spent.

use super::station::{STX, Seen, Station};
use super::{Device, link};

/// Blocks each way, on each port.
const BLOCKS: usize = 300;
const BLOCK_BYTES: usize = 12;

/// An emulated processor is slow: whole seconds instead of 220 ms and 2 s.
const PATIENCE: &str = "--set zvz=10000 --set qvz=10000 --set bwz=30000 --set buffer_wait=30000";

/// Blocks that are all different, with the control characters of the procedure in them.
fn block(number: usize) -> Vec<u8> {
    let [high, low] = (number as u16).to_be_bytes();
    let mut block = vec![high, low, 0x10, 0x03, 0x02, 0x15];
    block.extend((0..BLOCK_BYTES - 6).map(|at| (number + at) as u8));
    block
}

fn blocks() -> Vec<Vec<u8>> {
    (0..BLOCKS).map(block).collect()
}

fn sends_blocks(device: Device) {
    let mut machine = device.machine();
    let (station, seen) = Station::new(Vec::new());
    device.wire(&machine).answer_with(station);
    machine.write("blocks", &blocks().concat());
    let link = link(device, "115200 8N1", "r3964");
    let options = format!("--set split=on --set block_size={BLOCK_BYTES} {PATIENCE}");
    let ran = machine.run(&format!("softplug send --json {link} {options} blocks"));
    let seen = seen.lock().unwrap().clone();
    assert_eq!(seen.wrong, Vec::<String>::new(), "{ran}");
    assert_eq!(seen, Seen { blocks: blocks(), set_ups: BLOCKS, ..Seen::default() }, "{ran}");
    let said = ran.with_code(0).json();
    assert_eq!(said["notes"], serde_json::Value::Null, "{said}");
    assert_eq!(said["bytes"], BLOCKS * BLOCK_BYTES, "{said}");
}

fn receives_blocks(device: Device) {
    let mut machine = device.machine();
    let (station, seen) = Station::new(blocks());
    let link = link(device, "115200 8N1", "r3964");
    let options = format!("--dir came --count {BLOCKS} --json {PATIENCE}");
    machine.run("mkdir came").with_code(0);
    let receiving = machine.spawn(&format!("softplug receive {link} {options}"));
    // The NAK with which the link opens.
    device.wire(&machine).until_count(1);
    device.wire(&machine).answer_with(station);
    device.wire(&machine).say(&[STX]);
    let ran = machine.wait(receiving);
    // What has left the guest by then is soon here.
    machine.run("sleep 1").with_code(0);
    let seen = seen.lock().unwrap().clone();
    assert_eq!(seen, Seen { acknowledged: BLOCKS, ..Seen::default() }, "{ran}");
    ran.with_code(0);
    assert_eq!(machine.read("came/*"), blocks().concat());
}

#[test]
fn a_uart_sends_blocks_to_a_fast_partner() {
    sends_blocks(Device::Uart);
}

#[test]
fn an_adapter_sends_blocks_to_a_fast_partner() {
    sends_blocks(Device::Usb);
}

#[test]
fn a_uart_takes_blocks_of_a_fast_partner() {
    receives_blocks(Device::Uart);
}

#[test]
fn an_adapter_takes_blocks_of_a_fast_partner() {
    receives_blocks(Device::Usb);
}
