//! What can be written, and its canonical form.

use super::{HOLD, canonical, parse_body, stays, with_body};
use crate::*;

#[test]
fn a_whole_case() {
    let trace = Trace::parse(HOLD).unwrap();
    assert_eq!(trace.format(), HOLD);
    let front = &trace.front;
    assert_eq!(front.clauses, ["xon-xoff.tx.obey-xoff", "xon-xoff.tx.resume"]);
    assert_eq!(front.level, Level::Must);
    let line = LineSettings {
        baud: 9_600,
        data_bits: 8,
        parity: softplug_abi::Parity::None,
        stop_half_bits: 2,
        depth: 1,
        reaction: 0,
    };
    assert_eq!(front.line, line);
    assert_eq!(
        front.config[1],
        Assignment { name: "feed_start".to_owned(), value: "0d 0a".to_owned() }
    );
    assert_eq!(front.permute, Permutations { cuts: true, swap: true, ..Permutations::NONE });
    assert_eq!(trace.inputs().count(), 3);
    assert_eq!(trace.end(), Time(5_000_000));
    let first = trace.entries().next().unwrap();
    assert_eq!(first.line.0, 13);
    assert_eq!(first.what.payload().unwrap().bytes(&NoFiles).unwrap(), b"ABCD");
    assert_eq!(trace.entries().nth(2).unwrap().when, When::at(Time(1_500)));
}

#[test]
fn front_matter_in_any_order_becomes_canonical() {
    let text = "\
origin:generated( fuzz, 18446744073709551615 )
permute: twice cuts
since: 2
modem: dsr- cts+
room: delivery=4096   transmit=1024
config: a=\"x\" b=\"\"  c=\"a;b\" d=é
line: 115200 7E1.5
edge: before
level: should
clauses:  p.b\tp.a
profile: p
title:   A title: with a colon; and more\x20\x20
id: p.case.one

. 1.0
";
    let expected = "\
id: p.case.one
title: A title: with a colon; and more
profile: p
clauses: p.b p.a
level: should
edge: before
line: 115200 7E1.5 depth=1 reaction=0
config: a=x b=\"\" c=\"a;b\" d=\"é\"
room: transmit=1024 delivery=4096
modem: cts+ dsr-
since: 2
origin: generated(fuzz, 18446744073709551615)
permute: cuts twice
---
. 1.000000
";
    let trace = Trace::parse(text).unwrap();
    assert_eq!(trace.format(), expected);
    assert_eq!(Trace::parse(expected), Ok(trace));
}

#[test]
fn every_form_of_line_parity_and_origin() {
    for line in
        ["0 8N1 depth=1 reaction=0", "50 5S1 depth=16 reaction=250", "9600 7O2 depth=1 reaction=0"]
    {
        let text = HOLD.replace("9600 8N1 depth=1 reaction=0", line);
        assert_eq!(Trace::parse(&text).unwrap().format(), text);
    }
    for origin in ["recorded(FANUC 0-MD, 2026-03-01, softplug 0.1)", "generated(xtask, 7)"] {
        let text = HOLD.replace("hand-written", origin);
        assert_eq!(Trace::parse(&text).unwrap().format(), text);
    }
    assert_eq!(
        Trace::parse(&HOLD.replace("cuts swap", "none")).unwrap().front.permute,
        Permutations::NONE
    );
    let all =
        Trace::parse(&HOLD.replace("cuts swap", "rooms cuts after twice later swap")).unwrap();
    assert_eq!(all.front.permute, Permutations::ALL);
    assert!(!all.format().contains("permute"));
}

#[test]
fn times_and_windows() {
    assert_eq!(canonical("< 0.5 41\n"), "< 0.500000 41             ; 'A'\n");
    assert_eq!(canonical("> 1.25~1.250000 \"A\"\n"), "> 1.250000 \"A\"\n");
    stays("> 1.000000~1.500000 \"A\"\n= 1.000000~2.000000 done 1\n! 1.500000~1.600000 break\n");
    stays(". 999999999.999999\n");
    let trace = parse_body("> 1.0~1.5 \"A\"\n").unwrap();
    let when = trace.entries().next().unwrap().when;
    assert!(
        when.contains(Time(1_500_000))
            && !when.contains(Time(1_500_001))
            && !when.contains(Time(999_999))
    );
}

#[test]
fn received_bytes_hold_damage() {
    stays(
        "< 0.000000 \"AB\" ~p31 41 ~fFF ~e00 ; 'AB' ~'1' 'A' ~DEL* ~NUL\n"
            .replace(" ; '", "  ; '")
            .as_str(),
    );
    let trace = parse_body("<< 0.0 41 ~p31 42\n").unwrap();
    let What::Given(Given::Burst(payload)) = &trace.entries().next().unwrap().what else {
        panic!("a burst")
    };
    let pieces = [
        Piece::Bytes(vec![0x41]),
        Piece::Bad { kind: BadKind::Parity, byte: 0x31 },
        Piece::Bytes(vec![0x42]),
    ];
    assert_eq!(payload.pieces(&NoFiles).unwrap(), pieces);
}

