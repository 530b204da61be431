//! Rooms, and what may be outstanding.

use crate::common::{Rig, rooms};
use softplug_abi::{Action, DeliveryId, Failure, JobId, MarkId, RequestId, Values};
use softplug_link::RuleBroken;

fn transmit(bytes: &[u8]) -> Action<'_> {
    Action::Transmit { mark: MarkId::NONE, bytes }
}

fn deliver(bytes: &[u8]) -> Action<'_> {
    Action::Deliver { delivery: DeliveryId(1), bytes }
}

const BEGIN: Action<'static> = Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE };

/// How much room events that begin so have given.
fn grown(events: &[String], name: &str) -> u32 {
    let growth = |event: &String| event.strip_prefix(name)?.trim().parse::<u32>().ok();
    events.iter().filter_map(growth).sum()
}

#[test]
fn credit_exceeded() {
    let rig = || {
        let mut rig = Rig::new(rooms(8, 8), 1);
        rig.out.drain_by_hand = true;
        rig
    };
    let eight = [b'x'; 8];
    let over = |asked, room| RuleBroken::TransmitRoom { asked, room };
    rig().does(
        0,
        &[transmit(&eight), Action::TransmitUrgent { mark: MarkId::NONE, bytes: &[b'u'; 16] }],
    );
    assert_eq!(rig().breaks(0, &[transmit(&[b'x'; 9])]), over(9, 8));
    assert_eq!(rig().breaks(0, &[transmit(b"12345"), transmit(b"6789")]), over(4, 3));
    // A dropped byte is room again only when that was told.
    assert_eq!(rig().breaks(0, &[transmit(&eight), Action::Discard, transmit(b"x")]), over(1, 0));

    // A byte that the port took is room only when that was told.
    let mut early = rig();
    early.does(0, &[transmit(&eight)]);
    assert_eq!(grown(&early.events(), "transmit-room"), 0);
    assert_eq!(early.breaks(500, &[transmit(b"x")]), over(1, 0));

    let mut told = rig();
    told.does(0, &[transmit(&eight)]);
    told.until(1_000);
    assert_eq!(grown(&told.events(), "transmit-room"), 2);
    told.does(1_000, &[transmit(b"ab")]);
    told.does(1_100, &[Action::Discard]);
    assert_eq!(told.breaks(1_200, &[transmit(&[b'x'; 9])]), over(9, 8));

    let over = |asked, room| RuleBroken::DeliveryRoom { asked, room };
    assert_eq!(rig().breaks(0, &[BEGIN, deliver(&[b'x'; 9])]), over(9, 8));
    let mut told = rig();
    told.does(0, &[BEGIN, deliver(&eight)]);
    told.out.drain(3);
    told.tick(0);
    assert_eq!(grown(&told.events(), "delivery-room"), 3);
    told.does(10, &[deliver(b"abc")]);
    assert_eq!(told.breaks(20, &[deliver(b"d")]), over(1, 0));
}

#[test]
fn credit_on_draining() {
    // Whatever the capacity, all of it comes back without another event.
    for capacity in [1, 2, 3, 7, 8, 64, 100] {
        let bytes = vec![b'x'; capacity as usize];
        let mut rig = Rig::new(rooms(capacity, 64), 1);
        rig.does(0, &[transmit(&bytes)]);
        rig.until(i64::from(capacity - 1) * 1_000);
        assert_eq!(rig.line.link.waiting(), 0);
        assert_eq!(grown(&rig.events(), "transmit-room"), capacity);

        let mut rig = Rig::new(rooms(64, capacity), 1);
        rig.out.drain_by_hand = true;
        rig.does(0, &[BEGIN, deliver(&bytes)]);
        assert_eq!(rig.events(), Vec::<String>::new());
        let mut back = 0;
        for drained in 1..=capacity {
            rig.out.drain(1);
            rig.tick(0);
            back += grown(&rig.events(), "delivery-room");
            assert!(back <= drained, "{back} of {drained}");
            assert!(drained - back <= capacity / 8, "kept back: {back} of {drained}");
        }
        assert_eq!(back, capacity);
    }
}

