//! Line input, settings, close.

use crate::common::{Rig, Script, rooms, setting_values};
use crate::{assert_events, assert_given};
use softplug_abi::{
    Action, DeliveryId, EventKind, Failure, JobId, LineErrorKind, LineParameters, LinkDownReason,
    MarkId, RequestId,
};
use softplug_abi::{Micros, ModemLines, Parity, Values};
use softplug_link::{LinkFault, LinkOptions, Observed};

#[test]
fn line_bad_byte() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    let now = Micros(100);
    rig.before(100);
    let (link, out) = (&mut rig.line.link, &mut rig.out);
    link.received(now, b"AB", out).unwrap();
    link.line_error(now, LineErrorKind::Parity, Some(0xC3), 0, out).unwrap();
    link.received(now, b"DE", out).unwrap();
    link.line_error(now, LineErrorKind::Overrun, None, 0, out).unwrap();
    link.line_error(now, LineErrorKind::Break, None, 0, out).unwrap();
    link.received(now, b"F", out).unwrap();
    // The place is not known: one of the last three.
    link.line_error(now, LineErrorKind::ParityOrFraming, None, 3, out).unwrap();
    rig.tick(100);
    assert_given!(
        rig,
        [
            (100, "received \"AB\""),
            (100, "line-error parity byte=c3 span=0"),
            (100, "received \"DE\""),
            (100, "line-error overrun byte=none span=0"),
            (100, "line-error break byte=none span=0"),
            (100, "received \"F\""),
            (100, "line-error parity-or-framing byte=none span=3"),
        ]
    );
}

#[test]
fn line_unaltered() {
    let all: Vec<u8> = (0..=255).collect();
    let line = LineParameters { data_bits: 7, parity: Parity::Even, ..LineParameters::new(9_600) };
    for line in [LineParameters::new(9_600), line, LineParameters::new(0)] {
        let mut rig = Rig::new(LinkOptions { line, ..rooms(256, 256) }, 4);
        rig.does(0, &[Action::Transmit { mark: MarkId::NONE, bytes: &all }]);
        rig.given();
        rig.receive(100, &[&all]).unwrap();
        let received = format!("received \"{}\"", all.escape_ascii());
        assert!(rig.events().contains(&received));
        rig.until(1_000_000);
        let sent: Vec<u8> = rig.wire().into_iter().map(|(_, byte)| byte).collect();
        assert_eq!(sent, all);
    }
}

#[test]
fn line_modem_first() {
    let (cts, dsr) = (ModemLines::CTS, ModemLines::DSR);
    let options = LinkOptions { modem_lines: Some((cts.union(dsr), cts)), ..rooms(64, 64) };
    let script = Script::default();
    // Due at once, and yet after them.
    script.once("open", &[Action::SetTimer { id: 0, deadline: Micros(0) }]);
    let mut rig = Rig::closed(script, options, 1);
    rig.line.link.open(Micros::ZERO, &mut rig.out).unwrap();
    assert_events!(
        rig,
        [
            "settings first=true last=true",
            "open new transmit=64 delivery=64",
            "modem-lines known=3 on=1",
            "timer 0 set for 0",
        ]
    );
    rig.host(10, |link, out| link.modem_lines(Micros(10), cts.union(dsr), dsr, out));
    rig.host(20, |link, out| link.modem_lines(Micros(20), cts.union(dsr), cts, out));
    rig.host(30, |link, out| link.link_down(Micros(30), LinkDownReason::Disconnected, out));
    rig.host(35, |link, out| link.link_down(Micros(35), LinkDownReason::Failed, out));
    rig.host(40, |link, out| link.link_up(Micros(40), out));
    rig.host(45, |link, out| link.link_up(Micros(45), out));
    assert_given!(
        rig,
        [
            (10, "modem-lines known=3 on=2"),
            (20, "modem-lines known=3 on=1"),
            (30, "link-down disconnected"),
            (40, "link-up"),
            (40, "modem-lines known=3 on=1"),
        ]
    );
    // Without modem lines there is no such event.
    let script = Script::default();
    let mut rig = Rig::closed(script, rooms(64, 64), 1);
    rig.line.link.open(Micros::ZERO, &mut rig.out).unwrap();
    assert_events!(rig, ["settings first=true last=true", "open new transmit=64 delivery=64"]);
}

/// Five settings that do not fit one event.
const SETTINGS: &str = r#"
    {"name":"a","type":"text","default":"","max":400,"text":"t"},
    {"name":"b","type":"int","default":1,"text":"t"},
    {"name":"c","type":"int","default":2,"text":"t"},
    {"name":"d","type":"text","default":"","max":400,"text":"t"},
    {"name":"e","type":"bool","default":true,"text":"t"}"#;

