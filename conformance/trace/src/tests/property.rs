//! Properties over generated traces and over damaged text.

use proptest::collection::{btree_map, vec};
use proptest::option;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use softplug_abi::{Failure, LineErrorKind, LinkDownReason, Parity};

use super::HOLD;
use crate::*;

fn name() -> impl Strategy<Value = String> {
    "[a-z][a-z0-9_-]{0,11}"
}

fn payload_from(damage: bool) -> BoxedStrategy<Payload> {
    let sound = prop_oneof![
        vec(any::<u8>(), 1..40).prop_map(Item::Hex),
        vec(any::<u8>(), 0..40).prop_map(Item::Text),
        ".{0,12}".prop_map(|text| Item::Text(text.into_bytes())),
        any::<[u8; 32]>().prop_map(|digest| Item::File(Digest(digest))),
        (select(GENERATORS), any::<u64>(), 0..100_000_u64)
            .prop_map(|(kind, seed, length)| Item::Generated(Generator { kind, seed, length })),
    ];
    let bad =
        (select(&[BadKind::Parity, BadKind::Framing, BadKind::ParityOrFraming][..]), any::<u8>())
            .prop_map(|(kind, byte)| Item::Bad { kind, byte });
    let item = if damage { prop_oneof![4 => sound, 1 => bad].boxed() } else { sound.boxed() };
    vec(item, 1..5).prop_map(Payload::new).boxed()
}

fn some_bytes(damage: bool) -> impl Strategy<Value = Payload> {
    payload_from(damage).prop_filter("at least one byte", |payload| payload.length() != Some(0))
}

fn perhaps_data() -> BoxedStrategy<Payload> {
    prop_oneof![Just(Payload::default()), payload_from(false)].boxed()
}

fn fields() -> BoxedStrategy<Vec<Assignment>> {
    btree_map(name(), prop_oneof![".{0,8}", "[!-~]{0,8}"], 0..4)
        .prop_map(|fields| {
            fields.into_iter().map(|(name, value)| Assignment { name, value }).collect()
        })
        .boxed()
}

fn levels(lines: &'static [ModemLine]) -> impl Strategy<Value = ModemLevels> {
    btree_map(select(lines), any::<bool>(), 1..=lines.len()).prop_map(ModemLevels)
}

fn id() -> impl Strategy<Value = u32> {
    1..=u32::MAX
}

fn failure() -> impl Strategy<Value = Failure> {
    select(Failure::ALL)
}

/// A number, or 0 for none.
fn status() -> impl Strategy<Value = u16> {
    prop_oneof![Just(0), 1..=u16::MAX]
}

/// A line or a column, or 0 for none.
fn place() -> impl Strategy<Value = u32> {
    prop_oneof![Just(0), id()]
}

fn room(low: u32) -> impl Strategy<Value = Room> {
    (option::of(low..), option::of(low..))
        .prop_map(|(transmit, delivery)| Room { transmit, delivery })
        .prop_filter("one of them", |room| *room != Room::default())
}

fn line_event() -> BoxedStrategy<LineEvent> {
    prop_oneof![
        levels(ModemLine::INPUTS).prop_map(LineEvent::Modem),
        (select(LineErrorKind::ALL), option::of(any::<u8>()), 0..3_u32)
            .prop_map(|(kind, byte, span)| LineEvent::Error { kind, byte, span }),
        select(LinkDownReason::ALL).prop_map(LineEvent::Down),
        Just(LineEvent::Up),
    ]
    .boxed()
}

