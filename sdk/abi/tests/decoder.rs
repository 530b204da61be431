//! The decoders take any bytes: typed errors, no panics, one encoding for each
//! meaning. The writers keep what they wrote.

use crate::common::golden;
use proptest::prelude::*;
use softplug_abi::MalformedReason::{NotUtf8, OutOfRange, TrailingBytes, Truncated, UnknownKind};
use softplug_abi::{
    Action, ActionWriter, Actions, DeliveryId, Event, EventKind, Malformed, MalformedReason,
    MarkId, Micros, NoSpace, Value, ValueWriter, Values, limits,
};

fn kinds() -> impl Strategy<Value = EventKind> {
    proptest::sample::select(EventKind::ALL)
}

fn bytes(longest: usize) -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec(any::<u8>(), 0..=longest)
}

/// Bytes that are often nearly right: a golden record with some bytes changed.
fn mutated(file: &'static str) -> impl Strategy<Value = (u16, Vec<u8>)> {
    let count = golden(file).len();
    let change = (any::<proptest::sample::Index>(), any::<u8>());
    (0..count, proptest::collection::vec(change, 0..4)).prop_map(move |(at, changes)| {
        let line = golden(file).swap_remove(at);
        let mut bytes = line.bytes;
        for (index, value) in changes {
            if !bytes.is_empty() {
                let place = index.index(bytes.len());
                bytes[place] = value;
            }
        }
        (line.kind, bytes)
    })
}

fn encoded(event: &Event<'_>) -> Vec<u8> {
    let mut buffer = vec![0; 70_000];
    let length = event.encode(&mut buffer).expect("the buffer is large enough");
    buffer.truncate(length);
    buffer
}

/// Each record written alone, so that neighbours stay apart.
fn written(actions: &[Action<'_>]) -> Vec<u8> {
    let mut all = Vec::new();
    for action in actions {
        let mut buffer = vec![0; 70_000];
        let mut writer = ActionWriter::new(&mut buffer);
        writer.push(action).expect("the buffer is large enough");
        all.extend_from_slice(writer.written());
    }
    all
}

fn accepted(bytes: &[u8]) -> Vec<Action<'_>> {
    Actions::new(bytes).map_while(Result::ok).collect()
}

proptest! {
    #[test]
    fn any_event_is_refused_or_its_only_encoding(kind in kinds(), bytes in bytes(80)) {
        if let Ok(event) = Event::decode(kind, &bytes) {
            prop_assert_eq!(event.kind(), kind);
            prop_assert_eq!(encoded(&event), bytes);
        }
    }

    #[test]
    fn a_damaged_event_is_refused_or_its_only_encoding((kind, bytes) in mutated("events.txt")) {
        let kind = EventKind::from_code(kind).expect("the golden kinds exist");
        if let Ok(event) = Event::decode(kind, &bytes) {
            prop_assert_eq!(encoded(&event), bytes);
        }
    }

    #[test]
    fn any_actions_are_refused_or_their_only_encoding(bytes in bytes(200)) {
        let actions = accepted(&bytes);
        let again = written(&actions);
        prop_assert_eq!(&again[..], &bytes[..again.len()]);
    }

    #[test]
    fn damaged_actions_are_refused_or_their_only_encoding(
        records in proptest::collection::vec(mutated("actions.txt"), 1..6),
    ) {
        let bytes: Vec<u8> = records.into_iter().flat_map(|(_, bytes)| bytes).collect();
        let again = written(&accepted(&bytes));
        prop_assert_eq!(&again[..], &bytes[..again.len()]);
    }

    #[test]
    fn reading_ends_at_the_first_malformed_record(bytes in bytes(200)) {
        let items: Vec<_> = Actions::new(&bytes).collect();
        let failed = items.iter().position(Result::is_err);
        prop_assert!(failed.is_none_or(|at| at + 1 == items.len()));
        if let Some(Err(Malformed { at, .. })) = items.last() {
            prop_assert_eq!(*at, written(&accepted(&bytes)).len());
        }
    }

    #[test]
    fn any_values_are_refused_or_their_only_encoding(bytes in bytes(120)) {
        let mut buffer = [0; 256];
        let mut writer = ValueWriter::new(&mut buffer);
        for (index, value) in Values::new(&bytes).map_while(Result::ok) {
            writer.push(index, value).expect("the buffer is large enough");
        }
        prop_assert_eq!(writer.written(), &bytes[..writer.written().len()]);
    }

    /// Rule `abi.left.coalesced`: how a plug-in cuts what it says makes no difference.
    #[test]
    fn left_coalesced(
        data in bytes(300),
        cuts in proptest::collection::vec(0_usize..300, 0..20),
        delivered in any::<bool>(),
    ) {
        let action = |bytes| if delivered {
            Action::Deliver { delivery: DeliveryId(3), bytes }
        } else {
            Action::Transmit { mark: MarkId::NONE, bytes }
        };
        let (mut whole, mut cut) = ([0; 400], [0; 400]);
        let mut writer = ActionWriter::new(&mut whole);
        writer.push(&action(&data)).expect("the buffer is large enough");
        let expected = writer.written().to_vec();

        let mut cuts: Vec<_> = cuts.into_iter().filter(|cut| *cut <= data.len()).collect();
        cuts.extend([0, data.len()]);
        cuts.sort_unstable();
        let mut writer = ActionWriter::new(&mut cut);
        for piece in cuts.windows(2) {
            writer.push(&action(&data[piece[0]..piece[1]])).expect("the buffer is large enough");
        }
        prop_assert_eq!(writer.written(), expected);
    }

    #[test]
    fn no_space_leaves_earlier_records_whole(
        capacity in 0_usize..120,
        lines in proptest::collection::vec(0_usize..33, 1..20),
    ) {
        let file = golden("actions.txt");
        let mut buffer = vec![0; capacity];
        let mut writer = ActionWriter::new(&mut buffer);
        let mut kept = Vec::new();
        for line in lines {
            let action = Actions::new(&file[line].bytes).next();
            let action = action.expect("there is a record").expect("golden records decode");
            match writer.push(&action) {
                Ok(()) => kept.push(action),
                Err(NoSpace) => prop_assert!(writer.room() < file[line].bytes.len()),
            }
            let read: Result<Vec<_>, _> = Actions::new(writer.written()).collect();
            prop_assert_eq!(joined(&read.expect("what is written decodes")), joined(&kept));
        }
    }
}

