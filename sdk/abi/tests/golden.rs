//! Freezes the bytes of ABI 1.0: every event, every action, names and numbers.
//!
//! The hex in `fixtures/abi` was written from the tables in `docs/abi.md`, not
//! by this crate. None of it may change within major version 1.

use crate::common::{Golden, golden};
use softplug_abi::{
    Action, ActionWriter, Actions, DeliveryId, Event, EventKind, Failure, JobId, LineErrorKind,
    LineParameters, LinkDownReason, MORE_OUTPUT, Mailbox, MailboxError, MalformedReason, MarkId,
    MarkState, Micros, ModemLines, NoteLevel, Parity, Pass, Refusal, Region, RequestId, Value,
    ValueWriter, Values, limits,
};

const EVERY_TYPE: [(u16, Value<'_>); 5] = [
    (0, Value::Bool(true)),
    (1, Value::Int(-2)),
    (2, Value::Text("Öl")),
    (3, Value::Bytes(&[0x11, 0x13])),
    (4, Value::Choice(3)),
];

fn records(values: &[(u16, Value<'_>)]) -> Vec<u8> {
    let mut buffer = [0; 256];
    let mut writer = ValueWriter::new(&mut buffer);
    for (index, value) in values {
        writer.push(*index, *value).expect("the buffer is large enough");
    }
    writer.written().to_vec()
}

fn line(baud: u32, data_bits: u8, parity: Parity, stop_half_bits: u8) -> LineParameters {
    LineParameters { baud, data_bits, parity, stop_half_bits }
}

fn open(line: LineParameters, transmit_room: u32, delivery_room: u32) -> Event<'static> {
    Event::Open { resumed: false, line, transmit_room, delivery_room }
}

fn events(stored: &Stored) -> Vec<(&'static str, Event<'_>)> {
    let values = |bytes| Values::new(bytes);
    let error = |kind, byte, span| Event::LineError { kind, byte, span };
    let lines = |known, on| Event::ModemLines { known: ModemLines(known), on: ModemLines(on) };
    vec![
        ("settings", Event::Settings { first: true, last: true, values: values(&stored.all) }),
        (
            "settings/first",
            Event::Settings { first: true, last: false, values: values(&stored.no) },
        ),
        (
            "settings/last",
            Event::Settings { first: false, last: true, values: values(&stored.two_seconds) },
        ),
        ("settings/none", Event::Settings { first: true, last: true, values: values(&[]) }),
        ("open", open(line(9_600, 8, Parity::None, 2), 4_096, 65_536)),
        (
            "open/resumed",
            Event::Open {
                resumed: true,
                line: line(0, 7, Parity::Even, 4),
                transmit_room: 0,
                delivery_room: 1,
            },
        ),
        ("open/odd", open(line(50, 5, Parity::Odd, 3), 1, 2)),
        ("open/mark", open(line(115_200, 6, Parity::Mark, 2), 1, 2)),
        ("open/space", open(line(921_600, 8, Parity::Space, 2), u32::MAX, u32::MAX)),
        ("close", Event::Close),
        ("received", Event::Received(b"G1\r\n\x00\xff")),
        ("line-error", error(LineErrorKind::Parity, Some(0x31), 0)),
        ("line-error/framing", error(LineErrorKind::Framing, Some(0), 0)),
        ("line-error/parity-or-framing", error(LineErrorKind::ParityOrFraming, None, 16)),
        ("line-error/overrun", error(LineErrorKind::Overrun, None, 0)),
        ("line-error/break", error(LineErrorKind::Break, None, 0)),
        ("modem-lines", lines(0x3f, 0x31)),
        ("modem-lines/none", lines(0, 0)),
        ("link-down", Event::LinkDown(LinkDownReason::Unplugged)),
        ("link-down/disconnected", Event::LinkDown(LinkDownReason::Disconnected)),
        ("link-down/failed", Event::LinkDown(LinkDownReason::Failed)),
        ("link-up", Event::LinkUp),
        ("timer", Event::Timer { id: 15, deadline: Micros(2_001_146) }),
        ("timer/past", Event::Timer { id: 0, deadline: Micros(-1) }),
        ("mark", Event::Mark { mark: MarkId(7), state: MarkState::MaybeLeft }),
        ("mark/surely-left", Event::Mark { mark: MarkId(7), state: MarkState::SurelyLeft }),
        ("mark/dropped", Event::Mark { mark: MarkId(u32::MAX), state: MarkState::Dropped }),
        ("transmit-room", Event::TransmitRoom { grown: 64 }),
        ("discarded", Event::Discarded { bytes: 3 }),
        ("delivery-room", Event::DeliveryRoom { grown: 1_024 }),
        (
            "job-begin",
            Event::JobBegin {
                job: JobId(1),
                kind: 0,
                pass: Pass::Run,
                size: Some(1_048_576),
                fields: values(&stored.program),
            },
        ),
        (
            "job-begin/check",
            Event::JobBegin {
                job: JobId(2),
                kind: 1,
                pass: Pass::Check,
                size: None,
                fields: values(&[]),
            },
        ),
        ("job-data", Event::JobData { job: JobId(1), bytes: b"G1X1\n" }),
        ("job-end", Event::JobEnd { job: JobId(1) }),
        ("pause", Event::Pause { job: JobId(1) }),
        ("resume", Event::Resume { job: JobId(1) }),
        ("abort", Event::Abort { job: JobId(1) }),
        ("abort/delivery", Event::Abort { job: JobId::NONE }),
        ("force-resume", Event::ForceResume),
        (
            "answer",
            Event::Answer { request: RequestId(5), refused: None, more: true, bytes: b"%\n" },
        ),
        (
            "answer/refused",
            Event::Answer {
                request: RequestId(5),
                refused: Some(Failure::NotFound),
                more: false,
                bytes: b"",
            },
        ),
        ("save", Event::Save),
        ("restore", Event::Restore { format: 1, offset: 0, total: 3, bytes: b"abc" }),
        (
            "restore/second",
            Event::Restore { format: 2, offset: 65_535, total: 65_536, bytes: b"z" },
        ),
        ("continue", Event::Continue),
    ]
}

fn actions(stored: &Stored) -> Vec<(&'static str, Action<'_>)> {
    const SIXTEEN: &[u8] = &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
    let note = |level, code, text| Action::Note { level, code, text };
    vec![
        ("transmit", Action::Transmit { mark: MarkId::NONE, bytes: b"G1" }),
        ("transmit/marked", Action::Transmit { mark: MarkId(7), bytes: b"M30" }),
        ("transmit/mark-only", Action::Transmit { mark: MarkId(8), bytes: b"" }),
        ("transmit-urgent", Action::TransmitUrgent { mark: MarkId::NONE, bytes: b"\x13" }),
        ("transmit-urgent/marked", Action::TransmitUrgent { mark: MarkId(9), bytes: SIXTEEN }),
        ("hold", Action::Hold),
        ("release", Action::Release),
        ("discard", Action::Discard),
        ("set-timer", Action::SetTimer { id: 15, deadline: Micros(2_001_146) }),
        ("cancel-timer", Action::CancelTimer { id: 0 }),
        ("modem-lines", Action::ModemLines { mask: ModemLines::OUTPUTS, on: ModemLines::RTS }),
        ("break", Action::Break { micros: 250_000 }),
        ("want", Action::Want { job: JobId(1), bytes: 512 }),
        ("delivery-begin", Action::DeliveryBegin { delivery: DeliveryId(3), job: JobId::NONE }),
        (
            "delivery-begin/for-job",
            Action::DeliveryBegin { delivery: DeliveryId(3), job: JobId(1) },
        ),
        ("deliver", Action::Deliver { delivery: DeliveryId(3), bytes: b"%\nO1\n" }),
        ("delivery-name", Action::DeliveryName { delivery: DeliveryId(3), name: "O0001" }),
        ("delivery-end", Action::DeliveryEnd { delivery: DeliveryId(3), failure: None, status: 0 }),
        (
            "delivery-end/failed",
            Action::DeliveryEnd {
                delivery: DeliveryId(3),
                failure: Some(Failure::NoEndMark),
                status: 0x0505,
            },
        ),
        ("job-done", Action::JobDone { job: JobId(1), sent: 1_048_576 }),
        (
            "job-failed",
            Action::JobFailed { job: JobId(1), failure: Failure::Aborted, status: 0, sent: 4 },
        ),
        (
            "check-result",
            Action::CheckResult { job: JobId(1), failure: None, status: 0, line: 0, column: 0 },
        ),
        (
            "check-result/bad",
            Action::CheckResult {
                job: JobId(1),
                failure: Some(Failure::UnsupportedCharacter),
                status: 82,
                line: 3,
                column: 17,
            },
        ),
        (
            "request",
            Action::Request { request: RequestId(5), kind: 1, fields: Values::new(&stored.all) },
        ),
        (
            "request/without-fields",
            Action::Request { request: RequestId(6), kind: 0, fields: Values::new(&[]) },
        ),
        ("withdraw", Action::Withdraw { request: RequestId(5) }),
        ("note", note(NoteLevel::Warning, 85, "gehalten: ü")),
        ("note/error", note(NoteLevel::Error, 0, "")),
        ("note/info", note(NoteLevel::Info, 0, "i")),
        ("note/debug", note(NoteLevel::Debug, 0, "d")),
        ("state", Action::State { name: "held" }),
        ("saved", Action::Saved { format: 1, offset: 0, total: 3, bytes: b"abc" }),
        ("saved/empty", Action::Saved { format: 1, offset: 0, total: 0, bytes: b"" }),
    ]
}

/// Value records that the cases borrow.
struct Stored {
    all: Vec<u8>,
    no: Vec<u8>,
    two_seconds: Vec<u8>,
    program: Vec<u8>,
}

impl Stored {
    fn new() -> Self {
        Self {
            all: records(&EVERY_TYPE),
            no: records(&[(0, Value::Bool(false))]),
            two_seconds: records(&[(1, Value::Int(2_000))]),
            program: records(&[(0, Value::Int(4_711))]),
        }
    }
}

/// Name and number of an action's kind. A new variant must be named here, and
/// then wants its golden bytes.
fn action_kind(action: &Action<'_>) -> (&'static str, u16) {
    match action {
        Action::Transmit { .. } => ("transmit", 1),
        Action::TransmitUrgent { .. } => ("transmit-urgent", 2),
        Action::Hold => ("hold", 3),
        Action::Release => ("release", 4),
        Action::Discard => ("discard", 5),
        Action::SetTimer { .. } => ("set-timer", 6),
        Action::CancelTimer { .. } => ("cancel-timer", 7),
        Action::ModemLines { .. } => ("modem-lines", 8),
        Action::Break { .. } => ("break", 9),
        Action::Want { .. } => ("want", 10),
        Action::DeliveryBegin { .. } => ("delivery-begin", 11),
        Action::Deliver { .. } => ("deliver", 12),
        Action::DeliveryName { .. } => ("delivery-name", 13),
        Action::DeliveryEnd { .. } => ("delivery-end", 14),
        Action::JobDone { .. } => ("job-done", 15),
        Action::JobFailed { .. } => ("job-failed", 16),
        Action::CheckResult { .. } => ("check-result", 17),
        Action::Request { .. } => ("request", 18),
        Action::Withdraw { .. } => ("withdraw", 19),
        Action::Note { .. } => ("note", 20),
        Action::State { .. } => ("state", 21),
        Action::Saved { .. } => ("saved", 22),
    }
}

fn find<'a>(file: &'a [Golden], name: &str) -> &'a Golden {
    file.iter().find(|line| line.name == name).unwrap_or_else(|| panic!("no line for {name}"))
}