fn host() -> BoxedStrategy<HostRequest> {
    prop_oneof![
        (id(), prop_oneof![Just("send".to_owned()), name()], fields(), perhaps_data())
            .prop_map(|(id, kind, fields, data)| HostRequest::Job { id, kind, fields, data }),
        id().prop_map(HostRequest::Pause),
        id().prop_map(HostRequest::Resume),
        any::<u32>().prop_map(HostRequest::Abort),
        Just(HostRequest::ForceResume),
        room(1).prop_map(HostRequest::Room),
        select(&[Drain::Auto, Drain::Off][..]).prop_map(HostRequest::Drain),
        (id(), perhaps_data()).prop_map(|(id, data)| HostRequest::Grant { id, data }),
        (id(), failure()).prop_map(|(id, failure)| HostRequest::Refuse { id, failure }),
        select(&[HostRequest::Swap, HostRequest::Close, HostRequest::Open][..]),
    ]
    .boxed()
}

fn action() -> BoxedStrategy<Expected> {
    prop_oneof![
        (id(), perhaps_data(), option::of(failure()), status(), option::of(".{0,10}")).prop_map(
            |(id, data, failure, status, name)| Expected::Deliver {
                id,
                data,
                failure,
                status,
                name
            }
        ),
        (id(), option::of(any::<u64>())).prop_map(|(id, sent)| Expected::Done { id, sent }),
        (id(), failure(), status(), option::of(any::<u64>()))
            .prop_map(|(id, failure, status, sent)| Expected::Fail { id, failure, status, sent }),
        id().prop_map(|id| Expected::Check { id, failure: None, status: 0, line: 0, column: 0 }),
        (id(), failure().prop_map(Some), status(), place(), place()).prop_map(
            |(id, failure, status, line, column)| Expected::Check {
                id,
                failure,
                status,
                line,
                column
            }
        ),
        (id(), name(), fields()).prop_map(|(id, kind, fields)| Expected::Request {
            id,
            kind,
            fields
        }),
        id().prop_map(Expected::Withdraw),
    ]
    .boxed()
}

fn expectation() -> BoxedStrategy<What> {
    prop_oneof![
        some_bytes(false).prop_map(Expected::Send),
        levels(ModemLine::OUTPUTS).prop_map(Expected::SetLines),
        (1..=limits::BREAK_MICROS).prop_map(Expected::SendBreak),
        action(),
    ]
    .prop_map(What::Expected)
    .boxed()
}

fn what() -> BoxedStrategy<What> {
    let given = prop_oneof![
        some_bytes(true).prop_map(Given::Receive),
        some_bytes(true).prop_map(Given::Burst),
        line_event().prop_map(Given::Line),
        host().prop_map(Given::Host),
    ];
    prop_oneof![4 => given.prop_map(What::Given), 1 => expectation(), 1 => Just(What::Quiet)]
        .boxed()
}

/// A step of time, the length of a window, what happens (`None`: a comment or
/// a blank line), the comment.
type Sketch = (u64, u64, Option<What>, String);

fn lines(what: BoxedStrategy<What>, most: usize) -> BoxedStrategy<Vec<Sketch>> {
    vec((0..3_000_000_u64, 0..2_u64, option::weighted(0.8, what), "[ -~é]{0,20}"), 0..most).boxed()
}

fn sorted(lines: Vec<Sketch>, start: u64) -> Vec<Line> {
    let mut time = start;
    let mut body = Vec::new();
    for (step, window, what, comment) in lines {
        time += step;
        match what {
            Some(what) => {
                let window = if what == What::Quiet { 0 } else { window };
                let when = When { from: Time(time), to: Time(time + window) };
                body.push(Line::Entry(Entry { when, what, line: SourceLine(0) }));
            }
            None if window == 0 => body.push(Line::Comment(comment.trim_end().to_owned())),
            None => body.push(Line::Blank),
        }
    }
    crate::model::tidy_blank_lines(&mut body);
    body
}

