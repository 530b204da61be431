//! Whatever comes over the uplink is refused or taken, and never more than that.

use proptest::prelude::*;
use softplug_abi::{MalformedReason, Micros};
use softplug_unit_protocol::{
    Decode, Encode, Frame, FrameError, FrameKind, Identity, LONGEST, Messages, PAYLOAD, Role,
    Session, ToServer, ToUnit, length_of_frame,
};

proptest! {
    #[test]
    fn bytes_are_a_frame_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..80)) {
        let decoded = Frame::decode(&bytes);
        if let Ok(frame) = decoded {
            let mut again = [0; LONGEST];
            let length = frame.encode(&mut again).unwrap();
            prop_assert_eq!(&again[..length], &bytes[..]);
        }
        let _ = length_of_frame(&bytes);
    }

    /// Also where the check is right.
    #[test]
    fn ends_take_any_frame(
        frames in proptest::collection::vec(
            (0_usize..4, 0_u32..4, any::<u32>(), any::<u32>(),
             proptest::collection::vec(any::<u8>(), 0..40)),
            0..30,
        ),
    ) {
        let kinds = [FrameKind::Hello, FrameKind::Welcome, FrameKind::Refuse, FrameKind::Data];
        for role in [Role::Server, Role::Unit] {
            let mut end = Session::<2, 128>::new(role, Identity(1));
            let mut now = Micros::ZERO;
            end.call(now);
            for (kind, session, number, taken, payload) in &frames {
                let (session, number, taken) = (session + 1, number % 4, taken % 4);
                let frame = Frame { kind: kinds[*kind], session, number, taken, payload };
                let mut wire = [0; LONGEST];
                let length = frame.encode(&mut wire).unwrap();
                if let Ok(Some(payload)) = end.receive(now, &wire[..length]) {
                    Messages::<ToUnit>::new(payload).for_each(drop);
                    Messages::<ToServer>::new(payload).for_each(drop);
                }
                end.poll();
                while end.poll_transmit(now, &mut wire).is_some() {}
                now = end.poll_timeout().unwrap_or(now).max(now);
                end.handle_timeout(now);
            }
        }
    }

    #[test]
    fn what_is_read_is_written_the_same(kind in any::<u8>(), body in proptest::collection::vec(any::<u8>(), 0..120)) {
        let mut out = [0; 256];
        if let Ok(message) = ToUnit::decode(kind, &body) {
            let length = message.encode(&mut out).unwrap();
            prop_assert_eq!((out[0], &out[3..length]), (kind, &body[..]));
        }
        if let Ok(message) = ToServer::decode(kind, &body) {
            let length = message.encode(&mut out).unwrap();
            prop_assert_eq!((out[0], &out[3..length]), (kind, &body[..]));
        }
    }
}

#[test]
fn an_unknown_message_ends_the_reading() {
    let mut payload = [0; 64];
    let mut length = ToUnit::Query {}.encode(&mut payload).unwrap();
    payload[length..length + 4].copy_from_slice(&[99, 1, 0, 7]);
    length += 4;
    length += ToUnit::Query {}.encode(&mut payload[length..]).unwrap();
    let read: Vec<_> = Messages::<ToUnit>::new(&payload[..length]).collect();
    assert_eq!(read.len(), 2);
    assert_eq!(read[0], Ok(ToUnit::Query {}));
    let error = read[1].unwrap_err();
    assert_eq!((error.kind, error.at), (99, 3));
    assert_eq!(error.reason, MalformedReason::UnknownKind(99));
}

#[test]
fn a_message_that_is_cut_off_is_no_message() {
    let mut payload = [0; 64];
    let end = ToUnit::End { link: 1, job: 2, pass: 0, size: 3 };
    let length = end.encode(&mut payload).unwrap();
    for cut in 1..length {
        let read: Vec<_> = Messages::<ToUnit>::new(&payload[..cut]).collect();
        assert!(matches!(read[..], [Err(_)]), "{cut}: {read:?}");
    }
}

#[test]
fn every_bit_of_a_frame_counts() {
    let frame =
        Frame { kind: FrameKind::Data, session: 5, number: 6, taken: 7, payload: b"N10 G1" };
    let mut wire = [0; 64];
    let length = frame.encode(&mut wire).unwrap();
    for bit in 0..length * 8 {
        let mut damaged = wire;
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(Frame::decode(&damaged[..length]).is_err(), "bit {bit}");
    }
    for cut in 0..length {
        assert!(Frame::decode(&wire[..cut]).is_err(), "{cut}");
    }
}

#[test]
fn a_payload_has_a_bound() {
    let payload = [0; PAYLOAD + 1];
    let mut wire = [0; LONGEST + 1];
    let long = Frame { kind: FrameKind::Data, session: 1, number: 1, taken: 0, payload: &payload };
    assert!(long.encode(&mut wire).is_err());
    let fits = Frame { payload: &payload[1..], ..long };
    assert_eq!(fits.encode(&mut wire), Ok(LONGEST));
    wire[2..4].copy_from_slice(&1_025_u16.to_le_bytes());
    assert_eq!(length_of_frame(&wire), Err(FrameError::TooLong(1_025)));
}
