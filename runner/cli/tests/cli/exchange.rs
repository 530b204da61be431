//! Traces from and for other tools.

use std::fmt::Write as _;

use crate::bench::{Bench, snapshot};

const TRACE: &str = "\
id: xon-xoff.tx.exchanged
title: A case for other tools
profile: xon-xoff
clauses: xon-xoff.tx.at-once
level: must
line: 9600 8E1 depth=1 reaction=0
modem: cts+
since: 1
origin: hand-written
---
? 0.000000 send 1 gen:nc(1,100)
> 0.000000 gen:nc(1,100)
<< 0.200000 41 ~p42 43    ; 'A' ~'B' 'C'
< 0.300000 ~f13           ; ~DC3=XOFF
! 0.400000 cts-
! 0.500000 break
= 0.600000 done 1
";

/// What of it any format can hold.
const PLAIN: &str = "\
> 0.000000 \"N0010 G1 X-22.035 Y-96.643\\nM30\\n\"
< 0.200000 13             ; DC3=XOFF
<< 0.300000 \"AB\"
";

fn plain() -> String {
    let (front, _) = TRACE.split_once("---\n").unwrap();
    format!("{front}---\n{PLAIN}")
}

/// Runs `softplug` with the words of `line`.
fn run(bench: &Bench, line: &str) -> crate::bench::Ran {
    bench.run(&line.split(' ').collect::<Vec<_>>())
}

const IMPORT: &str = "--id xon-xoff.tx.exchanged --clause xon-xoff.tx.at-once --level must --title T --date 2026-03-01";

#[test]
fn a_trace_goes_out_and_comes_back() {
    let bench = Bench::new();
    bench.write("case.spt", plain());
    for format in ["pcapng", "hexdump", "candump", "saleae"] {
        let out = format!("out.{format}");
        run(&bench, &format!("trace export case.spt --format {format} --out {out} -q"))
            .with_code(0);
        let mut words: Vec<_> = IMPORT.split(' ').collect();
        words.extend(["--line", "9600 8E1", "--force", "--out", "xon-xoff.tx.exchanged.spt"]);
        let ran = bench.run(&[&["trace", "import", &out, "--format", format], &words[..]].concat());
        let ran = ran.with_code(0);
        assert_eq!(ran.err, "", "{format}");
        assert_eq!(ran.out, "xon-xoff.tx.exchanged.spt: 3 events\n");
        let text = String::from_utf8(bench.read("xon-xoff.tx.exchanged.spt")).unwrap();
        assert_eq!(text.split_once("---\n").unwrap().1, PLAIN, "{format}");
        assert!(
            text.contains(&format!("origin: recorded(unknown, 2026-03-01, {format})")),
            "{text}"
        );
        run(&bench, "trace fmt --check xon-xoff.tx.exchanged.spt").with_code(0);
    }
}

#[test]
fn what_cannot_be_held_is_told() {
    let bench = Bench::new();
    bench.write("case.spt", TRACE);
    let mut text = String::new();
    for format in ["pcapng", "hexdump", "candump", "saleae"] {
        let line = format!("trace export case.spt --format {format} --out out.{format}");
        let ran = run(&bench, &line).with_code(0);
        let _ = write!(text, "$ softplug {line}\n{ran}");
    }
    let line = "trace export case.spt --format candump --out out.candump --force --json";
    let json = run(&bench, line).with_code(0);
    assert_eq!(json.json()["notes"][1]["what"], "requests");
    let _ = write!(text, "$ softplug {line}\n{json}");
    snapshot("exchange-notes", text);
    snapshot("exchange-candump", String::from_utf8(bench.read("out.candump")).unwrap());
}

