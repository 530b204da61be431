//! What comes first at one instant, and what cutting changes.

use crate::common::{Rig, Script, rooms};
use crate::{assert_events, assert_given};
use softplug_abi::{
    Action, ActionWriter, DeliveryId, Event, Instance, JobId, LineErrorKind, MarkId, Micros,
    ModemLines,
};
use softplug_abi::{NoteLevel, Output};
use softplug_link::{Link, Observed, Recorder, VirtualLine};
use std::convert::Infallible;

#[test]
fn order_instant() {
    let mut rig = Rig::new(rooms(8, 8), 1);
    rig.out.drain_by_hand = true;
    rig.begin(0, 5, b"xy", false);
    rig.does(
        0,
        &[
            Action::Transmit { mark: MarkId(1), bytes: b"A" },
            Action::Transmit { mark: MarkId(2), bytes: b"BC" },
            Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE },
            Action::Deliver { delivery: DeliveryId(1), bytes: b"12345678" },
            Action::SetTimer { id: 3, deadline: Micros(1_000) },
        ],
    );
    rig.before(1_000);
    rig.given();

    // At 1,000 the first byte has left, the timer runs out, the host has put
    // all deliveries away, and the plug-in discards and asks for data.
    let now = Micros(1_000);
    rig.out.drain(8);
    rig.script.once("received \"!\"", &[Action::Discard, Action::Want { job: JobId(5), bytes: 2 }]);
    // Made due by an event, and ahead of others in the order.
    let deadline = Micros(10);
    rig.script.once(
        "timer 3",
        &[Action::SetTimer { id: 4, deadline }, Action::Transmit { mark: MarkId(9), bytes: b"" }],
    );
    let (link, out) = (&mut rig.line.link, &mut rig.out);
    link.line_error(now, LineErrorKind::Parity, Some(0x41), 0, out).unwrap();
    link.received(now, b"!", out).unwrap();
    link.modem_lines(now, ModemLines::CTS, ModemLines::CTS, out).unwrap();
    rig.tick(1_000);
    rig.host(1_000, |link, out| link.pause(now, JobId(5), out));

    assert_given!(
        rig,
        [
            (1_000, "line-error parity byte=41 span=0"),
            (1_000, "modem-lines known=1 on=1"),
            (1_000, "mark 2 dropped"),
            (1_000, "mark 1 maybe-left"),
            (1_000, "mark 1 surely-left"),
            (1_000, "transmit-room 1"),
            (1_000, "discarded 2"),
            (1_000, "timer 3 set for 1000"),
            (1_000, "mark 9 maybe-left"),
            (1_000, "mark 9 surely-left"),
            (1_000, "timer 4 set for 10"),
            (1_000, "delivery-room 8"),
            (1_000, "job-data 5 \"xy\""),
            (1_000, "pause 5"),
        ]
    );
}

#[test]
fn order_transmitter_last() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[Action::Hold, Action::Transmit { mark: MarkId(1), bytes: b"A" }]);
    rig.does(10, &[Action::Transmit { mark: MarkId::NONE, bytes: b"B" }]);
    rig.script.on("received \"Q\"", &[Action::Release]);
    rig.script.on("received \"S\"", &[Action::Hold]);

    // XON and XOFF at one time, in two events.
    rig.receive(100, &[b"Q", b"S"]).unwrap();
    rig.until(150);
    assert_eq!(rig.wire(), []);

    // A report of this instant makes it hold, before the next byte.
    rig.script.on("mark 1 surely-left", &[Action::Hold]);
    rig.receive(200, &[b"Q"]).unwrap();
    rig.until(9_000);
    assert_eq!(rig.wire(), [(200, b'A')]);

    // XOFF at the instant at which the wire comes free.
    rig.does(10_000, &[Action::Release, Action::Transmit { mark: MarkId::NONE, bytes: b"CD" }]);
    rig.receive(11_000, &[b"S"]).unwrap();
    rig.until(20_000);
    assert_eq!(rig.wire(), [(200, b'A'), (10_000, b'B')]);
}

#[test]
fn order_byte_in_time() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.does(0, &[Action::SetTimer { id: 1, deadline: Micros(500) }]);
    rig.receive(500, &[b"x"]).unwrap();
    assert_given!(rig, [(500, "received \"x\""), (500, "timer 1 set for 500")]);

    // So the byte may still stop it.
    rig.does(600, &[Action::SetTimer { id: 1, deadline: Micros(900) }]);
    rig.script.once("received \"y\"", &[Action::CancelTimer { id: 1 }]);
    rig.receive(900, &[b"y"]).unwrap();
    rig.until(2_000);
    assert_given!(rig, [(900, "received \"y\"")]);
}

/// Obeys S and Q, passes everything else on in both directions, and does not
/// care how it is cut.
#[derive(Debug, Default)]
struct Relay {
    output: Vec<u8>,
    room: u32,
    began: bool,
}

impl Instance for Relay {
    type Fault = Infallible;

    fn input_capacity(&self) -> usize {
        512
    }

    fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, Infallible> {
        let mut buffer = vec![0; 16_384];
        let mut writer = ActionWriter::new(&mut buffer);
        let mut put = |action: Action<'_>| writer.push(&action).expect("the buffer is large");
        match event {
            Event::Open { transmit_room, .. } => self.room = *transmit_room,
            Event::TransmitRoom { grown } => self.room += grown,
            Event::Received(bytes) => {
                if !std::mem::replace(&mut self.began, true) {
                    put(Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE });
                }
                for byte in *bytes {
                    match byte {
                        b'S' => put(Action::Hold),
                        b'Q' => put(Action::Release),
                        _ if self.room > 0 => {
                            self.room -= 1;
                            put(Action::Transmit { mark: MarkId::NONE, bytes: &[*byte] });
                            put(Action::Deliver { delivery: DeliveryId(1), bytes: &[*byte] });
                        }
                        _ => put(Action::Note { level: NoteLevel::Error, code: 0, text: "lost" }),
                    }
                }
            }
            Event::Close => {
                put(Action::DeliveryEnd { delivery: DeliveryId(1), failure: None, status: 0 });
            }
            _ => {}
        }
        self.output = writer.written().to_vec();
        Ok(Output { actions: &self.output, more: false })
    }
}

/// All that is seen of a relay whose input is cut into pieces of so many bytes.
fn relayed(most: usize) -> Vec<(Micros, Observed)> {
    let mut out = Recorder::default();
    let mut line = VirtualLine::new(Relay::default(), rooms(64, 4_096), 2);
    line.link.open(Micros::ZERO, &mut out).unwrap();
    let arrivals: [(i64, &[u8]); 4] =
        [(100, b"abcdefSQghiS"), (2_100, b"xQ"), (9_100, b"SQS"), (30_000, b"Qzz")];
    for (at, bytes) in arrivals {
        line.run_until(Micros(at - 1), &mut out).unwrap();
        for piece in bytes.chunks(most) {
            line.link.received(Micros(at), piece, &mut out).unwrap();
        }
        line.transmit(Micros(at), &mut out).unwrap();
    }
    line.run_until(Micros(100_000), &mut out).unwrap();
    line.link.close(Micros(100_000), &mut out).unwrap();
    out.observed
}

#[test]
fn cuts_one_time() {
    let whole = relayed(usize::MAX);
    assert_eq!(whole.iter().filter(|(_, seen)| matches!(seen, Observed::Byte(_))).count(), 12);
    for most in 1..12 {
        assert_eq!(relayed(most), whole, "cut into pieces of {most}");
    }

    // Bytes of two times are two events, each with its own time, whoever is late.
    let script = Script::default();
    let mut out = Recorder::default();
    let mut link = Link::new(script.plugin(), rooms(64, 64));
    link.open(Micros::ZERO, &mut out).unwrap();
    script.take();
    link.received(Micros(10), b"a", &mut out).unwrap();
    link.received(Micros(11), b"b", &mut out).unwrap();
    link.handle_timeout(Micros(11), &mut out).unwrap();
    let expected = [(10, "received \"a\""), (11, "received \"b\"")];
    assert_eq!(script.take(), expected.map(|(at, event)| (at, event.to_owned())));

    // What does not fit one event becomes several of the same time.
    link.received(Micros(20), &[b'a'; 600], &mut out).unwrap();
    let pieces = script.take();
    assert!(pieces.len() > 1 && pieces.iter().all(|(at, _)| *at == 20));
    let bytes: usize = pieces.iter().map(|(_, event)| event.matches('a').count()).sum();
    assert_eq!(bytes, 600);
}

#[test]
fn output_continue_first() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    let timer = Action::SetTimer { id: 1, deadline: Micros(10) };
    rig.script
        .once_more("received \"x\"", &[Action::Transmit { mark: MarkId(1), bytes: b"A" }, timer]);
    rig.script.once_more("continue", &[Action::Transmit { mark: MarkId::NONE, bytes: b"B" }]);
    rig.script.once("continue", &[Action::Hold]);
    rig.receive(100, &[b"x"]).unwrap();
    rig.until(5_000);
    assert_given!(
        rig,
        [
            (100, "received \"x\""),
            (100, "continue"),
            (100, "continue"),
            (100, "timer 1 set for 10"),
        ]
    );
    // Nothing was written to the port before the last round had its say.
    assert_eq!(rig.wire(), []);
    rig.does(6_000, &[Action::Release]);
    rig.until(9_000);
    assert_eq!(rig.wire(), [(6_000, b'A'), (7_000, b'B')]);
}

#[test]
fn output_rounds() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.script.once_more("received \"x\"", &[]);
    for _ in 0..255 {
        rig.script.once_more("continue", &[]);
    }
    rig.script.once("continue", &[Action::Transmit { mark: MarkId::NONE, bytes: b"A" }]);
    rig.receive(10, &[b"x"]).unwrap();
    let continued = rig.events().iter().filter(|event| *event == "continue").count();
    assert_eq!(continued, 256);
    assert_eq!(rig.wire(), [(10, b'A')]);

    rig.script.on_more("received \"y\"", &[]);
    rig.script.on_more("continue", &[]);
    let fault = rig.receive(5_000, &[b"y"]).unwrap_err();
    let text = "the plug-in's answer to the event \"received\" breaks a rule: \
                its output does not end after 256 rounds";
    assert_eq!(fault.to_string(), text);
    let continued = rig.events().iter().filter(|event| *event == "continue").count();
    assert_eq!(continued, 256);
    rig.receive(6_000, &[b"z"]).unwrap_err();
    assert_events!(rig, []);
}
