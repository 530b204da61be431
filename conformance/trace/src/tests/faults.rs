//! What a person sees when a trace is wrong.

use std::fmt::Write as _;

use super::{HOLD, parse_body, with_body};
use crate::{ParseErrorKind, Trace};

/// The reports of bodies, one fault each.
fn reports(bodies: &[&str]) -> String {
    let mut text = String::new();
    for body in bodies {
        let error = parse_body(body).expect_err(body);
        let _ = writeln!(text, "{}\n", error.report("t.spt"));
    }
    text
}

/// The reports of the sample with one part replaced.
fn replaced(changes: &[(&str, &str)]) -> String {
    let mut text = String::new();
    for (from, to) in changes {
        assert!(HOLD.contains(from), "{from}");
        let error = Trace::parse(&HOLD.replacen(from, to, 1)).expect_err(to);
        let _ = writeln!(text, "{}\n", error.report("t.spt"));
    }
    text
}

#[test]
fn one_line_for_logs() {
    let error = parse_body("? 0.0 send 1 \"A\"\n>   0,5 41\n").unwrap_err();
    assert_eq!((error.line, error.column), (11, 5));
    assert_eq!(error.to_string(), "line 11, column 5: expected a time like 0.500000");
    assert_eq!(error.source_line, ">   0,5 41");
}

#[test]
fn front_matter_faults() {
    insta::assert_snapshot!(replaced(&[
        ("clauses:", "clasues:"),
        ("clauses:", "colour:"),
        ("clauses:", "machine_type:"),
        ("clauses:", "machine-type:"),
        ("since: 1", "since: 1\nlevel: may"),
        ("level: must\n", ""),
        ("title: XOFF stops the sender, XON lets it go on", "title:"),
        ("id: xon-xoff.tx.hold", "id: xon-xoff.tx.Hold"),
        ("id: xon-xoff.tx.hold", "id: r3964.tx.hold"),
        ("level: must", "level: most"),
        ("9600 8N1", "fast 8N1"),
        ("9600 8N1", "9600 9N1"),
        ("depth=1", "depth=0"),
        ("depth=1", "depht=1"),
        ("parity_mask=0x7F", "parity_mask"),
        ("parity_mask=0x7F", "feed_start=1"),
        ("feed_start=\"0d 0a\"", "feed_start=\"0d 0a"),
        ("feed_start=\"0d 0a\"", "feed_start=\"\\xFF\""),
        ("hand-written", "found"),
        ("hand-written", "recorded(a, 2026-13-01, b)"),
        ("hand-written", "generated(a)"),
        ("cuts swap", "cuts cuts"),
        ("cuts swap", "cut"),
        ("since: 1", "since: 0"),
        ("since: 1", "# a comment"),
        ("since: 1", "since: 1 ; first"),
        ("xon-xoff.tx.resume", "xon-xoff.tx.obey-xoff"),
    ]));
}

#[test]
fn what_only_resembles_a_date_is_none() {
    for date in ["2026-03-1", "2026-03-011", "2026011-12", "2026-03120", "2026-00-01", "2026-01-32"]
    {
        let origin = format!("recorded(a, {date}, b)");
        let error = Trace::parse(&HOLD.replace("hand-written", &origin)).expect_err(date);
        assert_eq!(error.kind, ParseErrorKind::Expected("a date like 2026-03-01"), "{date}");
    }
}

#[test]
fn time_faults() {
    insta::assert_snapshot!(reports(&[
        ". 1\n",
        ". 1.1234567\n",
        ". 2.0\n. 1.999999\n",
        "> 2.0~1.0 41\n",
        ". 1.0~2.0\n",
        ".1.0\n",
        ". -1.0\n",
    ]));
}

#[test]
fn payload_faults() {
    insta::assert_snapshot!(reports(&[
        "< 0.0\n",
        "< 0.0 4G\n",
        "< 0.0 41 4\n",
        "< 0.0 4142\n",
        "< 0.0 \"AB\n",
        "< 0.0 \"A\\q\"\n",
        "< 0.0 \"A\\x4\"\n",
        "< 0.0 \"A\"41\n",
        "< 0.0 \"\"\n",
        "< 0.0 ~x31\n",
        "> 0.0 41 ~p31\n",
        "? 0.0 send 1\n",
        "? 0.0 send 1 file:12\n",
        "? 0.0 send 1 gen:nd(1,2)\n",
        "? 0.0 send 1 gen:nc(1)\n",
    ]));
}