#[test]
fn events_have_the_frozen_bytes() {
    let stored = Stored::new();
    let (file, cases) = (golden("events.txt"), events(&stored));
    assert_eq!(file.len(), cases.len());
    for (name, event) in &cases {
        let line = find(&file, name);
        assert_eq!(line.kind, event.kind().code(), "{name}");
        assert_eq!(name.split('/').next(), Some(event.kind().name()), "{name}");

        let mut buffer = [0; 256];
        let length = event.encode(&mut buffer).expect("the buffer is large enough");
        assert_eq!(buffer[..length], line.bytes, "{name}");
        assert_eq!(Event::decode(event.kind(), &line.bytes).as_ref(), Ok(event), "{name}");
    }
}

#[test]
fn every_kind_of_event_is_frozen() {
    let file = golden("events.txt");
    for (at, kind) in EventKind::ALL.iter().enumerate() {
        assert_eq!(usize::from(kind.code()), at + 1, "{kind}: kinds are numbered without gaps");
        assert_eq!(find(&file, kind.name()).kind, kind.code());
    }
    assert_eq!(EventKind::ALL.len(), 24);
    assert_eq!(EventKind::from_code(0), None);
    assert_eq!(EventKind::from_code(25), None);
}

#[test]
fn actions_have_the_frozen_bytes() {
    let stored = Stored::new();
    let (file, cases) = (golden("actions.txt"), actions(&stored));
    assert_eq!(file.len(), cases.len());
    for (name, action) in &cases {
        let line = find(&file, name);
        let (kind_name, kind) = action_kind(action);
        assert_eq!(line.kind, kind, "{name}");
        assert_eq!(name.split('/').next(), Some(kind_name), "{name}");

        let mut buffer = [0; 256];
        let mut writer = ActionWriter::new(&mut buffer);
        writer.push(action).expect("the buffer is large enough");
        assert_eq!(writer.written(), line.bytes, "{name}");
        let decoded: Result<Vec<_>, _> = Actions::new(&line.bytes).collect();
        assert_eq!(decoded.as_deref(), Ok(std::slice::from_ref(action)), "{name}");
    }
}