fn trace() -> BoxedStrategy<Trace> {
    let slug = "[a-z0-9]{1,6}(-[a-z0-9]{1,4})?";
    let names = (slug, slug, proptest::collection::btree_set("[a-z]{1,5}\\.[a-z0-9]{1,5}", 1..3));
    let line = (
        any::<u32>(),
        5..=8_u8,
        2..=4_u8,
        id(),
        any::<u32>(),
        select(&['N', 'E', 'O', 'M', 'S'][..]),
    );
    let origin = prop_oneof![
        Just(Origin::HandWritten),
        ("[a-z]([a-z ]{0,8}[a-z])?", "[a-z]{1,5}").prop_map(|(device, tool)| {
            Origin::Recorded { device, date: "2026-12-31".to_owned(), tool }
        }),
        ("[a-z]{1,8}", any::<u64>())
            .prop_map(|(generator, seed)| Origin::Generated { generator, seed }),
    ];
    let rest = (
        select(&[Level::Must, Level::Should, Level::May][..]),
        option::of(select(&[Edge::Before, Edge::After][..])),
        fields(),
        prop_oneof![Just(Room::default()), room(0)],
        prop_oneof![Just(ModemLevels::default()), levels(ModemLine::INPUTS)],
        id(),
        origin,
        any::<[bool; 6]>(),
        prop_oneof![Just(String::new()), Just("the line held".to_owned())],
        option::of((any::<u8>(), 1..=255_u8)),
    );
    let title = "[!-~é]([ -~é]{0,30}[!-~])?";
    let body = (lines(what(), 12), vec(lines(expectation(), 3), 2..4), lines(what(), 4), what());
    (names, title, line, rest, body)
        .prop_map(|(names, title, line, rest, body)| {
            let parity = match line.5 {
                'N' => Parity::None,
                'E' => Parity::Even,
                'O' => Parity::Odd,
                'M' => Parity::Mark,
                _ => Parity::Space,
            };
            let front = FrontMatter {
                id: format!("{}.{}", names.0, names.1),
                title,
                profile: names.0,
                clauses: names.2.into_iter().collect(),
                level: rest.0,
                edge: rest.1,
                line: LineSettings {
                    baud: line.0,
                    data_bits: line.1,
                    parity,
                    stop_half_bits: line.2,
                    depth: line.3,
                    reaction: line.4,
                },
                config: rest.2,
                room: rest.3,
                modem: rest.4,
                since: rest.5,
                origin: rest.6,
                permute: Permutations {
                    cuts: rest.7[0],
                    swap: rest.7[1],
                    twice: rest.7[2],
                    later: rest.7[3],
                    after: rest.7[4],
                    rooms: rest.7[5],
                },
                leaves: rest.8,
                bytes: rest.9.map(|(written, step)| {
                    ByteClass::new(written, |byte| byte == written || byte % step == 0)
                }),
            };
            let (first, branches, after, last) = body;
            let mut lines = sorted(first, 0);
            let end = |lines: &[Line]| {
                lines
                    .iter()
                    .filter_map(Line::entry)
                    .next_back()
                    .map_or(0, |entry| entry.when.from.0)
            };
            let start = end(&lines);
            let branches = branches.into_iter().map(|branch| sorted(branch, start)).collect();
            lines.push(Line::Alternatives(Alternatives { clause: "p.c".to_owned(), branches }));
            lines.extend(sorted(after, start + 20_000_000));
            let when = When::at(Time(end(&lines).max(start + 20_000_000)));
            lines.push(Line::Entry(Entry { when, what: last, line: SourceLine(0) }));
            Trace { front, body: lines }
        })
        .boxed()
}

