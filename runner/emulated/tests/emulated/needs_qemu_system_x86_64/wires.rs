//! Ports that are stopped by a wire, and lines that are turned around with one. The emulated ports have CTS
//! on all the time: what a wire that goes off does is tried with a device server.

use super::{Device, link, program};

#[test]
fn a_program_leaves_under_rts_cts_while_cts_is_on() {
    for device in Device::BOTH {
        let mut machine = device.machine();
        let program = program(500);
        machine.write("O1.nc", program.as_bytes());
        let link = format!("{} --flow rts-cts", link(device, "115200 8N1", "xon-xoff"));
        let sent = machine.spawn(&format!("softplug send {link} O1.nc"));
        let (path, wire) = (device.path(), device.wire(&machine));
        wire.until_count(1);
        machine.wait(sent);
        assert_eq!(String::from_utf8_lossy(&device.wire(&machine).take()), program);
        let said = machine.run(&format!("softplug doctor {path} --flow rts-cts")).with_code(0).out;
        assert!(said.contains("CTS on") && !said.contains("CTS is off"), "{said}");
    }
}

#[test]
fn a_driver_that_cannot_turn_the_line_around_says_so_and_the_port_is_left_as_it_was() {
    for device in Device::BOTH {
        let mut machine = device.machine();
        let (path, stty) = (device.path(), format!("stty -a < {}", device.path()));
        let before = machine.run(&stty).with_code(0).out;
        let said = machine.run(&format!("softplug doctor {path} --flow rs-485"));
        let text = "this port has no driver that turns an RS-485 line around with RTS; use an adapter \
                    that does so by itself, and take host";
        assert!(said.out.contains(text), "{said}");
        assert_eq!(machine.run(&stty).with_code(0).out, before);
    }
}
