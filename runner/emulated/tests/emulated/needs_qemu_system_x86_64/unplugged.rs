//! An adapter that is pulled out.

use super::gateway::{Gateway, judge_figures};
use super::{Device, link, program};

#[test]
fn a_job_ends_with_what_may_have_left_and_the_link_comes_back() {
    let mut machine = Device::Usb.machine();
    let more = "line = \"9600 8N1\"";
    let gateway = Gateway::start(&mut machine, Device::Usb, "xon-xoff", more);
    let program = program(3_000);
    let job = gateway.submit(&mut machine, "O1.nc", &program);
    machine.usb().until_count(400);
    machine.unplug();
    let job = gateway.ended(&mut machine, job);
    let seen = machine.usb().take();
    assert_eq!(job["state"], "interrupted", "{job}");
    assert_eq!(job["message"], "the port was lost in the middle of it", "{job}");
    assert!(program.as_bytes().starts_with(&seen));
    judge_figures(&job, seen.len());

    // The name is free for the adapter that comes back, and nothing is sent again unasked.
    machine.plug();
    machine.until_open(gateway.process, "/dev/ttyUSB0");
    machine.run("sleep 1").with_code(0);
    assert_eq!(machine.usb().take(), b"");
    let next = gateway.submit(&mut machine, "O2.nc", "%\nO2\nM30\n%\n");
    let next = gateway.ended(&mut machine, next);
    assert_eq!(next["state"], "done", "{next}");
    assert_eq!(machine.usb().take(), b"%\nO2\nM30\n%\n");
}

#[test]
fn a_sending_ends_with_the_port() {
    let mut machine = Device::Usb.machine();
    let program = program(3_000);
    machine.write("O1.nc", program.as_bytes());
    let link = link(Device::Usb, "9600 8N1", "xon-xoff");
    let sending = machine.spawn(&format!("softplug send --json {link} O1.nc"));
    machine.usb().until_count(400);
    machine.unplug();
    let ran = machine.wait(sending).with_code(6);
    let seen = machine.usb().take();
    let said = ran.json();
    let sent = said["sent"].as_u64().unwrap() as usize;
    assert!(sent <= seen.len(), "{} left: {said}", seen.len());
    assert!(said["may_have_left"].as_u64().unwrap() as usize >= seen.len(), "{said}");
    assert_eq!(said["failure"], "link-down", "{said}");
}