#[test]
fn credit_memory() {
    let mut rig = Rig::new(rooms(64, 64), 1);
    rig.out.drain_by_hand = true;
    rig.does(0, &[BEGIN, deliver(b"ab")]);
    assert_eq!(rig.out.open_delivery.as_ref().unwrap().bytes, b"ab");
    rig.does(10, &[deliver(b"cd")]);
    let failure = Some(Failure::NoEndMark);
    rig.does(20, &[Action::DeliveryEnd { delivery: DeliveryId(1), failure, status: 7 }]);

    // The plug-in ends in the middle of the next one.
    let begin = Action::DeliveryBegin { delivery: DeliveryId(2), job: JobId::NONE };
    rig.does(30, &[begin, Action::Deliver { delivery: DeliveryId(2), bytes: b"ef" }]);
    rig.breaks(40, &[Action::Deliver { delivery: DeliveryId(2), bytes: b"gh" }, BEGIN]);

    let kept: Vec<_> =
        rig.out.deliveries().iter().map(|kept| (kept.bytes.clone(), kept.failure)).collect();
    let interrupted = Some(Failure::Interrupted);
    assert_eq!(kept, [(b"abcd".to_vec(), failure), (b"efgh".to_vec(), interrupted)]);
}

#[test]
fn credit_outstanding() {
    let rig = || Rig::new(rooms(200, 64), 1);
    let marked = |count: u32| {
        let mark = |mark| Action::Transmit { mark, bytes: b"x" };
        [Action::Hold].into_iter().chain((1..=count).map(MarkId).map(mark)).collect::<Vec<_>>()
    };
    let mut full = rig();
    full.does(0, &marked(64));
    assert_eq!(
        full.breaks(10, &[Action::Transmit { mark: MarkId(65), bytes: b"" }]),
        RuleBroken::TooManyMarks
    );
    assert_eq!(rig().breaks(0, &marked(65)), RuleBroken::TooManyMarks);
    let mut urgent = rig();
    urgent.does(0, &marked(64));
    let one_more = Action::TransmitUrgent { mark: MarkId(65), bytes: b"u" };
    assert_eq!(urgent.breaks(10, &[one_more]), RuleBroken::TooManyMarks);
    // Dropped marks are no longer outstanding once that was told.
    let mut again = rig();
    again.does(0, &marked(64));
    again.does(10, &[Action::Discard]);
    again.does(20, &marked(64));
    // Nor are those that have left, but `maybe` is not enough.
    again.does(30, &[Action::Release]);
    again.until(65_000);
    again.does(65_000, &marked(64));

    let urgent = |bytes| Action::TransmitUrgent { mark: MarkId::NONE, bytes };
    let pause = Action::Break { micros: 1 };
    rig().does(0, &[urgent(&[b'u'; 16])]);
    rig().does(0, &[urgent(&[b'u'; 15]), pause.clone()]);
    assert_eq!(rig().breaks(0, &[urgent(&[b'u'; 16]), urgent(b"u")]), RuleBroken::UrgentFull);
    assert_eq!(rig().breaks(0, &[urgent(&[b'u'; 16]), pause.clone()]), RuleBroken::UrgentFull);
    assert_eq!(
        rig().breaks(0, &[urgent(&[b'u'; 15]), pause, urgent(b"u")]),
        RuleBroken::UrgentFull
    );
    // What the port has been given no longer waits.
    let mut given = rig();
    given.does(0, &[urgent(&[b'u'; 16])]);
    given.does(500, &[urgent(b"u")]);

    let request = |request| Action::Request { request, kind: 0, fields: Values::new(b"") };
    let four = [
        request(RequestId(1)),
        request(RequestId(2)),
        request(RequestId(3)),
        request(RequestId(4)),
    ];
    let mut asking = rig();
    asking.does(0, &four);
    assert_eq!(asking.breaks(10, &[request(RequestId(5))]), RuleBroken::TooManyRequests);
    let mut asking = rig();
    asking.does(0, &four);
    asking.does(10, &[Action::Withdraw { request: RequestId(2) }, request(RequestId(5))]);
}
