//! Plug-ins that fail: started again, left alone, taken back; and links that follow the library.

use std::fs;

use softplug_live::pty::PtyPair;
use softplug_service::view::{LinkState, SwapState};

use crate::gateway::plugins::fragile;
use crate::gateway::shop::{Shop, wait_for};
use crate::gateway::{journal_says, send};

#[test]
fn a_plug_in_that_traps_too_often_is_left_alone_until_somebody_releases_it() {
    let shop = Shop::with(2, "plugin = \"fragile\"\nline = \"921600 8N1\"\n");
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let view = || gateway.link(&link).unwrap();
    for faults in 1..=4 {
        shop.write(0, b"abX");
        wait_for("the fault and the new start", || {
            view().counters.restarts == faults && view().state == LinkState::Idle
        });
        assert_eq!(view().quarantine, None);
    }
    shop.write(0, b"X");
    wait_for("the quarantine", || view().state == LinkState::Quarantined);
    let quarantine = view().quarantine.unwrap();
    assert_eq!(quarantine.faults.len(), 5);
    for fault in &quarantine.faults {
        assert_eq!(
            (fault.event.as_str(), fault.last_words.as_deref()),
            ("received", Some("letter!"))
        );
        let file = fault.trace.clone().unwrap();
        wait_for("the trace", || gateway.download_trace(&link, &file).is_ok());
    }
    // Nothing is read meanwhile, and the other link sees nothing of it.
    assert_eq!(gateway.link(&Shop::name(1)).unwrap().state, LinkState::Idle);
    assert_eq!(gateway.link(&Shop::name(1)).unwrap().counters.restarts, 0);
    wait_for("the journal", || journal_says(gateway, "failed too often"));
    gateway.release(&link).unwrap();
    wait_for("work", || view().state == LinkState::Idle);
    let before = view().counters.bytes_in;
    shop.write(0, b"ab");
    wait_for("bytes", || view().counters.bytes_in >= before + 2);
    assert!(gateway.release(&link).is_err(), "it is not in quarantine");
}

#[test]
fn a_link_that_is_released_before_its_port_is_there_works_when_it_comes() {
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("port");
    let pty = PtyPair::open().unwrap();
    let slave = pty.slave_path().to_owned();
    let lines = "plugin = \"xon-xoff\"\nline = \"921600 8N1\"\n";
    let mut shop = Shop::not_started("", &[(port.to_str().unwrap(), lines)], vec![pty]);
    shop.start_without_ports();
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let view = || gateway.link(&link).unwrap();
    wait_for("a port that is missing", || view().state == LinkState::Down);
    gateway.quarantine(&link).unwrap();
    wait_for("the quarantine", || view().state == LinkState::Quarantined);
    gateway.release(&link).unwrap();
    std::os::unix::fs::symlink(slave, &port).unwrap();
    wait_for("work", || view().state == LinkState::Idle);
    let program = shop.program("P", 100);
    gateway.submit(&link, &send("P")).unwrap();
    assert_eq!(shop.read(0, program.len()), program);
}

#[test]
fn a_link_that_follows_takes_what_is_put_into_the_library_and_goes_back_from_what_fails() {
    let lines = "plugin = \"fragile\"\nline = \"921600 8N1\"\nswap = \"follow\"\n\
                 probation = { span = \"2m\", events = 1000 }\n";
    let shop = Shop::with(1, lines);
    let (gateway, link) = (shop.gateway(), Shop::name(0));
    let version = || gateway.link(&link).unwrap().plugin.unwrap().version;
    let put = |version: &str, traps_at| {
        let written = shop.path(&format!("{version}.wasm"));
        fs::write(&written, fragile(version, traps_at)).unwrap();
        fs::rename(&written, shop.path(&format!("state/plugins/incoming/{version}.wasm"))).unwrap();
    };
    assert_eq!(version(), "1.0.0");
    put("1.1.0", None);
    wait_for("the new version", || version() == "1.1.0");
    // Another that is on probation first: the machine says what it cannot bear.
    put("1.2.0", Some('Y'));
    wait_for("the next version", || version() == "1.2.0");
    shop.write(0, b"abc");
    wait_for("bytes", || gateway.link(&link).unwrap().counters.bytes_in == 3);
    assert_eq!(gateway.link(&link).unwrap().swap.unwrap().state, SwapState::Probation);
    assert_eq!(gateway.link(&link).unwrap().probation.unwrap().returns_to.version, "1.1.0");
    shop.write(0, b"Y");
    wait_for("the return", || version() == "1.1.0");
    let view = gateway.link(&link).unwrap();
    assert_eq!((view.state, view.counters.restarts), (LinkState::Idle, 0), "nobody saw it");
    assert_eq!(view.swap.unwrap().state, SwapState::Reverted);
    wait_for("the journal", || journal_says(gateway, "failed on probation, fragile 1.1.0"));
    // What has failed here is not taken again by itself; what comes after it is.
    gateway.add_plugin(&fragile("1.2.0", Some('Y'))).unwrap();
    put("1.3.0", None);
    wait_for("the last version", || version() == "1.3.0");
    shop.write(0, b"Y");
    wait_for("bytes", || gateway.link(&link).unwrap().counters.bytes_in == 5);
    assert_eq!(gateway.link(&link).unwrap().state, LinkState::Idle);
}