/// What a host would see of the actions, however they are cut into records.
fn joined(actions: &[Action<'_>]) -> Vec<(String, Vec<u8>)> {
    let mut all: Vec<(String, Vec<u8>)> = Vec::new();
    for action in actions {
        let (what, bytes) = match action {
            Action::Transmit { mark: MarkId::NONE, bytes } => {
                ("transmit".to_string(), bytes.to_vec())
            }
            Action::Deliver { delivery, bytes } => (format!("deliver {delivery}"), bytes.to_vec()),
            other => (format!("{other:?}"), Vec::new()),
        };
        match all.last_mut() {
            Some((last, joined)) if *last == what && !bytes.is_empty() => joined.extend(bytes),
            _ => all.push((what, bytes)),
        }
    }
    all
}

#[test]
fn neighbours_stay_apart_where_it_matters() {
    let cases: [&[Action<'_>]; 5] = [
        &[
            Action::Transmit { mark: MarkId(7), bytes: b"a" },
            Action::Transmit { mark: MarkId::NONE, bytes: b"b" },
        ],
        &[
            Action::Transmit { mark: MarkId::NONE, bytes: b"a" },
            Action::Transmit { mark: MarkId(7), bytes: b"b" },
        ],
        &[
            Action::Transmit { mark: MarkId::NONE, bytes: b"a" },
            Action::Hold,
            Action::Transmit { mark: MarkId::NONE, bytes: b"b" },
        ],
        &[
            Action::Deliver { delivery: DeliveryId(1), bytes: b"a" },
            Action::Deliver { delivery: DeliveryId(2), bytes: b"b" },
        ],
        &[
            Action::TransmitUrgent { mark: MarkId::NONE, bytes: b"a" },
            Action::TransmitUrgent { mark: MarkId::NONE, bytes: b"b" },
        ],
    ];
    for actions in cases {
        let mut buffer = [0; 64];
        let mut writer = ActionWriter::new(&mut buffer);
        for action in actions {
            writer.push(action).expect("the buffer is large enough");
        }
        assert_eq!(accepted(writer.written()), actions);
    }
}

#[test]
fn a_record_ends_at_its_greatest_length() {
    let mut buffer = vec![0; 140_000];
    let mut writer = ActionWriter::new(&mut buffer);
    let most = vec![b'x'; limits::RECORD_BYTES - 4];
    let too_many = vec![b'x'; limits::RECORD_BYTES - 3];
    assert_eq!(
        writer.push(&Action::Transmit { mark: MarkId::NONE, bytes: &too_many }),
        Err(NoSpace)
    );
    assert!(writer.is_empty());
    assert_eq!(writer.push(&Action::Transmit { mark: MarkId::NONE, bytes: &most }), Ok(()));
    assert_eq!(writer.push(&Action::Transmit { mark: MarkId::NONE, bytes: b"y" }), Ok(()));
    let expected = [
        Action::Transmit { mark: MarkId::NONE, bytes: &most },
        Action::Transmit { mark: MarkId::NONE, bytes: b"y" },
    ];
    assert_eq!(accepted(writer.written()), expected);
}

#[test]
fn truncated_actions_are_errors() {
    for line in golden("actions.txt") {
        for length in 1..line.bytes.len() {
            let error = Actions::new(&line.bytes[..length]).next().expect("there is a record");
            assert_eq!(
                error,
                Err(Malformed { at: 0, reason: Truncated }),
                "{} {length}",
                line.name
            );
        }
    }
}

/// Payloads that end with bytes or text of any length can be cut there.
const OPEN_ENDED: [EventKind; 6] = [
    EventKind::Settings,
    EventKind::Received,
    EventKind::JobBegin,
    EventKind::JobData,
    EventKind::Answer,
    EventKind::Restore,
];

#[test]
fn events_of_another_length_are_errors() {
    for line in golden("events.txt") {
        let kind = EventKind::from_code(line.kind).expect("the golden kinds exist");
        if OPEN_ENDED.contains(&kind) {
            continue;
        }
        for length in 0..line.bytes.len() {
            let cut = Event::decode(kind, &line.bytes[..length]);
            assert_eq!(cut, Err(Truncated), "{} {length}", line.name);
        }
        let longer = [&line.bytes[..], &[0]].concat();
        assert_eq!(Event::decode(kind, &longer), Err(TrailingBytes), "{}", line.name);
    }
}

#[test]
fn open_ended_events_need_their_fixed_part() {
    let fixed = [1, 1, 16, 5, 8, 12];
    for (kind, fixed) in OPEN_ENDED.into_iter().zip(fixed) {
        for line in golden("events.txt").iter().filter(|line| line.kind == kind.code()) {
            for length in 0..fixed.min(line.bytes.len()) {
                let cut = Event::decode(kind, &line.bytes[..length]);
                assert_eq!(cut, Err(Truncated), "{} {length}", line.name);
            }
        }
    }
}

#[test]
fn values_of_settings_cut_short_are_errors() {
    let line = golden("events.txt").swap_remove(0);
    let records = &line.bytes[1..];
    let mut ends = vec![0];
    let mut at = 0;
    while at < records.len() {
        at += 6 + usize::from(u16::from_le_bytes([records[at + 4], records[at + 5]]));
        ends.push(at);
    }
    for length in 0..=records.len() {
        let whole = Values::new(&records[..length]).all(|value| value.is_ok());
        assert_eq!(whole, ends.contains(&length), "{length}");
    }
}

#[test]
fn malformed_events_say_why() {
    use EventKind::{
        Answer, JobBegin, JobData, JobEnd, LineError, LinkDown, Mark, ModemLines, Open, Received,
        Restore, Settings, Timer,
    };
    let cases: &[(EventKind, &[u8], MalformedReason)] = &[
        (Settings, &[4], OutOfRange("flags")),
        (Open, &[2, 8, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("flags")),
        (Open, &[0, 4, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("line")),
        (Open, &[0, 9, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("line")),
        (Open, &[0, 8, 5, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("parity")),
        (Open, &[0, 8, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("line")),
        (Open, &[0, 8, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("line")),
        (Received, &[], Truncated),
        (LineError, &[0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("kind")),
        (LineError, &[6, 0, 0, 0, 0, 0, 0, 0], OutOfRange("kind")),
        (LineError, &[1, 2, 0, 0, 0, 0, 0, 0], OutOfRange("flags")),
        (LineError, &[1, 0, 1, 0, 0, 0, 0, 0], OutOfRange("byte")),
        (LineError, &[1, 1, 1, 1, 0, 0, 0, 0], OutOfRange("zero")),
        (ModemLines, &[64, 0], OutOfRange("lines")),
        (ModemLines, &[1, 2], OutOfRange("lines")),
        (LinkDown, &[0], OutOfRange("reason")),
        (LinkDown, &[4], OutOfRange("reason")),
        (Timer, &[16, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("timer")),
        (Mark, &[0, 0, 0, 0, 1], OutOfRange("mark")),
        (Mark, &[1, 0, 0, 0, 0], OutOfRange("state")),
        (Mark, &[1, 0, 0, 0, 4], OutOfRange("state")),
        (JobBegin, &[0; 16], OutOfRange("job")),
        (JobBegin, &[1, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("flags")),
        (JobBegin, &[1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0], OutOfRange("size")),
        (JobData, &[1, 0, 0, 0], Truncated),
        (JobData, &[0, 0, 0, 0, 1], OutOfRange("job")),
        (JobEnd, &[0, 0, 0, 0], OutOfRange("job")),
        (EventKind::Pause, &[0, 0, 0, 0], OutOfRange("job")),
        (EventKind::Resume, &[0, 0, 0, 0], OutOfRange("job")),
        (Answer, &[0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("request")),
        (Answer, &[1, 0, 0, 0, 29, 0, 0, 0], OutOfRange("refused")),
        (Answer, &[1, 0, 0, 0, 0, 0, 2, 0], OutOfRange("flags")),
        (Answer, &[1, 0, 0, 0, 0, 0, 0, 1], OutOfRange("zero")),
        (Restore, &[0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("zero")),
        (Restore, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0], OutOfRange("total")),
        (Restore, &[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0], OutOfRange("total")),
        (Restore, &[0, 0, 0, 0, 255, 255, 255, 255, 1, 0, 0, 0, 9], OutOfRange("total")),
    ];
    for (kind, payload, reason) in cases {
        assert_eq!(Event::decode(*kind, payload), Err(*reason), "{kind} {payload:?}");
    }
}

fn first_reason(kind: u16, payload: &[u8]) -> MalformedReason {
    let length = u16::try_from(payload.len()).expect("the payload is short");
    let record = [&kind.to_le_bytes()[..], &length.to_le_bytes(), payload].concat();
    let first = Actions::new(&record).next().expect("there is a record");
    first.expect_err("the record is malformed").reason
}

#[test]
fn malformed_actions_say_why() {
    let long_name = [&[1, 0, 0, 0][..], &[b'n'; limits::DELIVERY_NAME_BYTES + 1]].concat();
    let long_note = [&[1, 0, 0, 0][..], &[b'n'; limits::NOTE_BYTES + 1]].concat();
    let cases: &[(u16, &[u8], MalformedReason)] = &[
        (0, &[], UnknownKind(0)),
        (23, &[], UnknownKind(23)),
        (u16::MAX, &[], UnknownKind(u16::MAX)),
        (1, &[0, 0, 0, 0], Truncated),
        (1, &[0, 0, 0], Truncated),
        (2, &[1, 0, 0, 0], OutOfRange("bytes")),
        (2, &[0; 4 + limits::URGENT_BYTES + 1], OutOfRange("bytes")),
        (3, &[0], TrailingBytes),
        (4, &[0], TrailingBytes),
        (5, &[0], TrailingBytes),
        (6, &[16, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("timer")),
        (7, &[16], OutOfRange("timer")),
        (7, &[0, 0], TrailingBytes),
        (8, &[1, 0], OutOfRange("mask")),
        (8, &[16, 32], OutOfRange("mask")),
        (9, &[0, 0, 0, 0], OutOfRange("micros")),
        (9, &10_000_001_u32.to_le_bytes(), OutOfRange("micros")),
        (10, &[0, 0, 0, 0, 1, 0, 0, 0], OutOfRange("job")),
        (10, &[1, 0, 0, 0, 0, 0, 0, 0], OutOfRange("bytes")),
        (11, &[0, 0, 0, 0, 1, 0, 0, 0], OutOfRange("delivery")),
        (12, &[0, 0, 0, 0, 1], OutOfRange("delivery")),
        (12, &[1, 0, 0, 0], Truncated),
        (13, &[1, 0, 0, 0, 0xff], NotUtf8("name")),
        (13, &long_name, OutOfRange("name")),
        (14, &[1, 0, 0, 0, 29, 0, 0, 0], OutOfRange("failure")),
        (15, &[0; 12], OutOfRange("job")),
        (16, &[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("failure")),
        (17, &[0; 16], OutOfRange("job")),
        (18, &[0; 6], OutOfRange("request")),
        (19, &[0; 4], OutOfRange("request")),
        (20, &[0, 0, 0, 0], OutOfRange("level")),
        (20, &[5, 0, 0, 0], OutOfRange("level")),
        (20, &[1, 1, 0, 0], OutOfRange("zero")),
        (20, &[1, 0, 0, 0, 0xc3], NotUtf8("text")),
        (20, &long_note, OutOfRange("text")),
        (21, &[b'n'; limits::STATE_NAME_BYTES + 1], OutOfRange("name")),
        (21, &[0x80], NotUtf8("name")),
        (22, &[0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0], OutOfRange("zero")),
        (22, &[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9], OutOfRange("total")),
        (22, &[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0], OutOfRange("total")),
    ];
    for (kind, payload, reason) in cases {
        assert_eq!(first_reason(*kind, payload), *reason, "{kind} {payload:?}");
    }
}

#[test]
fn malformed_records_say_where() {
    let bytes = [&[3, 0, 0, 0][..], &[4, 0, 0, 0], &[99, 0, 0, 0], &[5, 0, 0, 0]].concat();
    let items: Vec<_> = Actions::new(&bytes).collect();
    let error = Malformed { at: 8, reason: UnknownKind(99) };
    assert_eq!(items, [Ok(Action::Hold), Ok(Action::Release), Err(error)]);
    assert_eq!(error.to_string(), "malformed record at byte 8: kind 99 does not exist");
}

#[test]
fn malformed_values_say_why() {
    let cases: &[(&[u8], MalformedReason)] = &[
        (&[0], Truncated),
        (&[0, 0, 1, 0, 1, 0], Truncated),
        (&[0, 0, 1, 1, 1, 0, 0], OutOfRange("zero")),
        (&[0, 0, 0, 0, 0, 0], OutOfRange("type")),
        (&[0, 0, 6, 0, 0, 0], OutOfRange("type")),
        (&[0, 0, 1, 0, 1, 0, 2], OutOfRange("bool")),
        (&[0, 0, 1, 0, 2, 0, 1, 0], TrailingBytes),
        (&[0, 0, 2, 0, 4, 0, 1, 0, 0, 0], Truncated),
        (&[0, 0, 3, 0, 1, 0, 0xff], NotUtf8("text")),
        (&[0, 0, 4, 0, 0x91, 1], OutOfRange("length")),
        (&[0, 0, 5, 0, 1, 0, 0], Truncated),
    ];
    for (bytes, reason) in cases {
        let items: Vec<_> = Values::new(bytes).collect();
        assert_eq!(items, [Err(Malformed { at: 0, reason: *reason })], "{bytes:?}");
    }
}

#[test]
fn values_are_found_by_index() {
    let mut buffer = [0; 64];
    let mut writer = ValueWriter::new(&mut buffer);
    writer.push(1, Value::Int(5)).expect("the buffer is large enough");
    writer.push(4, Value::Text("x")).expect("the buffer is large enough");
    let values = Values::new(writer.written());
    assert_eq!(values.find(4), Some(Value::Text("x")));
    assert_eq!(values.find(0), None);
}

#[test]
fn values_without_space_leave_earlier_ones_whole() {
    let mut buffer = [0; 20];
    let mut writer = ValueWriter::new(&mut buffer);
    assert_eq!(writer.push(0, Value::Bool(true)), Ok(()));
    assert_eq!(writer.push(1, Value::Int(1)), Err(NoSpace));
    assert_eq!(writer.push(2, Value::Bytes(&[0; limits::VALUE_BYTES + 1])), Err(NoSpace));
    assert_eq!(writer.push(3, Value::Choice(2)), Ok(()));
    let values: Result<Vec<_>, _> = Values::new(writer.written()).collect();
    assert_eq!(values, Ok(vec![(0, Value::Bool(true)), (3, Value::Choice(2))]));
}

#[test]
fn an_event_without_space_is_an_error() {
    let event = Event::Timer { id: 1, deadline: Micros(1) };
    assert_eq!(event.encode(&mut [0; 8]), Err(NoSpace));
    assert_eq!(event.encode(&mut [0; 9]), Ok(9));
}