#[test]
fn an_import_tells_where_it_is_from() {
    let bench = Bench::new();
    // The evening of 2026-02-28.
    bench.write("lathe.log", "(1772312400.25) ttyS0#11 R\n(1772312401.25) ttyS0#4142 T\n");
    let words = ["--id", "p.case", "--line", "4800 7E2", "--out", "case.spt"];
    let import = ["trace", "import", "lathe.log", "--format", "candump"];
    let words = [&import[..], &words[..]].concat();
    let ran = bench.run(&words).with_code(0);
    let text = format!("{ran}{}", String::from_utf8(bench.read("case.spt")).unwrap());
    snapshot("exchange-import", text);
    let json = bench.run(&[&words[..], &["--force", "--json"]].concat()).with_code(0).json();
    assert_eq!((&json["events"], &json["zero"]), (&2.into(), &1_772_312_400_250_000_i64.into()));
}

#[test]
fn what_cannot_be_exchanged_is_refused() {
    let bench = Bench::new();
    bench.write("case.spt", TRACE);
    bench.write("wrong.spt", TRACE.replace("? 0.0", "? 0,0"));
    bench.write("file.spt", TRACE.replace("gen:nc(1,100)", &format!("file:{}", "0".repeat(64))));
    bench.write("lathe.log", "(0.5) port#11 R\n(0.6) port#1 R\n");
    bench.write("good.log", "(0.5) port#11 R\n");
    bench.write("text.txt", "G1X1\n");
    let import = "--id p.case --line 9600~8N1 --out out.spt";
    let text: Vec<String> = [
        "trace export none.spt --format pcapng --out out".to_owned(),
        "trace export wrong.spt --format pcapng --out out".to_owned(),
        "trace export file.spt --format pcapng --out out".to_owned(),
        "trace export case.spt --format pcap --out out".to_owned(),
        "trace export case.spt --format pcapng --out good.log".to_owned(),
        format!("trace import none --format candump {import}"),
        format!("trace import lathe.log --format candump {import}"),
        format!("trace import text.txt --format pcapng {import}"),
        format!("trace import good.log good.log --format candump {import}"),
        "trace import good.log --format candump --id p --line 9600~8N1 --out out.spt".to_owned(),
        "trace import good.log --format candump --id p.a --line fast --out out.spt".to_owned(),
        format!("trace import good.log --format candump --device a,b {import}"),
        format!("trace import good.log --format candump --title a\nb {import}"),
        "trace import good.log --format candump --out case.spt --id p.case --line 9600~8N1"
            .to_owned(),
    ]
    .iter()
    .map(|line| {
        let words: Vec<_> = line.split(' ').map(|word| word.replace('~', " ")).collect();
        let ran = bench.run(&words).with_code(2);
        assert_eq!(ran.out, "", "{line}");
        format!("$ softplug {line}\n{}\n", ran.err)
    })
    .collect();
    snapshot("exchange-refusals", text.concat());
    let json =
        run(&bench, "trace export none.spt --format pcapng --out out --json").with_code(2).json();
    assert_eq!(json["error"]["code"], 2);
    let names = ["case.spt", "file.spt", "good.log", "lathe.log", "text.txt", "wrong.spt"];
    assert_eq!(bench.names(), names);
}

#[test]
fn a_file_of_the_trace_is_found_beside_it() {
    let bench = Bench::new();
    // SHA-256 of "abc".
    let digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    bench.write(&format!("files/{digest}"), "abc");
    bench.write(
        "p/case.spt",
        TRACE.replace("> 0.000000 gen:nc(1,100)", &format!("> 0.000000 file:{digest}")),
    );
    run(&bench, "trace export p/case.spt --format candump --out out -q").with_code(0);
    let text = String::from_utf8(bench.read("out")).unwrap();
    assert!(text.starts_with("(0.000000) port#616263 T\n"), "{text}");
}

mod needs_tshark {
    use std::process::Command;

    use super::*;

