//! Cases from records, and what blessing keeps.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::bench::{Bench, Ran};
use crate::files::TRACE;

/// The front matter of a record of 3964R.
const HEAD: &str = "id: r3964.session\ntitle: Recorded between two partners\nprofile: r3964\n\
                    clauses: r3964.recorded\nlevel: may\nline: 9600 8N1 depth=1 reaction=0\n\
                    config: nak_at_start=off\nsince: 1\n\
                    origin: recorded(a press, 2026-11-21, softplug 0.1.0)\n---\n";
/// A block that is taken, with `ABC` in it: the answers come as on a live line, somewhat late.
const BLOCK: &str = "> 0.0 02\n< 0.005 10\n> 0.0052 41\n> 0.0063 42\n> 0.0074 43\n> 0.0085 10\n\
                     > 0.0096 03\n> 0.0107 53\n< 0.015 10\n";

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

/// `softplug trace case` of a record with this body.
fn case(bench: &Bench, body: &str, options: &[&str]) -> Ran {
    bench.run(&to_case(bench, body, options))
}

fn to_case<'a>(bench: &Bench, body: &str, options: &[&'a str]) -> Vec<&'a str> {
    bench.write("record.spt", format!("{HEAD}{body}"));
    let words = ["trace", "case", "record.spt", "--out", "case.spt", "--force", "--json"];
    [&words[..], options].concat()
}

fn written(bench: &Bench) -> String {
    String::from_utf8(bench.read("case.spt")).unwrap()
}

/// Lines of a kind, without their times and readings.
fn lines(text: &str, sign: &str) -> Vec<String> {
    let lines = text.lines().filter_map(|line| line.strip_prefix(sign)?.strip_prefix(' '));
    let bare = lines.map(|line| {
        let what = line.split_once(' ').map_or("", |(_, what)| what);
        what.split("  ;").next().unwrap_or(what).trim().to_owned()
    });
    bare.collect()
}

/// What the plug-in was given and does in a live session is all in the record, but for settings
/// and requests: with them each record of `fixtures/recordings/raw` is a case in one step, which
/// passes in all permutations and ends as the case that was made of it by hand.
#[test]
fn every_raw_record_becomes_its_case() {
    let bench = Bench::new();
    let mut records: Vec<_> = fs::read_dir(fixtures().join("recordings/raw")).unwrap().collect();
    records.sort_by_key(|entry| entry.as_ref().unwrap().file_name());
    assert_eq!(records.len(), 42);
    for record in records {
        let record = record.unwrap().path();
        let name = record.file_name().unwrap().to_str().unwrap().to_owned();
        let profile = name.split('.').next().unwrap();
        let plugin = match profile {
            "3964" | "rk512" => "r3964",
            other => other,
        };
        let by_hand =
            fs::read_to_string(fixtures().join("traces").join(profile).join(&name)).unwrap();
        let config = by_hand.lines().find_map(|line| line.strip_prefix("config: "));
        let settings = config.unwrap_or_default().split(' ').filter(|word| !word.is_empty());
        let settings = settings.flat_map(|pair| ["--set".to_owned(), pair.replace('"', "")]);
        let asked = lines(&by_hand, "?").into_iter().flat_map(|what| ["--ask".to_owned(), what]);
        let words = ["trace", "case", record.to_str().unwrap(), "--out", &name, "--plugin", plugin];
        let words = words.into_iter().map(str::to_owned).chain(settings).chain(asked);
        bench.run(&words.collect::<Vec<_>>()).with_code(0);
        let made = String::from_utf8(bench.read(&name)).unwrap();
        bench.run(&["replay", plugin, &name]).with_code(0);
        bench.run(&["trace", "fmt", "--check", &name]).with_code(0);
        let (ours, theirs) = (lines(&made, "="), lines(&by_hand, "="));
        if name == "r3964.rx.recorded-linux-lost-end.spt" {
            // By hand it was waited longer than recorded, until the block wait time was over.
            assert_eq!((&ours[..], theirs.len()), (&theirs[..1], 2));
        } else {
            assert_eq!(ours, theirs, "{name}");
        }
        // Where many characters came, they came at the line's rate.
        let came =
            fs::read_to_string(&record).unwrap().lines().filter(|l| l.starts_with('<')).count();
        let kept = made.lines().filter(|line| line.starts_with('<')).count();
        assert!(came < 50 || kept < came / 3, "{name}: {came} lines became {kept}");
    }
}