#[test]
fn word_faults() {
    insta::assert_snapshot!(reports(&[
        "* 0.0 41\n",
        "! 0.0 brake\n",
        "! 0.0 cts\n",
        "! 0.0 rts+\n",
        "! 0.0 cts+ cts-\n",
        "! 0.0 down gone\n",
        "! 0.0 up now\n",
        "> 0.0 cts+\n",
        "> 0.0 beep\n",
        "> 0.0 break\n",
        "? 0.0 sent 1 41\n",
        "? 0.0 drain on\n",
        "? 0.0 room\n",
        "? 0.0 answer 1 perhaps\n",
        "? 0.0 job 1 Fetch\n",
        "= 0.0 deliver 1 41 done\n",
        "= 0.0 deliver 1 41 complete size=1\n",
        "= 0.0 fail 1\n",
        "= 0.0 fail 1 echo sent=4 sent=4\n",
        "= 0.0 done one\n",
        ". 0.0 41\n",
    ]));
}

#[test]
fn reasons_are_those_of_the_abi() {
    for body in ["= 0.0 fail 1 gone\n", "= 0.0 check 1 gone\n", "? 0.0 answer 1 refused gone\n"] {
        let error = parse_body(body).unwrap_err();
        assert_eq!(error.column as usize, body.find("gone").unwrap() + 1);
        assert_eq!(error.kind.to_string(), "\"gone\" is no failure of the ABI");
    }
    let error = parse_body("= 0.0 deliver 1 41 failed gone\n").unwrap_err();
    assert_eq!(error.kind, ParseErrorKind::NoFailure("gone".to_owned()));
}

#[test]
fn block_faults() {
    insta::assert_snapshot!(reports(&[
        ". 0.0\n{ alt p.c\n> 1.0 41\n|\n",
        ". 0.0\n{ alt p.c\n> 1.0 41\n}\n",
        ". 0.0\n{ alt p.c\n{ alt p.d\n",
        ". 0.0\n{ alt\n",
        ". 0.0\n{ alt P\n",
        ". 0.0\n|\n",
        ". 0.0\n}\n",
        ". 0.0\n{ alt p.c\n| > 1.0 41\n",
        ". 0.0\n{ alt p.c\n  < 1.0 41\n",
        ". 2.0\n{ alt p.c\n|\n  > 1.0 41\n}\n",
        "# only a comment\n",
    ]));
}

#[test]
fn hidden_characters() {
    for hidden in [
        '\0', '\u{1B}', '\u{7F}', '\u{85}', '\u{200B}', '\u{202E}', '\u{2066}', '\u{2028}',
        '\u{FEFF}',
    ] {
        for body in [format!("# a{hidden}\n. 0.0\n"), format!("> 0.0 \"a{hidden}\"\n")] {
            assert_eq!(
                parse_body(&body).unwrap_err().kind,
                ParseErrorKind::ForbiddenCharacter(hidden)
            );
        }
    }
    assert_eq!(Trace::parse(&format!("\u{FEFF}{HOLD}")).unwrap_err().column, 1);
    insta::assert_snapshot!(reports(&["> 0.0 \"A\u{202E}B\"\n", "\t> 0.0\t\"A\rB\"\n"]));
}

#[test]
fn long_lines_are_shown_around_the_fault() {
    let long = format!("< 0.0 {}4G {}\n", "41 ".repeat(100), "41 ".repeat(100));
    insta::assert_snapshot!(reports(&[&long]));
}

#[test]
fn columns_count_characters_not_bytes() {
    let error = parse_body("> 0.0 \"ééé\" 4G\n").unwrap_err();
    assert_eq!(error.column, 13);
}

#[test]
fn empty_and_cut_files() {
    for (text, line) in [("", 1), ("\n", 1), ("---\n", 1), ("id: a.b", 2), ("id: a.b\n---", 2)] {
        let error = Trace::parse(text).unwrap_err();
        assert!(matches!(error.kind, ParseErrorKind::MissingKey(_)), "{text:?}");
        assert_eq!((error.line, error.column), (line, 1), "{text:?}");
    }
    let error = Trace::parse(&with_body("")).unwrap_err();
    assert_eq!((error.line, error.column), (10, 1));
    // Any cut is an error or a shorter trace, never a panic.
    for end in (0..HOLD.len()).filter(|end| HOLD.is_char_boundary(*end)) {
        if let Ok(trace) = Trace::parse(&HOLD[..end]) {
            assert!(trace.entries().count() >= 1);
        }
    }
}