#[test]
fn every_kind_of_action_is_frozen() {
    let file = golden("actions.txt");
    for kind in 0..=u16::from(u8::MAX) {
        let record = [kind.to_le_bytes(), [0, 0]].concat();
        let first = Actions::new(&record).next().expect("there is a record");
        let exists =
            !matches!(first, Err(error) if error.reason == MalformedReason::UnknownKind(kind));
        assert_eq!(file.iter().any(|line| line.kind == kind), exists, "kind {kind}");
        assert_eq!((1..=22).contains(&kind), exists, "kind {kind}");
    }
}

#[test]
fn value_records_decode_to_every_type() {
    let stored = Stored::new();
    let decoded: Result<Vec<_>, _> = Values::new(&stored.all).collect();
    assert_eq!(decoded.as_deref(), Ok(&EVERY_TYPE[..]));
}

#[test]
fn names_and_version() {
    assert_eq!(softplug_abi::VERSION, (1, 1));
    assert_eq!(softplug_abi::EXPORT_MEMORY, "memory");
    assert_eq!(softplug_abi::EXPORT_MAILBOX, "softplug_v1");
    assert_eq!(softplug_abi::EXPORT_STEP, "softplug_v1_step");
    assert_eq!(softplug_abi::MANIFEST_SECTION, "softplug.manifest");
    assert_eq!(MORE_OUTPUT, 1 << 30);
}