#[test]
fn a_request_stands_where_its_bytes_begin() {
    let bench = Bench::new();
    bench.write("telegram.bin", "ABC");
    for how in [["--send", "telegram.bin"], ["--ask", "send 1 \"ABC\""]] {
        let options = [&["--plugin", "r3964"][..], &how].concat();
        let json = case(&bench, &format!("{BLOCK}. 1.0\n"), &options).with_code(0).json();
        assert_eq!(json["case"], true, "{json}");
        let body = written(&bench).split_once("---\n").unwrap().1.to_owned();
        assert_eq!(
            body,
            "? 0.000000 send 1 \"ABC\"\n> 0.000000 02             ; STX\n\
             < 0.005000 10             ; DLE\n> 0.005000 41 42 43 10 03 53  ; 'ABC' DLE ETX 'S'\n\
             < 0.015000 10             ; DLE\n= 0.015000 done 1 sent=7\n. 1.000000\n"
        );
        bench.run(&["replay", "r3964", "case.spt"]).with_code(0);
    }
}

#[test]
fn two_jobs_each_have_their_place() {
    let bench = Bench::new();
    let mut again = String::new();
    for line in BLOCK.lines() {
        let mut words = line.splitn(3, ' ');
        let sign = words.next().unwrap();
        let at: f64 = words.next().unwrap().parse().unwrap();
        let _ = writeln!(again, "{sign} {:.6} {}", at + 3.0, words.next().unwrap());
    }
    bench.write("telegram.bin", "ABC");
    let options = ["--plugin", "r3964", "--send", "telegram.bin", "--send", "telegram.bin"];
    case(&bench, &format!("{BLOCK}{again}. 4.0\n"), &options).with_code(0);
    let text = written(&bench);
    assert!(text.contains("? 0.000000 send 1 ") && text.contains("? 3.000000 send 2 "), "{text}");
    assert_eq!(lines(&text, "="), ["done 1 sent=7", "done 2 sent=7"]);
    // One job of two that were: the record stays, and says where it parts.
    let json = case(&bench, &format!("{BLOCK}{again}. 4.0\n"), &options[..4]).with_code(1).json();
    let standing = json["standing"].as_str().unwrap();
    assert!(
        standing.starts_with(
            "recorded was 02 41 42 43 10 03 53 at 3.000000 s, the plug-in sends 15 at "
        ),
        "{standing}"
    );
    assert!(standing.ends_with("the 7 bytes before agree"), "{standing}");
}

#[test]
fn what_is_no_case_keeps_its_lines_and_says_where() {
    let bench = Bench::new();
    bench.write("other.bin", "ABD");
    let options = ["--plugin", "r3964", "--send", "other.bin"];
    let json = case(&bench, &format!("{BLOCK}. 1.0\n"), &options).with_code(1).json();
    assert_eq!(json["case"], false);
    let text = written(&bench);
    assert!(text.contains("# No case of r3964 yet: recorded was 43 10 03 53 at 0.007"), "{text}");
    let sent = lines(&text, ">");
    assert_eq!(sent, ["02", "41 42 43 10 03", "53"], "{text}");
    // Blessing it would lose them, and so does not go on without a word.
    let ran = bench.run(&["replay", "r3964", "case.spt", "--bless"]).with_code(1);
    assert!(ran.err.contains("no longer sends"), "{ran}");
    assert_eq!(written(&bench), text);
}

