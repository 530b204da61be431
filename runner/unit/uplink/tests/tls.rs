//! Two ends of an uplink with TLS, over loopback, and what passes between them.
#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use softplug_unit_protocol::{Frame, FrameKind, LONGEST, PAYLOAD};
use softplug_unit_uplink::{Closed, TcpUplink, TlsError, TlsKeys, TlsPrivateKey};

const PATIENCE: Duration = Duration::from_mins(1);

fn keys() -> [TlsPrivateKey; 3] {
    let folder = tempfile::tempdir().unwrap();
    ["gateway", "unit", "other"].map(|name| TlsPrivateKey::make(&folder.path().join(name)).unwrap())
}

/// A gateway's end, a unit's end, and what the gateway's sends, as it is on the wire.
fn ends(gateway: &TlsKeys, unit: &TlsKeys) -> (TcpUplink, TcpUplink, Receiver<Vec<u8>>) {
    let [outside, inside] = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    let near = TcpUplink::connect(outside.local_addr().unwrap(), Some(gateway)).unwrap();
    let (from, _) = outside.accept().unwrap();
    let to = TcpStream::connect(inside.local_addr().unwrap()).unwrap();
    let (far, _) = inside.accept().unwrap();
    far.set_nonblocking(true).unwrap();
    let far = TcpUplink::with_tls(mio::net::TcpStream::from_std(far), unit).unwrap();
    let (tell, wire) = channel();
    let back = (to.try_clone().unwrap(), from.try_clone().unwrap());
    thread::spawn(move || pass(from, to, |bytes| drop(tell.send(bytes.to_vec()))));
    thread::spawn(move || pass(back.0, back.1, |_| {}));
    (near, far, wire)
}

fn pass(mut from: TcpStream, mut to: TcpStream, mut tell: impl FnMut(&[u8])) {
    let mut bytes = [0; 4_096];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        tell(&bytes[..count]);
        if to.write_all(&bytes[..count]).is_err() {
            return;
        }
    }
    let _ = to.shutdown(Shutdown::Write);
}

/// Works both ends until this is so.
fn until(mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < PATIENCE, "it never came to that");
        thread::yield_now();
    }
}

fn frame(number: u32, payload: &[u8]) -> Vec<u8> {
    let mut bytes = [0; LONGEST];
    let frame = Frame { kind: FrameKind::Data, session: 1, number, taken: 0, payload };
    let length = frame.encode(&mut bytes).unwrap();
    bytes[..length].to_vec()
}

fn records(wire: &[u8]) -> usize {
    let (mut count, mut rest) = (0, wire);
    while let [_, 3, 3, high, low, after @ ..] = rest {
        count += 1;
        rest = &after[usize::from(u16::from_be_bytes([*high, *low]))..];
    }
    assert!(rest.is_empty());
    count
}

#[test]
fn frames_that_wait_leave_as_one_record() {
    let [gateway, unit, _] = keys();
    let (ours, theirs) = (
        TlsKeys::of_gateway(&gateway, &[unit.public()]),
        TlsKeys::of_unit(&unit, &[gateway.public()]),
    );
    let (mut near, mut far, wire) = ends(&ours, &theirs);
    until(|| {
        near.is_connected().unwrap()
            && near.shake_hands().unwrap() & far.shake_hands().unwrap()
            && near.flush().unwrap()
    });
    assert_eq!((near.peer_key(), far.peer_key()), (Some(unit.public()), Some(gateway.public())));
    let frames: Vec<_> = (1..=50).map(|number| frame(number, b"N10 G1 X1\n")).collect();
    for frame in &frames {
        near.keep(frame);
    }
    assert!(near.flush().unwrap());
    let mut came = Vec::new();
    until(|| {
        while let Some(frame) = far.receive().unwrap() {
            came.push(frame.to_vec());
        }
        came.len() == frames.len()
    });
    assert_eq!(came, frames);
    let passed: Vec<u8> = wire.try_iter().flatten().collect();
    // The last record, which is all but the handshake; behind it nothing.
    let sent: usize = frames.iter().map(Vec::len).sum();
    let last = passed.len() - (sent + 5 + 1 + 16);
    assert_eq!(records(&passed[last..]), 1);
}

