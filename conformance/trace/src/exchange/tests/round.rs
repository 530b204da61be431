//! What is exported and imported again is the same timeline.

use proptest::collection::{btree_map, vec};
use proptest::prelude::*;
use proptest::sample::select;
use softplug_abi::LineErrorKind;

use super::super::pace::Pace;
use super::*;
use crate::model::{
    BadKind, Entry, Expected, Given, Item, ModemLevels, Payload, SourceLine, Time, When,
};

const BODY: &str = r#"? 0.000000 send 1 "AB"
< 0.000000 11             ; DC1=XON
<< 0.000500 "before a character could begin"
> 0.100000 "G1 X1\nG1 X2\n"
<< 0.200000 "at the line rate, more than one packet of sixteen"
< 0.400000 41 42 ~p43 44 ~f45
<< 0.500000 41 ~p42 43
> 0.600000 gen:bytes(1,300)
= 2.000000 done 1
"#;

#[test]
fn a_trace_survives_every_format() {
    let all = trace(BODY);
    for format in Format::ALL {
        let mut held = all.clone();
        if matches!(format, Format::Hexdump | Format::Candump) {
            held = trace(&BODY.replace("~p", "").replace("~f", ""));
        }
        held.body.retain(|line| is_held(*format, line));
        there_and_back(&held, *format);
    }
}

#[test]
fn what_follows_at_the_line_rate_is_one_line_again() {
    let burst = "<< 0.010000 41 13         ; 'A' DC3=XOFF\n> 0.100000 \"one two three\"\n";
    for format in Format::ALL {
        assert_eq!(body(&there_and_back(&trace(burst), *format)), burst, "{format:?}");
    }
}

#[test]
fn modem_lines_and_line_errors_survive_a_capture() {
    let text = "\
! 0.000000 cts+ dsr+
> 0.001000 rts+
! 0.002000 cts- ri+
! 0.003000 break
! 0.004000 overrun
! 0.005000 lineerror parity span=0
< 0.006000 ~p31           ; ~'1'
> 0.007000 rts- dtr-
";
    let mut before = trace(text);
    before.front.modem = all_off();
    let back = there_and_back(&before, Format::Pcapng);
    assert_eq!(body(&back), text);
    // What is never on is not known to be connected.
    let words: Vec<_> = back.front.modem.0.keys().map(|line| line.name()).collect();
    assert_eq!(words, ["cts", "dsr", "ri"]);
}

#[test]
fn long_runs_are_cut_where_no_time_changes() {
    for line in ["9600 8N1", "110 7E2", "0 8N1", "9601 8N1"] {
        for (format, length) in [(Format::Pcapng, 34_000), (Format::Candump, 13_000)] {
            let sent = format!("> 1.000000 gen:nc(1,{length})\n");
            let mut long = trace(&(sent + "<< 7200.000000 gen:bytes(2,13000)\n"));
            long.front.line = front(line).line;
            there_and_back(&long, format);
        }
    }
}

const KINDS: &[BadKind] = &[BadKind::Parity, BadKind::Framing];

fn characters(damage: bool) -> BoxedStrategy<Payload> {
    let good = vec(any::<u8>(), 1..40).prop_map(Item::Hex);
    let bad = (select(KINDS), any::<u8>()).prop_map(|(kind, byte)| Item::Bad { kind, byte });
    let item = if damage { prop_oneof![3 => good, 1 => bad].boxed() } else { good.boxed() };
    vec(item, 1..4).prop_map(Payload::new).boxed()
}

fn levels(lines: &'static [ModemLine]) -> impl Strategy<Value = ModemLevels> {
    btree_map(select(lines), any::<bool>(), 1..=lines.len()).prop_map(ModemLevels)
}

fn what(format: Format) -> BoxedStrategy<What> {
    let damage = matches!(format, Format::Pcapng | Format::Saleae);
    let characters = prop_oneof![
        characters(damage).prop_map(Given::Receive).prop_map(What::Given),
        characters(damage).prop_map(Given::Burst).prop_map(What::Given),
        characters(false).prop_map(Expected::Send).prop_map(What::Expected),
    ];
    if format != Format::Pcapng {
        return characters.boxed();
    }
    let kinds = [
        LineErrorKind::Parity,
        LineErrorKind::Framing,
        LineErrorKind::Overrun,
        LineErrorKind::Break,
    ];
    prop_oneof![
        4 => characters,
        1 => levels(ModemLine::INPUTS).prop_map(|levels| What::Given(Given::Line(LineEvent::Modem(levels)))),
        1 => levels(ModemLine::OUTPUTS).prop_map(Expected::SetLines).prop_map(What::Expected),
        1 => select(kinds.to_vec())
            .prop_map(|kind| What::Given(Given::Line(LineEvent::Error { kind, byte: None, span: 0 }))),
    ]
    .boxed()
}

/// Any timeline that the format can hold and a line can carry: in each
/// direction a character begins when the one before has ended.
fn any_trace(format: Format) -> impl Strategy<Value = Trace> {
    const LINES: &[&str] =
        &["9600 8N1", "110 7E2", "115200 8E1", "0 8N1", "4711 6O1.5", "921600 8N1"];
    let steps = vec((prop_oneof![0..3_u64, 0..50_000_u64], what(format)), 1..20);
    (select(LINES), steps).prop_map(|(line, steps)| {
        let front = front(line);
        let pace = Pace::of(&front.line);
        // The end of the last one in each direction.
        let (mut received, mut sent) = (0, 0);
        let mut time = 0;
        let mut entries = Vec::new();
        for (step, what) in steps {
            time += step;
            let count = what.payload().and_then(Payload::length).unwrap_or(0) as usize;
            let after = |count: usize| pace.of_characters(count) as u64;
            let at = match &what {
                What::Expected(Expected::Send(_)) => {
                    let at = time.max(sent);
                    sent = at + after(count);
                    at
                }
                What::Given(
                    Given::Receive(_) | Given::Burst(_) | Given::Line(LineEvent::Error { .. }),
                ) => {
                    let at = time.max(received);
                    received = at + after(count + 1);
                    at
                }
                _ => time,
            };
            entries.push(Entry { when: When::at(Time(at)), what, line: SourceLine(0) });
        }
        entries.sort_by_key(|entry| entry.when.from);
        Trace { front, body: entries.into_iter().map(Line::Entry).collect() }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn any_course_survives_pcapng(trace in any_trace(Format::Pcapng)) {
        there_and_back(&trace, Format::Pcapng);
    }

    #[test]
    fn any_course_survives_a_hex_dump(trace in any_trace(Format::Hexdump)) {
        there_and_back(&trace, Format::Hexdump);
    }

    #[test]
    fn any_course_survives_candump(trace in any_trace(Format::Candump)) {
        there_and_back(&trace, Format::Candump);
    }

    #[test]
    fn any_course_survives_saleae(trace in any_trace(Format::Saleae)) {
        there_and_back(&trace, Format::Saleae);
    }
}