#[test]
fn a_record_that_ends_in_the_middle_is_a_case_until_there() {
    let bench = Bench::new();
    bench.write("telegram.bin", "ABC");
    let options = ["--plugin", "r3964", "--send", "telegram.bin"];
    // The recording ended while a block was on its way.
    let cut = BLOCK.lines().take(4).collect::<Vec<_>>().join("\n") + "\n";
    let json = case(&bench, &cut, &options).json();
    assert_eq!(json["case"], true, "{json}");
    bench.run(&["replay", "r3964", "case.spt"]).with_code(0);
    // Our side went on when the recording had ended: nothing is made up of it.
    assert!(lines(&written(&bench), "=").is_empty());
    // The command had ended, and the partner went on.
    let late = format!("{BLOCK}< 4.0 02\n< 4.2 02\n. 5.0\n");
    let json = case(&bench, &late, &options).with_code(0).json();
    let standing = json["standing"].as_str().unwrap();
    assert!(standing.contains("until 3.999999 s; what came later is left out"), "{standing}");
    let text = written(&bench);
    assert!(text.contains("# What came after 3.999999 s is left out") && !text.contains("< 4."));
    bench.run(&["replay", "r3964", "case.spt"]).with_code(0);
}

#[test]
fn a_delivery_that_a_pause_ends_is_waited_for() {
    let bench = Bench::new();
    let record = format!("{HEAD}<< 0.0 \"%\\nO1\\nM30\\n%\\n\"\n. 0.1\n")
        .replace("r3964", "xon-xoff")
        .replace("nak_at_start=off", "quiet_time=2000");
    bench.write("record.spt", record);
    let words = ["trace", "case", "record.spt", "--out", "case.spt", "--plugin", "xon-xoff"];
    bench.run(&words).with_code(0);
    let text = written(&bench);
    assert_eq!(lines(&text, "=").len(), 1, "{text}");
    assert!(text.contains("# Nothing came any more; recorded until 0.1"), "{text}");
    bench.run(&["replay", "xon-xoff", "case.spt"]).with_code(0);
}

#[test]
fn odd_records_end_in_a_sentence() {
    let bench = Bench::new();
    bench.write("telegram.bin", (0..=255).collect::<Vec<u8>>());
    let ours = ["--plugin", "r3964"];
    // Silence is one; so are line errors alone, to which 3964R says nothing.
    case(&bench, ". 0.0\n", &ours).with_code(0);
    case(&bench, "! 0.0 lineerror parity byte=41 span=0\n! 0.5 break\n. 1.0\n", &ours).with_code(0);
    assert!(written(&bench).contains("! 0.500000 break"));
    // Damage in a block, and every byte there is.
    case(&bench, "< 0.0 ~p02\n< 0.5 ~f10\n. 1.0\n", &ours);
    case(&bench, "< 0.0 gen:bytes(1,4096)\n. 1.0\n", &ours);
    // Nothing was sent, but should have been.
    let sends = [&ours[..], &["--send", "telegram.bin"]].concat();
    let json = case(&bench, ". 1.0\n", &sends).with_code(1).json();
    assert!(
        json["standing"]
            .as_str()
            .unwrap()
            .starts_with("recorded was nothing, the plug-in sends 02"),
        "{json}"
    );
    // Another plug-in than stood there, and one that lacks its settings.
    let body = format!("{BLOCK}. 1.0\n");
    let json = case(&bench, &body, &["--plugin", "xon-xoff"]).with_code(1).json();
    assert!(json["standing"].as_str().unwrap().contains("nak_at_start"), "{json}");
    bench
        .run(&[
            "trace",
            "case",
            "record.spt",
            "--out",
            "x.spt",
            "--plugin",
            "r3964",
            "--set",
            "no=1",
        ])
        .with_code(2);
    let json = case(&bench, &body, &["--plugin", "r3964", "--ask", "job 1 no-such 41"])
        .with_code(1)
        .json();
    assert!(json["standing"].as_str().unwrap().contains("no-such"), "{json}");
    // What is no record.
    case(&bench, "< 0.0 4\n", &ours).with_code(2);
    case(&bench, "@ 0.0 open\n", &ours).with_code(2);
    case(&bench, &body, &["--plugin", "r3964", "--ask", "G1"]).with_code(2);
    case(&bench, &body, &["--plugin", "r3964", "--id", "Not a slug"]).with_code(2);
    bench.write("empty.bin", "");
    case(&bench, &body, &["--plugin", "r3964", "--send", "empty.bin"]).with_code(2);
    bench
        .run(&["trace", "case", "record.spt", "--out", "case.spt", "--plugin", "r3964"])
        .with_code(2);
    bench.write("noise.spt", [0xFF, 0x00, 0xC3, 0x28]);
    bench.run(&["trace", "case", "noise.spt", "--out", "x.spt", "--plugin", "r3964"]).with_code(2);
    assert!(!bench.names().contains(&"x.spt".to_owned()));
}