#[test]
fn settings_order() {
    let (long, other) = ("x".repeat(400), "y".repeat(400));
    let asked = [("c", "9"), ("a", long.as_str()), ("preset", "other"), ("d", other.as_str())];
    let settings = setting_values(SETTINGS, &asked);
    let mut rig = Rig::closed(
        Script::default(),
        LinkOptions { settings: settings.clone(), ..rooms(64, 64) },
        1,
    );
    rig.line.link.open(Micros::ZERO, &mut rig.out).unwrap();
    // Explicit over preset, preset over default; no record stands across two events.
    assert_events!(
        rig,
        [
            format!("settings first=true last=false 0={long} 1=7 2=9"),
            format!("settings first=false last=true 3={other} 4=true"),
            "open new transmit=64 delivery=64",
        ]
    );

    // Refused: not opened, and nothing more reaches it.
    let script = Script::default();
    script.refuse("settings first=false");
    let mut rig = Rig::closed(script, LinkOptions { settings, ..rooms(64, 64) }, 1);
    let fault = rig.line.link.open(Micros::ZERO, &mut rig.out).unwrap_err();
    assert!(matches!(fault, LinkFault::Instance { event: EventKind::Settings, .. }));
    rig.receive(10, &[b"x"]).unwrap();
    rig.until(20);
    assert_eq!(rig.events().len(), 2);

    // Settings are answered by notes and state names only.
    let script = Script::default();
    script.once("settings", &[Action::State { name: "new" }]);
    Rig::with(script, rooms(64, 64), 1);
    let script = Script::default();
    script.once("settings", &[Action::Hold]);
    let mut rig = Rig::closed(script, rooms(64, 64), 1);
    rig.line.link.open(Micros::ZERO, &mut rig.out).unwrap_err();
    assert_events!(rig, ["settings first=true last=true"]);
}

#[test]
fn close_as_new() {
    let mut rig = Rig::new(rooms(8, 8), 1);
    rig.begin(0, 5, b"data", false);
    rig.does(
        0,
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"ABCD" },
            Action::SetTimer { id: 1, deadline: Micros(9_000) },
            Action::DeliveryBegin { delivery: DeliveryId(2), job: JobId(5) },
            Action::Deliver { delivery: DeliveryId(2), bytes: b"xy" },
            Action::Request { request: RequestId(3), kind: 0, fields: Values::new(b"") },
        ],
    );
    rig.does(
        500,
        &[
            Action::Hold,
            Action::TransmitUrgent { mark: MarkId(4), bytes: b"U" },
            Action::Break { micros: 9 },
        ],
    );
    rig.given();
    rig.script.once(
        "close",
        &[Action::Note { level: softplug_abi::NoteLevel::Info, code: 0, text: "good bye" }],
    );
    rig.host(600, |link, out| link.close(Micros(600), out));
    assert_given!(rig, [(600, "close")]);
    // Its last actions are applied, then what is under way is interrupted.
    let observed: Vec<_> = rig.observed().into_iter().skip(2).collect();
    assert!(matches!(&observed[0], (600, Observed::Note(_, _, text)) if text == "good bye"));
    assert!(matches!(&observed[1], (600, Observed::Delivery(kept))
        if kept.bytes == b"xy" && kept.failure == Some(Failure::Interrupted)));
    assert!(matches!(
        observed[2],
        (600, Observed::Failed { job: JobId(5), failure: Failure::Interrupted, .. })
    ));

    // Closed: nothing reaches it.
    rig.receive(700, &[b"x"]).unwrap();
    assert_given!(rig, []);

    rig.host(2_000, |link, out| link.open(Micros(2_000), out));
    rig.host(2_000, |link, out| link.answer(Micros(2_000), RequestId(3), Ok(b"old"), out));
    // All room is back, nothing is held, no mark and no timer of before comes.
    rig.does(3_000, &[Action::Transmit { mark: MarkId(1), bytes: b"EFGHIJKL" }]);
    rig.until(20_000);
    let given = rig.given();
    assert_eq!(
        given[..2],
        [
            (2_000, "settings first=true last=true".to_owned()),
            (2_000, "open new transmit=8 delivery=8".to_owned()),
        ]
    );
    let rest: Vec<_> = given[2..].iter().filter(|(_, event)| !event.contains("room")).collect();
    assert_eq!(
        rest,
        [&(11_000, "mark 1 maybe-left".to_owned()), &(11_000, "mark 1 surely-left".to_owned()),]
    );
    let wire: Vec<u8> = rig.wire().into_iter().map(|(_, byte)| byte).collect();
    assert_eq!(wire, b"AEFGHIJKL");
    // The ids of before are free.
    rig.does(21_000, &[Action::DeliveryBegin { delivery: DeliveryId(2), job: JobId::NONE }]);
    rig.begin(22_000, 6, b"", false);
    assert_eq!(rig.line.link.job(), Some(JobId(6)));
    // Data that was asked for before is not given now.
    assert_events!(rig, ["job-begin 6 run"]);
}
