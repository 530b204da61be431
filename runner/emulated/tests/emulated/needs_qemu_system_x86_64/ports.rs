//! Opening, listing and closing.

use softplug_emulated::Machine;

use super::{Device, link, program};

#[test]
fn both_ports_are_listed_and_a_lasting_name_survives_replugging() {
    let mut machine = Machine::start();
    let before = machine.run("softplug ports").with_code(0).out;
    assert!(before.contains("/dev/ttyS1") && !before.contains("ttyUSB0"), "{before}");
    machine.plug();
    let plugged = machine.run("softplug ports").with_code(0).out;
    let lasting = "/dev/serial/by-path/pci-0000:00:02.0-usb-0:1:1.0-port0";
    let line = plugged.lines().find(|line| line.contains("/dev/ttyUSB0")).expect(&plugged);
    assert!(line.contains("0403:6001") && line.contains(lasting), "{plugged}");
    machine.unplug();
    machine.until("the adapter's end", "[ ! -e /dev/ttyUSB0 ]");
    machine.plug();
    assert_eq!(machine.run("softplug ports").with_code(0).out, plugged);
}

#[test]
fn a_program_reaches_the_other_end_whole() {
    for device in Device::BOTH {
        let mut machine = device.machine();
        let program = program(2_000);
        machine.write("O1.nc", program.as_bytes());
        let link = link(device, "115200 8N1", "xon-xoff");
        let said = machine.run(&format!("softplug send --json {link} O1.nc")).with_code(0).json();
        assert_eq!(said["result"], "done", "{said}");
        assert_eq!(said["sent"], program.len(), "{said}");
        assert_eq!(String::from_utf8_lossy(&device.wire(&machine).take()), program);
    }
}

#[test]
fn a_second_opener_is_refused_with_the_holders_name() {
    for device in Device::BOTH {
        let mut machine = device.machine();
        let link = link(device, "9600 8N1", "xon-xoff");
        let first = machine.spawn(&format!("softplug receive {link} --out first.nc"));
        device.until_set(&mut machine);
        let second = machine.run(&format!("softplug receive {link} --out second.nc")).with_code(6);
        let holder = format!("softplug (process {})", first.id);
        assert!(second.err.contains(&holder), "{second}");
        // A program that locks nothing holds it as well.
        machine.signal(first, "INT");
        machine.wait(first);
        let sleeper = machine.spawn(&format!("sleep 100 < {}", device.path()));
        machine.until_open(sleeper, device.path());
        let third = machine.run(&format!("softplug receive {link} --out third.nc")).with_code(6);
        let holder = format!("sleep (process {})", sleeper.id);
        assert!(third.err.contains(&holder), "{third}");
        machine.signal(sleeper, "KILL");
    }
}

#[test]
fn a_port_has_low_latency_while_it_is_open() {
    for device in Device::BOTH {
        let mut machine = device.machine();
        if device == Device::Usb {
            let timer = "/sys/bus/usb-serial/devices/ttyUSB0/latency_timer";
            machine.run(&format!("echo 16 > {timer}")).with_code(0);
        }
        machine.run(device.has_low_latency()).with_code(1);
        let link = link(device, "9600 8N1", "xon-xoff");
        let open = machine.spawn(&format!("softplug receive {link} --out O1.nc"));
        device.until_set(&mut machine);
        machine.signal(open, "INT");
        machine.wait(open);
        machine.run(device.has_low_latency()).with_code(1);
    }
}

/// A rate that the 16550A does not have, and one that is too much for the adapter: both drivers
/// set 9600 baud instead.
const RATES: [(Device, u32); 2] = [(Device::Uart, 250_000), (Device::Usb, 3_500_000)];

#[test]
fn a_rate_that_the_port_does_not_take_is_an_error() {
    for (device, baud) in RATES {
        let mut machine = device.machine();
        machine.write("O1.nc", program(10).as_bytes());
        let link = link(device, &format!("{baud} 8N1"), "xon-xoff");
        let ran = machine.run(&format!("softplug send --json {link} O1.nc"));
        assert_eq!(String::from_utf8_lossy(&device.wire(&machine).take()), "", "{ran}");
        let said = ran.with_code(6).json();
        let message = said["error"]["message"].as_str().expect("an error has a message");
        assert!(message.contains(&baud.to_string()) && message.contains("9600"), "{said}");
    }
}

#[test]
fn a_rate_beside_the_usual_ones_is_taken_where_the_port_has_it() {
    let mut machine = Device::Usb.machine();
    machine.write("O1.nc", program(10).as_bytes());
    let link = link(Device::Usb, "250000 8N1", "xon-xoff");
    let ran = machine.run(&format!("softplug send --json {link} O1.nc")).with_code(0);
    assert_eq!(ran.err, "");
    assert_eq!(String::from_utf8_lossy(&machine.usb().take()), program(10));
}