/// Text that somebody else has written stands in a comment, and nowhere else.
#[test]
fn a_hostile_record_stays_in_its_lines() {
    let bench = Bench::new();
    let body = "# r3964 would have sent \u{e9}.\n< 999999999.0 02\n> 999999999.5 41\n";
    case(&bench, body, &["--plugin", "r3964"]).with_code(1);
    bench.run(&["trace", "fmt", "--check", "case.spt"]).with_code(0);
    // A line for each of many characters at one time, both ways.
    let mut body = String::new();
    for n in 0..20_000 {
        let _ = writeln!(body, "< {}.0 02\n> {}.5 41", n / 100, n / 100);
    }
    let mut lines: Vec<_> = body.lines().collect();
    lines.sort_by_key(|line| {
        let at: f64 = line.split(' ').nth(1).unwrap().parse().unwrap();
        (at * 10.0) as u64
    });
    bench.write("telegram.bin", "ABC");
    let options = ["--plugin", "r3964", "--send", "telegram.bin"];
    case(&bench, &(lines.join("\n") + "\n"), &options).with_code(1);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_leaves_no_case() {
    let bench = Bench::new();
    let words = to_case(&bench, BLOCK, &["--plugin", "r3964"]);
    let ran = Ran::from(bench.without_room(&words).output().unwrap()).with_code(2);
    assert!(ran.out.contains("cannot write case.spt"), "{ran}");
    assert!(!bench.path("case.spt").exists());
}

#[test]
fn a_long_program_stands_beside_the_case() {
    let bench = Bench::new();
    let program: Vec<u8> = "N10 G1 X1.5 Y2.5\n".bytes().cycle().take(70_000).collect();
    bench.write("program.nc", &program);
    let options = ["--plugin", "r3964", "--send", "program.nc"];
    case(&bench, BLOCK, &options).with_code(1);
    assert!(written(&bench).contains("send 1 file:"));
    assert_eq!(Bench::names_in(&bench.path("files")).len(), 1);
}

#[test]
fn blessing_loses_no_byte_without_force() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    let wrong = TRACE.replace("41             ; 'A'", "43             ; 'C'");
    bench.write(file, &wrong);
    let bless = ["replay", "xon-xoff", file, "--bless"];
    let ran = bench.run(&bless).with_code(1);
    let text = ran.to_string();
    for told in [
        "xon-xoff.tx.first.spt: xon-xoff no longer sends 1 of",
        "recorded 43, sent 41 at ",
        "error: nothing was written: by blessing, 1 trace would lose bytes",
        "--force",
    ] {
        assert!(text.contains(told), "{told} in {text}");
    }
    assert_eq!(String::from_utf8(bench.read(file)).unwrap(), wrong);
    let json = bench.run(&[&bless[..], &["--json"]].concat()).with_code(1).json();
    assert_eq!(
        (&json["lost"][0]["recorded"], &json["lost"][0]["sent"]),
        (&"43".into(), &"41".into())
    );
    assert_eq!((&json["traces"], json["blessed"].as_array().unwrap().len()), (&1.into(), 0));
    let ran = bench.run(&[&bless[..], &["--force"]].concat()).with_code(0);
    assert!(
        ran.err.starts_with("note: xon-xoff.tx.first.spt: xon-xoff no longer sends 1 of"),
        "{ran}"
    );
    assert_eq!(String::from_utf8(bench.read(file)).unwrap(), TRACE);
    bench.run(&["replay", "xon-xoff", file, "--force"]).with_code(2);
}