    /// Runs a program of Wireshark's in the bench's folder; what it prints.
    fn wireshark(bench: &Bench, program: &str, words: &[&str]) -> String {
        let output = Command::new(program)
            .args(words)
            .current_dir(bench.path("."))
            // No profile of whoever runs the test.
            .env("HOME", bench.path("."))
            .env_remove("XDG_CONFIG_HOME")
            .output()
            .unwrap_or_else(|error| panic!("{program} (Debian package tshark): {error}"));
        let err = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program} {words:?}: {err}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// The fields of each packet, with commas between them.
    fn fields(bench: &Bench, file: &str, fields: &[&str]) -> Vec<String> {
        let mut words = vec!["-n", "-r", file, "-T", "fields", "-E", "separator=,"];
        for field in fields {
            words.extend(["-e", field]);
        }
        wireshark(bench, "tshark", &words).lines().map(str::to_owned).collect()
    }

    #[test]
    fn a_capture_shows_what_happened() {
        let bench = Bench::new();
        bench.write("case.spt", TRACE.replace("gen:nc(1,100)", "41 42"));
        run(&bench, "trace export case.spt --format pcapng --out case.pcapng -q").with_code(0);
        let shown = fields(
            &bench,
            "case.pcapng",
            &[
                "frame.time_epoch",
                "rtacser.eventtype",
                "rtacser.cts",
                "rtacser.rts",
                "frame.packet_flags_direction",
                "rtacser.timestamp",
            ],
        );
        snapshot("exchange-tshark", shown.join("\n"));
        let lengths = fields(&bench, "case.pcapng", &["frame.len"]);
        assert_eq!(lengths, ["12", "14", "13", "13", "13", "13", "12", "12"]);
        let dump = wireshark(
            &bench,
            "tshark",
            &["-n", "-r", "case.pcapng", "-Y", "rtacser.eventtype == 8", "-x"],
        );
        // The damaged character stands behind the twelve bytes of the header.
        assert!(
            dump.lines().any(|line| line.starts_with("0000") && line.contains(" 08 01 00 00 42 ")),
            "{dump}"
        );
    }

    #[test]
    fn a_hex_dump_goes_through_text2pcap_and_back() {
        let bench = Bench::new();
        bench.write("case.spt", plain());
        run(&bench, "trace export case.spt --format hexdump --out case.txt -q").with_code(0);
        let words = ["-q", "-D", "-t", "%s.%f", "-l", "147", "case.txt", "case.pcapng"];
        wireshark(&bench, "text2pcap", &words);
        let words = [
            "trace",
            "import",
            "case.pcapng",
            "--format",
            "pcapng",
            "--line",
            "9600 8E1",
            "--out",
            "back.spt",
        ];
        let words = [&words[..], &IMPORT.split(' ').collect::<Vec<_>>()].concat();
        bench.run(&words).with_code(0);
        let text = String::from_utf8(bench.read("back.spt")).unwrap();
        assert_eq!(text.split_once("---\n").unwrap().1, PLAIN);
    }

    #[test]
    fn a_capture_that_wireshark_has_saved_again_is_the_same() {
        let bench = Bench::new();
        bench.write("case.spt", TRACE);
        run(&bench, "trace export case.spt --format pcapng --out case.pcapng -q").with_code(0);
        wireshark(&bench, "tshark", &["-n", "-r", "case.pcapng", "-w", "again.pcapng"]);
        wireshark(&bench, "tshark", &["-n", "-r", "case.pcapng", "-F", "pcap", "-w", "again.pcap"]);
        let import = |file: &str| {
            let words = [
                "trace", "import", file, "--format", "pcapng", "--line", "9600 8E1", "--force",
                "--out", "back.spt",
            ];
            bench.run(&[&words[..], &IMPORT.split(' ').collect::<Vec<_>>()].concat()).with_code(0);
            bench.read("back.spt")
        };
        let first = import("case.pcapng");
        assert_eq!(import("again.pcapng"), first);
        assert_eq!(import("again.pcap"), first);
    }
}