#[test]
fn outputs() {
    stays("> 0.000000 rts- dtr+\n> 0.000000 break 250000\n> 0.000000 \"G1\\n\"\n");
    assert_eq!(canonical("> 0.0 dtr+ rts-\n"), "> 0.000000 rts- dtr+\n");
}

#[test]
fn line_events() {
    stays(
        "! 0.000000 cts- dsr+ dcd- ri+\n! 0.000000 break\n! 0.000000 overrun\n! 0.000000 down unplugged\n\
         ! 0.000000 down disconnected\n! 0.000000 down failed\n! 0.000000 up\n\
         ! 0.000000 lineerror parity span=3\n! 0.000000 lineerror parity-or-framing byte=8D span=62\n",
    );
    let lines =
        "! 0.0 lineerror break span=0\n! 0.0 lineerror overrun\n! 0.0 lineerror framing byte=0xd\n";
    assert_eq!(
        canonical(lines),
        "! 0.000000 break\n! 0.000000 overrun\n! 0.000000 lineerror framing byte=0D span=0\n"
    );
}

#[test]
fn host_requests() {
    stays(
        "? 0.000000 send 1 \"%\\nO0001\\n%\"\n? 0.000000 job 2 fetch block=7 name=\"a b\"\n\
         ? 0.000000 job 3 send mode=dnc \"G1\"\n? 0.000000 job 4 reset\n? 0.000000 pause 1\n? 0.000000 resume 1\n\
         ? 0.000000 abort 1\n? 0.000000 abort 0\n? 0.000000 force-resume\n? 0.000000 room transmit=16\n\
         ? 0.000000 room transmit=1 delivery=2\n? 0.000000 drain off\n? 0.000000 drain auto\n\
         ? 0.000000 answer 5 granted\n? 0.000000 answer 5 granted \"data\"\n? 0.000000 answer 5 refused not-found\n\
         ? 0.000000 swap\n? 0.000000 close\n? 0.000000 open\n? 0.000000 send 6 \"\"\n",
    );
    assert_eq!(canonical("? 0.0 job 1 send \"A\"\n"), "? 0.000000 send 1 \"A\"\n");
}

#[test]
fn actions() {
    stays(
        "= 0.000000 deliver 1 \"AB\" complete\n= 0.000000 deliver 1 complete\n\
         = 0.000000 deliver 2 \"A\" failed no-end-mark status=0517 name=\"O1;\\xFE\"\n"
            .replace("\\xFE", "\\\\")
            .as_str(),
    );
    stays(
        "= 0.000000 done 1\n= 0.000000 done 1 sent=18446744073709551615\n= 0.000000 fail 1 aborted sent=4\n\
         = 0.000000 fail 1 no-answer status=00FF sent=0\n= 0.000000 check 1 good\n\
         = 0.000000 check 1 unsupported-character line=3 column=14 status=0001\n\
         = 0.000000 request 1 fetch db=10 length=4\n= 0.000000 withdraw 1\n",
    );
    assert_eq!(
        canonical("= 0.0 deliver 1 name=x \n"),
        "= 0.000000 deliver 1 complete name=\"x\"\n"
    );
    assert_eq!(canonical("= 0.0 fail 1 echo status=0x0\n"), "= 0.000000 fail 1 echo\n");
}

#[test]
fn payloads_keep_their_items() {
    let digest = "0123456789abcdef".repeat(4);
    stays(&format!(
        "? 0.000000 send 1 \"<\" file:{digest} gen:nc(7,1048576) gen:bytes(0,256) gen:text(1,0)\n"
    ));
    assert_eq!(
        canonical(&format!("? 0.0 send 1 gen:nc( 7 , 100 )  file:{}\n", digest.to_uppercase())),
        format!("? 0.000000 send 1 gen:nc(7,100) file:{digest}\n")
    );
    assert_eq!(
        canonical("> 0.0 0a fF   41 \"x\" ;old\n"),
        "> 0.000000 0A FF 41 \"x\"   ; LF DEL* 'Ax'\n"
    );
}

#[test]
fn quoted_text_shows_every_byte() {
    stays("> 0.000000 \"\\\"\\\\\\n\\r\\t\\x00\\x7F\\xFF\\xC3é\"\n");
    // An em dash looks like a hyphen: it becomes its bytes.
    assert_eq!(canonical("> 0.0 \"a\u{2014}\tb\"\n"), "> 0.000000 \"a\\xE2\\x80\\x94\\tb\"\n");
    // Escapes that make a letter become the letter.
    assert_eq!(canonical("> 0.0 \"\\xC3\\xA9;#\"\n"), "> 0.000000 \"é;#\"\n");
    let trace = parse_body("> 0.0 \"\\xFF\\x00\"\n").unwrap();
    assert_eq!(
        trace.entries().next().unwrap().what.payload().unwrap().bytes(&NoFiles).unwrap(),
        [0xFF, 0]
    );
}