#[test]
fn answers_that_were_not_there_are_blessed_at_once() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    let kept = TRACE.lines().filter(|line| !line.starts_with(['>', '=']));
    let bare = kept.collect::<Vec<_>>().join("\n") + "\n";
    bench.write(file, &bare);
    let ran = bench.run(&["replay", "xon-xoff", file, "--bless"]).with_code(0);
    assert!(ran.err.is_empty(), "{ran}");
    bench.run(&["replay", "xon-xoff", file]).with_code(0);
    // Times alone are nothing that is lost.
    let late = TRACE.replace("> 0.001042 ", "> 0.001100 ");
    assert_ne!(late, TRACE);
    bench.write(file, late);
    bench.run(&["replay", "xon-xoff", file, "--bless"]).with_code(0);
    assert_eq!(String::from_utf8(bench.read(file)).unwrap(), TRACE);
}

#[test]
fn a_delivery_that_is_under_way_at_the_end_is_told() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    let (head, _) = TRACE.split_once("---\n").unwrap();
    let bless = |head: &str| {
        bench.write(file, format!("{head}---\n< 0.100000 \"abc\"\n. 0.200000\n"));
        bench.run(&["replay", "xon-xoff", file, "--bless"]).with_code(0).err
    };
    let told = bless(head);
    assert!(told.contains("note: xon-xoff.tx.first.spt: a delivery is under way"), "{told}");
    assert_eq!(bless(&format!("{head}leaves: a delivery under way\n")), "");
}

#[test]
fn a_trace_that_asks_for_what_no_host_does_is_refused() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    let (head, _) = TRACE.split_once("---\n").unwrap();
    for (lines, reason) in [
        ("? 0.100000 close\n? 0.200000 send 2 \"B\"\n", "a closed link takes no job"),
        ("! 0.100000 down failed\n< 0.200000 \"B\"\n", "nothing comes over a port that is down"),
    ] {
        bench.write(file, format!("{head}---\n{lines}. 1.000000\n"));
        let told = bench.run(&["replay", "xon-xoff", file, "--bless"]).with_code(1).err;
        assert!(told.contains(&format!(": {reason}")) && told.contains("line "), "{told}");
    }
}

/// One of many is enough: none is written.
#[test]
fn of_several_traces_none_is_blessed_where_one_loses() {
    let bench = Bench::new();
    let other = TRACE.replace("xon-xoff.tx.first", "xon-xoff.tx.other");
    let late = TRACE.replace("> 0.001042 ", "> 0.001100 ");
    let wrong = other.replace("41             ; 'A'", "43             ; 'C'");
    bench.write("xon-xoff/xon-xoff.tx.first.spt", &late);
    bench.write("xon-xoff/xon-xoff.tx.other.spt", &wrong);
    bench.run(&["replay", "xon-xoff", "xon-xoff", "--bless"]).with_code(1);
    let read = |name: &str| String::from_utf8(bench.read(&format!("xon-xoff/{name}.spt"))).unwrap();
    assert_eq!((read("xon-xoff.tx.first"), read("xon-xoff.tx.other")), (late, wrong));
    bench.run(&["replay", "xon-xoff", "xon-xoff", "--bless", "--force"]).with_code(0);
    assert_eq!((read("xon-xoff.tx.first"), read("xon-xoff.tx.other")), (TRACE.to_owned(), other));
}

/// A partner that is quicker than the wire: in virtual time its answer is there before our STX has
/// left, and the job fails though every byte is sent. Blessing says so.
#[test]
fn a_job_that_fails_in_the_case_is_told() {
    let bench = Bench::new();
    let body =
        format!("? 0.0 send 1 \"ABC\"\n{BLOCK}. 30.0\n").replace("< 0.005 10", "< 0.0002 10");
    bench.write("r3964.session.spt", format!("{HEAD}{body}"));
    let bless = ["replay", "r3964", "r3964.session.spt", "--bless"];
    let ran = bench.run(&bless).with_code(0);
    assert!(ran.err.contains("job 1 fails at "), "{ran}");
    assert!(ran.err.contains("r3964 sends 7 bytes that did not stand there"), "{ran}");
    // It is told once: then it stands there.
    assert!(bench.run(&bless).with_code(0).err.is_empty());
    bench.write("r3964.session.spt", format!("{HEAD}{body}"));
    let json = bench.run(&[&bless[..], &["--json"]].concat()).with_code(0).json();
    assert_eq!(json["notes"].as_array().unwrap().len(), 2, "{json}");
}