/// Text that is likely to reach deep into the parser.
fn nearly_valid() -> BoxedStrategy<String> {
    const PARTS: &[&str] = &[
        "<",
        "<<",
        ">",
        "!",
        "?",
        "=",
        ".",
        "#",
        "{ alt p.c",
        "|",
        "}",
        "0.0",
        "0.5~1.0",
        "41",
        "\"A\\n\"",
        "\"",
        "\\",
        "~p31",
        "~",
        "file:",
        "gen:nc(1,2)",
        "gen:",
        "send",
        "job",
        "1",
        "deliver",
        "complete",
        "failed",
        "fail",
        "done",
        "sent=1",
        "status=",
        "status=ffff",
        "name=\"x\"",
        "=",
        "check",
        "good",
        "room",
        "transmit=1",
        "cts+",
        "rts-",
        "break",
        "lineerror",
        "parity",
        "span=1",
        "answer",
        "granted",
        ";",
        "é",
        "\u{202E}",
        "\t",
        "\n",
        "99999999999999999999",
    ];
    vec(select(PARTS), 0..30).prop_map(|parts| super::with_body(&parts.join(" "))).boxed()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(512) })]

    #[test]
    fn a_model_survives_its_text(trace in trace()) {
        let text = trace.format();
        let parsed = Trace::parse(&text).map_err(|error| TestCaseError::fail(error.report("x")))?;
        prop_assert_eq!(&parsed, &trace);
        prop_assert_eq!(parsed.format(), text);
    }

    #[test]
    fn any_text_is_read_or_refused(text in any::<String>()) {
        check(&text)?;
    }

    #[test]
    fn any_body_is_read_or_refused(body in "(?s).{0,200}") {
        check(&super::with_body(&body))?;
    }

    #[test]
    fn words_in_any_order_are_read_or_refused(text in nearly_valid()) {
        check(&text)?;
    }

    #[test]
    fn damaged_traces_are_read_or_refused(
        base in prop_oneof![Just(HOLD.to_owned()), trace().prop_map(|trace| trace.format())],
        changes in vec((any::<Index>(), any::<Index>(), 0..4_u8, any::<char>()), 1..6),
    ) {
        let mut text: Vec<char> = base.chars().collect();
        for (at, other, change, c) in changes {
            if text.is_empty() {
                break;
            }
            let (at, other) = (at.index(text.len()), other.index(text.len()));
            match change {
                0 => { text.remove(at); }
                1 => text.insert(at, c),
                2 => text.swap(at, other),
                _ => { text.truncate(at.max(other)); }
            }
        }
        check(&text.into_iter().collect::<String>())?;
    }

    #[test]
    fn blessing_with_its_own_expectations_changes_nothing_but_alternatives(trace in trace()) {
        let observed: Vec<Entry> = trace.entries().filter(|entry| entry.what.is_expectation()).cloned().collect();
        let inputs: Vec<Entry> = trace.entries().filter(|entry| !entry.what.is_expectation()).cloned().collect();
        let blessed = trace.with_expectations(observed.clone(), &NoFiles).map_err(|error| TestCaseError::fail(error.to_string()))?;
        prop_assert_eq!(blessed.alternatives().count(), 0);
        let (new, kept): (Vec<Entry>, Vec<Entry>) = blessed.entries().cloned().partition(|entry| entry.what.is_expectation());
        prop_assert_eq!(new, observed);
        prop_assert_eq!(kept, inputs);
        let parsed = Trace::parse(&blessed.format()).map_err(|error| TestCaseError::fail(error.report("x")))?;
        prop_assert_eq!(parsed, blessed);
    }
}

/// What is read has a stable canonical form; what is refused, a place in the text.
fn check(text: &str) -> Result<(), TestCaseError> {
    match Trace::parse(text) {
        Ok(trace) => {
            let canonical = trace.format();
            let again = Trace::parse(&canonical)
                .map_err(|error| TestCaseError::fail(error.report("canonical")))?;
            prop_assert_eq!(&again, &trace);
            prop_assert_eq!(again.format(), canonical);
            prop_assert!(!trace.variants().is_empty());
        }
        Err(error) => {
            prop_assert!(error.line as usize <= text.lines().count() + 1);
            prop_assert!(error.column as usize <= error.source_line.chars().count() + 1);
            prop_assert!(error.report("x").lines().count() >= 5);
        }
    }
    Ok(())
}