#[test]
fn comments_and_single_blank_lines_stay() {
    assert_eq!(
        canonical("\n\n#a ; b  \n\n\n  #  c\n< 0.0 41 ; gloss # not a comment\n#\n\n\n"),
        "#a ; b\n\n#  c\n< 0.000000 41             ; 'A'\n#\n"
    );
}

#[test]
fn alternatives_give_variants() {
    let body = "\
? 0.000000 send 1 \"AB\"
{ alt p.may-greet
  # It greets.
  > 0.000000 \"!\"
  > 0.500000 \"AB\"
|
  > 0.000000 \"AB\"
|
}
! 0.250000 break
{ alt p.end
  = 1.000000 done 1
|
  = 1.000000~2.000000 done 1 sent=2
}
";
    stays(body);
    let trace = parse_body(body).unwrap();
    assert_eq!(
        trace.alternatives().map(|block| block.clause.as_str()).collect::<Vec<_>>(),
        ["p.may-greet", "p.end"]
    );
    let variants = trace.variants();
    assert_eq!(variants.iter().map(Vec::len).collect::<Vec<_>>(), [5, 5, 4, 4, 3, 3]);
    let times: Vec<u64> = variants[0].iter().map(|entry| entry.when.from.0).collect();
    assert_eq!(times, [0, 0, 250_000, 500_000, 1_000_000]);
    assert_eq!(trace.end(), Time(2_000_000));
    assert_eq!(trace.inputs().count(), 2);
}

#[test]
fn line_ends_of_windows_and_a_missing_last_one() {
    let windows = HOLD.replace('\n', "\r\n");
    assert_eq!(Trace::parse(&windows).unwrap().format(), HOLD);
    assert_eq!(Trace::parse(HOLD.trim_end()).unwrap().format(), HOLD);
}

#[test]
fn the_source_line_is_known_but_does_not_count() {
    let one = parse_body("# a\n. 1.0\n").unwrap();
    let two = parse_body("# a\n\n. 1.0\n").unwrap();
    assert_eq!(one.entries().next().unwrap().line.0 + 1, two.entries().next().unwrap().line.0);
    assert_eq!(one.entries().next(), two.entries().next());
    assert_ne!(with_body("# a\n. 1.0\n"), with_body("# a\n\n. 1.0\n"));
}

#[test]
fn the_example_of_the_documentation_is_the_case_of_the_corpus() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/trace-format.md");
    let document = std::fs::read_to_string(path).unwrap();
    let whole = document.split("```").find(|block| block.starts_with("spt,file="));
    let (_, example) = whole.unwrap().split_once('\n').unwrap();
    let case =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt");
    assert_eq!(std::fs::read_to_string(case).unwrap().trim_end(), example.trim_end());
    let trace = Trace::parse(example).unwrap_or_else(|error| panic!("{}", error.report(path)));
    assert_eq!(trace.format(), example);
}

#[test]
fn exact_events() {
    stays(
        "@ 0.000000 under-way job=3 pass=run requests=1,2\n\
         @ 0.000000 open 01 08 00 02  ; SOH BS NUL STX\n\
         @ 0.000000 save\n\
         @ 0.001500 received 47 31 13  ; 'G1' DC3=XOFF\n\
         . 1.000000\n",
    );
    let trace = parse_body("@ 0.0 received \"G1\"\n").unwrap();
    assert!(trace.is_recording() && trace.inputs().count() == 1);
    assert!(!Trace::parse(HOLD).unwrap().is_recording());
    for wrong in
        ["@ 0.0~1.0 received 41", "@ 0.0", "@ 0.0 received ~p41", "@ 0.0 under-way a=1 a=2"]
    {
        assert!(parse_body(&format!("{wrong}\n")).is_err(), "{wrong}");
    }
}

#[test]
fn what_a_case_leaves_and_a_class_of_bytes_are_read() {
    let more = "permute: later after\nleaves: the line held\nbytes: 58 = 00-0F 11-FF\n";
    let text = HOLD.replace("permute: cuts swap\n", more);
    let trace = Trace::parse(&text).unwrap();
    let Permutations { later, after, rooms, cuts, .. } = trace.front.permute;
    assert_eq!((later, after, rooms, cuts), (true, true, false, false));
    assert_eq!(trace.front.leaves, "the line held");
    let class = trace.front.bytes.clone().unwrap();
    assert!(class.contains(0x58) && class.contains(0xFF) && !class.contains(0x10));
    assert_eq!(Trace::parse(&trace.format()).unwrap(), trace);
    for (wrong, word) in [
        ("58 = 00-0F", "a class that has the byte that is written"),
        ("58 = 6F-60 58", "a range whose first byte is not above its last"),
        ("58 00-FF", "= and the bytes of the class"),
        ("5 = 00-FF", "a byte as two hex digits"),
    ] {
        let error = Trace::parse(&text.replace("58 = 00-0F 11-FF", wrong)).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
}