#[test]
fn limits_are_frozen() {
    assert_eq!(limits::MODULE_BYTES, 262_144);
    assert_eq!(limits::MEMORY_PAGES, 4);
    assert_eq!(limits::MANIFEST_BYTES, 65_536);
    assert_eq!(limits::INPUT_BYTES, 512..=32_768);
    assert_eq!(limits::OUTPUT_BYTES, 512..=32_768);
    assert_eq!(limits::WORDS_BYTES, 64..=1_024);
    assert_eq!(limits::TIMERS, 16);
    assert_eq!(limits::RECORD_BYTES, 65_535);
    assert_eq!(limits::URGENT_BYTES, 16);
    assert_eq!(limits::MARKS, 64);
    assert_eq!(limits::STEPS_PER_INSTANT, 1_000);
    assert_eq!(limits::OUTPUT_ROUNDS, 256);
    assert_eq!(limits::STATE_BYTES, 65_536);
    assert_eq!(limits::FUEL_PER_EVENT, 1_000_000);
    assert_eq!(limits::SETTINGS, 128);
    assert_eq!(limits::VALUE_BYTES, 400);
    assert_eq!(limits::FIELDS, 16);
    assert_eq!(limits::NOTE_BYTES, 240);
    assert_eq!(limits::STATE_NAME_BYTES, 48);
    assert_eq!(limits::DELIVERY_NAME_BYTES, 128);
    assert_eq!(limits::REQUESTS, 4);
    assert_eq!(limits::BREAK_MICROS, 10_000_000);
}