#[test]
fn more_than_the_network_takes_waits_and_arrives() {
    let [gateway, unit, other] = keys();
    let (ours, theirs) = (
        TlsKeys::of_gateway(&gateway, &[other.public(), unit.public()]),
        TlsKeys::of_unit(&unit, &[gateway.public(), other.public()]),
    );
    let (mut near, mut far, _wire) = ends(&ours, &theirs);
    let (mut sent, mut came, all) = (0_u32, 0_u32, 20_000_u32);
    until(|| {
        near.flush().unwrap();
        while sent < all && near.has_room() {
            sent += 1;
            near.send(&frame(sent, &[sent as u8; PAYLOAD])).unwrap();
        }
        // The other way there is nothing.
        assert!(near.receive().unwrap().is_none());
        // It is slower.
        for _ in 0..50 {
            let Some(bytes) = far.receive().unwrap() else { break };
            came += 1;
            assert!(bytes == frame(came, &[came as u8; PAYLOAD]));
        }
        came == all
    });
}

#[test]
fn an_end_is_told_as_one_and_nothing_is_lost_before_it() {
    let [gateway, unit, _] = keys();
    let (ours, theirs) = (
        TlsKeys::of_gateway(&gateway, &[unit.public()]),
        TlsKeys::of_unit(&unit, &[gateway.public()]),
    );
    let (mut near, mut far, _wire) = ends(&ours, &theirs);
    let sent = frame(1, b"G1");
    near.send(&sent).unwrap();
    until(|| {
        assert!(near.receive().unwrap().is_none());
        near.flush().unwrap() & far.shake_hands().unwrap()
    });
    drop(near);
    let mut came = Vec::new();
    let mut end = None;
    until(|| {
        match far.receive() {
            Ok(frame) => came.extend(frame.map(<[u8]>::to_vec)),
            Err(closed) => end = Some(closed),
        }
        end.is_some()
    });
    assert!(matches!(end, Some(Closed::ByPeer)), "{end:?}");
    assert_eq!(came, [sent]);
}

#[test]
fn each_end_says_whose_key_it_does_not_know() {
    let [gateway, unit, other] = keys();
    let right = TlsKeys::of_gateway(&gateway, &[unit.public()]);
    // The gateway takes another for the unit: it says which, and the unit learns that it is not known.
    let wrong = TlsKeys::of_gateway(&gateway, &[other.public()]);
    let (mut near, mut far, _wire) = ends(&wrong, &TlsKeys::of_unit(&unit, &[gateway.public()]));
    let (mut said, mut heard) = (None, None);
    until(|| {
        said = said.take().or_else(|| near.shake_hands().err());
        heard = heard.take().or_else(|| far.shake_hands().err());
        said.is_some() && heard.is_some()
    });
    let Some(Closed::Tls(TlsError::OtherKey { got, expected })) = said else { panic!("{said:?}") };
    assert_eq!((got, expected), (unit.public(), other.public().to_string()));
    let Some(Closed::Tls(TlsError::Unknown { own })) = heard else { panic!("{heard:?}") };
    assert_eq!(own, unit.public());
    // The unit does not know the gateway, which takes the handshake for done till it hears of it.
    let (mut near, mut far, _wire) = ends(&right, &TlsKeys::of_unit(&unit, &[other.public()]));
    let (mut said, mut heard) = (None, None);
    until(|| {
        heard = heard.take().or_else(|| near.flush().err()).or_else(|| near.receive().err());
        said = said.take().or_else(|| far.receive().err());
        said.is_some() && heard.is_some()
    });
    let Some(Closed::Tls(TlsError::OtherKey { got, expected })) = said else { panic!("{said:?}") };
    assert_eq!((got, expected), (gateway.public(), other.public().to_string()));
    let Some(Closed::Tls(TlsError::Unknown { own })) = heard else { panic!("{heard:?}") };
    assert_eq!(own, gateway.public());
}

#[test]
fn two_units_or_two_gateways_do_not_meet() {
    let [gateway, unit, _] = keys();
    let ours = TlsKeys::of_gateway(&gateway, &[unit.public()]);
    let (mut near, mut far, _wire) = ends(&ours, &ours);
    let mut end = None;
    until(|| {
        end = end.take().or_else(|| near.shake_hands().err()).or_else(|| far.shake_hands().err());
        end.is_some()
    });
    assert!(matches!(end, Some(Closed::Tls(_))), "{end:?}");
}
