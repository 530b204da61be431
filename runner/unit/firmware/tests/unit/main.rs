//! The unit on a board in memory: what a server is told, and what the machine gets.

mod shop;

use shop::{Shop, built};
use softplug_unit_firmware::FromMachine;
use softplug_unit_protocol::ToUnit;

fn program(lines: usize) -> Vec<u8> {
    (1..=lines).flat_map(|n| format!("N{n} G1 X{n}\n").into_bytes()).collect()
}

/// A module that does something at an event, in a memory of a page.
fn guest(manifest: &str, step: &str) -> Vec<u8> {
    let manifest = manifest.replace('"', "\\22");
    wat::parse_str(format!(
        "(module (@custom \"softplug.manifest\" \"{manifest}\")
            (memory (export \"memory\") 1 1)
            (data (i32.const 16) \"\\00\\10\\00\\00\\00\\10\\00\\00\\00\\20\\00\\00\\00\\10\\00\\00\\00\\30\\00\\00\\00\\01\\00\\00\")
            (func (export \"softplug_v1\") (result i32) (i32.const 16))
            (func (export \"softplug_v1_step\") (param i32 i32 i64) (result i32) {step}))"
    ))
    .unwrap()
}

const MANIFEST: &str = r#"{"abi":"1.1","name":"guest","version":"1.0.0","licence":"MIT","protocol":"none","description":"For a test."}"#;

#[test]
fn a_job_reaches_the_machine_and_its_end_the_server() {
    let mut shop = Shop::new();
    shop.run(&built("xon-xoff"), b"");
    shop.until("Up");
    let program = program(500);
    shop.begin(7, &program);
    let ended = shop.until("Ended");
    assert!(ended.contains("job: 7, outcome: Done"), "{ended}");
    let size = program.len();
    assert!(ended.contains(&format!("taken: {size}, sent: {size}")), "{ended}");
    assert_eq!(String::from_utf8_lossy(shop.received()), String::from_utf8_lossy(&program));
    // Until it is noted there is no other job.
    shop.say(&ToUnit::Begin { link: 0, job: 8, kind: 0, size: 1, check: false, fields: &[] });
    assert!(shop.until("Refused").contains("another job is there"));
    shop.say(&ToUnit::Noted { link: 0, job: 7 });
    shop.begin(8, b"M30\n");
    shop.until("job: 8, outcome: Done");
}

#[test]
fn a_machine_that_holds_is_told_of_and_waited_for() {
    let mut shop = Shop::new();
    shop.run(&built("xon-xoff"), b"");
    shop.until("Up");
    let program = program(100);
    shop.begin(7, &program);
    shop.rounds(200);
    shop.machine_says(&[0x13]);
    shop.until("is_held: true");
    let so_far = shop.received().len();
    shop.rounds(4_000);
    assert_eq!(shop.received().len(), so_far);
    shop.machine_says(&[0x11]);
    shop.until("is_held: false");
    shop.until("outcome: Done");
    assert_eq!(shop.received(), program);
}

#[test]
fn what_the_machine_sends_comes_to_the_server_in_order() {
    let mut shop = Shop::new();
    shop.run(&built("xon-xoff"), b"");
    shop.until("Up");
    shop.machine_says(b"%\nN1\nM30\n%\n");
    assert!(shop.until("Delivered").contains("at: 0"));
    let ended = shop.until("DeliveryEnded");
    assert!(ended.contains("failure: None") && ended.contains("size: 11"), "{ended}");
    shop.unit.board_mut().from_machine.push_back(FromMachine::Overrun);
    shop.until("line_errors: 1");
}

#[test]
fn data_that_does_not_fit_together_is_refused_and_its_job_aborted() {
    let mut shop = Shop::new();
    shop.run(&built("xon-xoff"), b"");
    shop.until("Up");
    let (link, job) = (0, 7);
    shop.say(&ToUnit::Begin { link, job, kind: 0, size: 9, check: false, fields: &[] });
    shop.until("Credit");
    shop.say(&ToUnit::Data { link, job, pass: 0, at: 3, bytes: b"G1" });
    let refused = shop.until("Refused");
    assert!(refused.contains("data at byte 3"), "{refused}");
    let ended = shop.until("Ended");
    assert!(ended.contains("outcome: Failed") && ended.contains("Aborted"), "{ended}");
}

#[test]
fn after_a_loss_of_power_it_runs_what_it_has() {
    let mut shop = Shop::new();
    shop.run(&built("fanuc-rs232"), b"");
    shop.until("Up");
    shop.lose_power();
    shop.say(&ToUnit::Query {});
    let slot = shop.until("slot: 0");
    assert!(slot.contains("Confirmed") && slot.contains("erased: 1"), "{slot}");
    assert!(shop.until("Link").contains("is_up: true"));
    // Its line has the plug-in's characters at the unit's rate.
    let line = shop.unit.board().line;
    assert_eq!((line.baud, line.data_bits, line.stop_half_bits), (19_200, 7, 4));
}

#[test]
fn a_plug_in_that_does_not_start_gives_way_to_the_one_before() {
    let mut shop = Shop::new();
    shop.run(&built("xon-xoff"), b"");
    shop.until("Up");
    shop.run(&guest(MANIFEST, "unreachable"), b"");
    let refused = shop.until("Refused");
    assert!(refused.contains("trapped on event"), "{refused}");
    // The one before runs again by itself.
    shop.until("Up");
    shop.begin(7, b"M30\n");
    shop.until("outcome: Done");
    shop.say(&ToUnit::Query {});
    let slot = shop.until("slot: 1");
    assert!(slot.contains("Failed"), "{slot}");
}

#[test]
fn a_plug_in_that_uses_more_memory_than_there_is_is_refused() {
    let mut shop = Shop::new();
    let key = |bytes| MANIFEST.replace("\"name\"", &format!("\"memory_bytes\":{bytes},\"name\""));
    shop.run(&guest(&key(40_961), "(i32.const 0)"), b"");
    let refused = shop.until("Refused");
    assert!(refused.contains("uses 40961 bytes of memory; here are 40960"), "{refused}");
    shop.run(&guest(&key(16_384), "(i32.const 0)"), b"");
    shop.until("Up");
    // Above what it says, there is nothing.
    let touches = "(i32.store8 (i32.const 16384) (i32.const 1)) (i32.const 0)";
    shop.run(&guest(&key(16_384), touches), b"");
    assert!(shop.until("Refused").contains("out of bounds memory access"));
}

#[test]
fn settings_are_taken_and_wrong_ones_refused() {
    let mut shop = Shop::new();
    let module = built("xon-xoff");
    shop.run(&module, b"send_line_end\0crlf\0");
    shop.until("Up");
    shop.begin(7, b"M30\n");
    shop.until("outcome: Done");
    assert_eq!(shop.received(), b"M30\r\n");
    shop.say(&ToUnit::Noted { link: 0, job: 7 });
    let digest = <sha2::Sha256 as sha2::Digest>::digest(&module).into();
    shop.say(&ToUnit::Open { link: 0, digest, settings: b"no_such\x001\0" });
    assert!(shop.until("Refused").contains("no_such"));
}

#[test]
fn an_uplink_that_alters_bytes_loses_nothing() {
    let mut shop = Shop::new();
    shop.alter_each = Some(4_999);
    shop.run(&built("xon-xoff"), b"");
    shop.until("Up");
    let program = program(1_000);
    shop.begin(7, &program);
    shop.until("outcome: Done");
    assert_eq!(shop.received(), program);
}
