//! What the machine sends.

use super::{Device, link, program};

#[test]
fn a_program_of_the_machine_arrives_whole() {
    for device in Device::BOTH {
        let mut machine = device.machine();
        let link = link(device, "115200 8N1", "xon-xoff");
        let options = "--set xon_at_open=on --json --out O1.nc";
        let receiving = machine.spawn(&format!("softplug receive {link} {options}"));
        device.wire(&machine).until_count(1);
        let program = program(2_000);
        device.wire(&machine).say(program.as_bytes());
        let said = machine.wait(receiving).with_code(0).json();
        assert_eq!(said["bytes"], program.len(), "{said}");
        assert_eq!(String::from_utf8_lossy(&machine.read("O1.nc")), program);
    }
}
