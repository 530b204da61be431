//! Characters at the line's rate, joined.

use std::fmt::Write as _;

use crate::exchange::pace::Pace;
use crate::{Given, NoFiles, Piece, Trace, What};

const HEAD: &str = "id: a.b\ntitle: T\nprofile: a\nclauses: a.c\nlevel: may\n\
                    line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n---\n";

fn joined(body: &str) -> String {
    let trace = Trace::parse(&format!("{HEAD}{body}")).unwrap().at_line_rate();
    let text = trace.format();
    assert_eq!(Trace::parse(&text).unwrap().format(), text, "it is canonical");
    assert_eq!(trace.at_line_rate(), trace, "joining again joins nothing");
    text[HEAD.len()..].to_owned()
}

/// Each character that reaches the plug-in, with its time.
fn characters(trace: &Trace) -> Vec<(u64, Piece)> {
    let pace = Pace::of(&trace.front.line);
    let mut all = Vec::new();
    for entry in trace.entries() {
        let (payload, is_paced) = match &entry.what {
            What::Given(Given::Receive(payload)) => (payload, false),
            What::Given(Given::Burst(payload)) => (payload, true),
            _ => continue,
        };
        let mut number = 0;
        for piece in payload.pieces(&NoFiles).unwrap() {
            let singles: Vec<Piece> = match piece {
                Piece::Bytes(bytes) => bytes.iter().map(|b| Piece::Bytes(vec![*b])).collect(),
                bad @ Piece::Bad { .. } => vec![bad],
            };
            for single in singles {
                let behind = if is_paced { pace.of_characters(number) as u64 } else { 0 };
                all.push((entry.when.from.0 + behind, single));
                number += 1;
            }
        }
    }
    all
}

#[test]
fn a_gap_and_a_batch_end_a_line() {
    let body = "< 0.0 02\n< 0.001042 41\n< 0.002084 42\n< 0.010000 43\n< 0.011000 44 45\n\
                < 0.012042 46\n< 0.013300 47\n< 0.014600 48\n. 1.0\n";
    // The last two are more than a quarter of a character late.
    assert_eq!(
        joined(body),
        "<< 0.000000 02 41 42      ; STX 'AB'\n< 0.010000 43             ; 'C'\n\
         < 0.011000 44 45          ; 'DE'\n<< 0.012042 \"FG\"\n< 0.014600 48             ; 'H'\n\
         . 1.000000\n"
    );
}

#[test]
fn both_ways_are_joined_on_their_own() {
    let body =
        "< 0.0 41\n> 0.000500 61\n< 0.001042 42\n> 0.001542 62\n! 0.002 cts-\n< 0.002084 43\n";
    assert_eq!(
        joined(body),
        "<< 0.000000 \"ABC\"\n> 0.000500 \"ab\"\n! 0.002000 cts-\n. 0.002084\n"
    );
}

#[test]
fn damage_comments_windows_and_files_stay_where_they_are() {
    let body = "< 0.0 41\n< 0.001042 ~p42\n< 0.002084 43\n";
    assert_eq!(joined(body), "<< 0.000000 \"A\" ~p42 \"C\"  ; 'A' ~'B' 'C'\n. 0.002084\n");
    for body in [
        "< 0.000000 \"A\"\n# Here.\n< 0.001042 \"B\"\n",
        "< 0.000000 \"A\"\n\n< 0.001042 \"B\"\n",
        "< 0.000000 \"A\"\n< 0.001042~0.001050 \"B\"\n",
        "< 0.000000 \"A\"\n< 0.001042 gen:text(1,1)\n",
        "< 0.000000 \"A\"\n< 0.000000 \"B\"\n",
    ] {
        assert_eq!(joined(body), body);
    }
}

/// Characters that a slow reader takes together: the second is not before the first.
#[test]
fn no_character_overtakes_another() {
    let body = "> 0.0 61\n< 0.0 41\n< 0.000700 42\n< 0.000710 43\n";
    assert_eq!(
        joined(body),
        "> 0.000000 61             ; 'a'\n< 0.000000 41             ; 'A'\n< 0.000700 42             ; 'B'\n\
                              < 0.000710 43             ; 'C'\n"
    );
}

#[test]
fn without_a_rate_nothing_is_joined() {
    let text = format!("{HEAD}< 0.0 41\n< 0.0 42\n").replace("9600", "0");
    let trace = Trace::parse(&text).unwrap();
    assert_eq!(trace.at_line_rate(), trace);
}

/// A partner that drifts and jitters, for as long as it likes.
#[test]
fn no_character_moves_by_more_than_a_quarter() {
    for (rate, per_mille) in [("9600 8N1", 2), ("4800 7E2", 1), ("115200 8N1", 4), ("2400 8E1", 0)]
    {
        let head = HEAD.replace("9600 8N1", rate);
        let line = Trace::parse(&format!("{head}. 0.0\n")).unwrap().front.line;
        let pace = Pace::of(&line);
        let (mut body, mut seed) = (String::new(), 7_u64);
        for n in 0..10_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let due = pace.of_characters(n) as u64;
            let at = 1_000 + due + due * per_mille / 1_000 + (seed >> 33) % 40;
            let time = crate::Time(at);
            let byte = (seed >> 40) as u8;
            let _ = writeln!(body, "< {time} {byte:02X}");
        }
        let trace = Trace::parse(&format!("{head}{body}")).unwrap();
        let joined = trace.at_line_rate();
        let (before, after) = (characters(&trace), characters(&joined));
        assert_eq!(before.len(), after.len());
        let most = pace.of_characters(1) as u64 / 4;
        for ((at, byte), (now, same)) in before.iter().zip(&after) {
            assert_eq!(byte, same);
            assert!(now <= at && at - now <= most, "{rate}: {at} became {now}");
        }
        assert!(after.is_sorted_by_key(|(at, _)| *at));
        let lines = joined.entries().count();
        assert!(lines < if rate == "115200 8N1" { 6_000 } else { 150 }, "{rate}: {lines} lines");
        assert!(joined.end() >= trace.end());
    }
}