/// What a gateway keeps of a plug-in that failed, made here of the calls of a case: each event with
/// its time, and nothing of what was sent.
fn flight(bench: &Bench, plugin: &str, case: &Path) -> String {
    let case = case.to_str().unwrap();
    bench
        .run(&["replay", plugin, case, "--no-permutations", "--calls", "calls.jsonl"])
        .with_code(0);
    let calls = String::from_utf8(bench.read("calls.jsonl")).unwrap();
    let front = fs::read_to_string(case).unwrap();
    let (front, _) = front.split_once("---\n").unwrap();
    let kept = front.lines().filter(|line| !line.starts_with("config:"));
    let mut text = kept.collect::<Vec<_>>().join("\n");
    text += "\n---\n# A gateway has kept it.\n";
    for call in calls.lines() {
        let call: serde_json::Value = serde_json::from_str(call).unwrap();
        let (Some(name), Some(now)) = (call["name"].as_str(), call["now"].as_i64()) else {
            continue;
        };
        if name == "continue" {
            continue;
        }
        let hex = call["payload"].as_str().unwrap().replace(' ', "").to_uppercase();
        let pairs: Vec<_> = hex.as_bytes().chunks(2).map(|p| str::from_utf8(p).unwrap()).collect();
        let pairs = pairs.join(" ");
        let seconds = format!("{}.{:06}", now / 1_000_000, now % 1_000_000);
        text += format!("@ {seconds} {name} {pairs}").trim_end();
        text.push('\n');
    }
    text
}

#[test]
fn a_flight_recording_becomes_a_case() {
    let traces = fixtures().join("traces");
    for (plugin, case) in [
        ("r3964", "r3964/r3964.rx.recorded-goryachev.spt"),
        ("r3964", "r3964/r3964.tx.recorded-linux-damaged.spt"),
        ("r3964", "rk512/rk512.fetch.recorded-linux-follow-up.spt"),
        ("r3964", "rk512/rk512.serve.recorded-goryachev-fetch.spt"),
        ("fanuc-rs232", "fanuc-rs232/fanuc-rs232.feed.recorded-linuxcnc-dnc.spt"),
        ("xon-xoff", "xon-xoff/xon-xoff.tx.recorded-kernel-crlf.spt"),
    ] {
        let bench = Bench::new();
        let case = traces.join(case);
        bench.write("flight.spt", flight(&bench, plugin, &case));
        bench.run(&["replay", plugin, "flight.spt"]).with_code(0);
        let words = ["trace", "case", "flight.spt", "--plugin", plugin, "--out", "case.spt"];
        bench.run(&words).with_code(0);
        let (made, was) = (written(&bench), fs::read_to_string(&case).unwrap());
        bench.run(&["replay", plugin, "case.spt"]).with_code(0);
        assert_eq!(lines(&made, "="), lines(&was, "="), "{made}");
        assert_eq!(lines(&made, "?"), lines(&was, "?"), "{made}");
        assert!(made.contains("# A gateway has kept it."));
    }
    // It has settings and requests of its own, and begins with the link.
    let bench = Bench::new();
    let case = traces.join("r3964/r3964.rx.recorded-goryachev.spt");
    let text = flight(&bench, "r3964", &case);
    bench.write("flight.spt", &text);
    let words = ["trace", "case", "flight.spt", "--plugin", "r3964", "--out", "case.spt"];
    bench.run(&[&words[..], &["--set", "zvz=100"]].concat()).with_code(2);
    bench.run(&[&words[..3], &["--plugin", "xon-xoff", "--out", "case.spt"]].concat()).with_code(2);
    let begin = text.find("@ ").unwrap();
    bench.write(
        "flight.spt",
        format!("{}@ 0.0 under-way job=1\n{}", &text[..begin], &text[begin..]),
    );
    let ran = bench.run(&words).with_code(2);
    assert!(ran.err.contains("begins in the middle"), "{ran}");
    for wrong in ["@ 0.0 received 41\n", "@ 0.0 no-such\n", "@ 0.0 open 01\n", "@ 0.0 settings\n"] {
        bench.write("flight.spt", format!("{}{wrong}", &text[..begin]));
        bench.run(&words).with_code(2);
    }
    assert!(!bench.path("case.spt").exists());
}