#[test]
fn failures_are_frozen() {
    let names = [
        "aborted",
        "no-answer",
        "refused",
        "line-error",
        "protocol",
        "checksum",
        "too-long",
        "unsupported-character",
        "held-too-long",
        "partner-reset",
        "partner-alarm",
        "link-down",
        "partner-gone",
        "overrun",
        "no-end-mark",
        "conflict",
        "attempts-used-up",
        "bad-job",
        "not-supported",
        "interrupted",
        "busy",
        "not-found",
        "denied",
        "break",
        "echo",
        "no-buffer",
        "parity-check",
        "internal",
    ];
    let table: Vec<_> =
        Failure::ALL.iter().map(|failure| (failure.code(), failure.name())).collect();
    assert_eq!(table, (1..).zip(names).collect::<Vec<_>>());
    for failure in Failure::ALL {
        assert_eq!(Failure::from_code(failure.code()), Some(*failure));
        assert_eq!(Failure::from_name(failure.name()), Some(*failure));
    }
    assert_eq!(Failure::from_code(0), None);
}

#[test]
fn refusals_are_frozen() {
    let table: Vec<_> =
        Refusal::ALL.iter().map(|refusal| (refusal.code(), refusal.name())).collect();
    let expected = [(1, "malformed-event"), (2, "unknown-event"), (3, "settings"), (4, "state")];
    assert_eq!(table, expected);
}

fn descriptor(words: [u32; 6]) -> [u8; Mailbox::BYTES] {
    let mut bytes = [0; Mailbox::BYTES];
    for (to, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
        *to = word.to_le_bytes();
    }
    bytes
}

fn mailbox(words: [u32; 6]) -> Result<Mailbox, MailboxError> {
    Mailbox::decode(descriptor(words), 65_536)
}

#[test]
fn mailbox_descriptor_is_frozen() {
    assert_eq!(Mailbox::BYTES, 24);
    let expected = Mailbox {
        input: Region { address: 1_024, capacity: 512 },
        output: Region { address: 1_536, capacity: 32_768 },
        words: Region { address: 65_472, capacity: 64 },
    };
    assert_eq!(mailbox([1_024, 512, 1_536, 32_768, 65_472, 64]), Ok(expected));
}

#[test]
fn unusable_mailboxes_are_refused() {
    use MailboxError::{OutOfMemory, Overlap, Size};
    let cases = [
        ([0, 511, 1_024, 512, 4_096, 64], Size("input", 511)),
        ([0, 32_769, 40_000, 512, 50_000, 64], Size("input", 32_769)),
        ([0, 512, 1_024, 511, 4_096, 64], Size("output", 511)),
        ([0, 512, 1_024, 32_769, 50_000, 64], Size("output", 32_769)),
        ([0, 512, 1_024, 512, 4_096, 63], Size("last words", 63)),
        ([0, 512, 1_024, 512, 4_096, 1_025], Size("last words", 1_025)),
        ([65_025, 512, 1_024, 512, 4_096, 64], OutOfMemory("input")),
        ([0, 512, u32::MAX, 512, 4_096, 64], OutOfMemory("output")),
        ([0, 512, 1_024, 512, 65_473, 64], OutOfMemory("last words")),
        ([0, 513, 512, 512, 4_096, 64], Overlap("input", "output")),
        ([0, 512, 4_096, 512, 511, 64], Overlap("input", "last words")),
        ([0, 512, 4_096, 512, 4_100, 64], Overlap("output", "last words")),
    ];
    for (words, error) in cases {
        assert_eq!(mailbox(words), Err(error), "{words:?}");
    }
}
