//! The catalogue of machines, and what a program cannot say to one.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::process::Stdio;

use crate::bench::{Bench, Ran, program, snapshot};

/// Not one of them may be there that cannot be spoken to as it says.
#[test]
fn each_machine_can_be_sent_to() {
    let bench = Bench::new();
    bench.write("O1.nc", program("drilling.nc"));
    let all = bench.run(&["machine", "list", "--json"]).with_code(0).json();
    let all = all.as_array().unwrap();
    assert!(all.len() > 10);
    for machine in all {
        let name = machine["name"].as_str().unwrap();
        let words = ["send", "--dry-run", "--machine", name, "--json", "O1.nc"];
        let sent = bench.run(&words).with_code(0).json();
        assert_eq!(sent["result"], "done", "{name}");
        for line in machine["lines"].as_array().into_iter().flatten() {
            let line = ["--line", line.as_str().unwrap()];
            bench.run(&[&words[..], &line[..]].concat()).with_code(0);
        }
    }
}

#[test]
fn what_is_asked_for_stands_above_the_machine() {
    let bench = Bench::new();
    bench.write("O1.nc", "%\nO1\n%\n");
    fs::create_dir(bench.path("own")).unwrap();
    let own = "name = \"own\"\ntitle = \"Own\"\nplugin = \"xon-xoff\"\nline = \"4800 7E1\"\n\
               [settings]\nsend_line_end = \"crlf\"\nfeed_start = \"12\"\nparity_mask = \"127\"\n";
    bench.write("own/own.toml", own);
    let wire = |more: &[&str]| {
        let words =
            ["send", "--dry-run", "--machine", "own", "--machines", "own", "--json", "O1.nc"];
        let sent = bench.run(&[&words[..], more].concat()).with_code(0).json();
        sent["wire"].as_str().unwrap().replace(' ', "")
    };
    assert_eq!(wire(&[]), "12250d0a4f310d0a250d0a");
    assert_eq!(wire(&["--set", "feed_start="]), "250d0a4f310d0a250d0a");
    assert_eq!(wire(&["--set", "send_line_end=lf"]), "12250a4f310a250a");
    // A preset is asked for, too, and the rest is the machine's.
    assert_eq!(wire(&["--set", "preset=parity"]), "12250d0a4f310d0a250d0a");
}

#[test]
fn machines_that_cannot_be_meant_are_told() {
    let bench = Bench::new();
    bench.write("O1.nc", "%\nO1\n%\n");
    let mut all = String::new();
    let mut told = |words: &[&str]| all += &bench.run(words).with_code(2).err;
    told(&["machine", "show", "hass-vf"]);
    told(&["check", "O1.nc", "--machine", "zzz"]);
    told(&["check", "O1.nc", "--machine", "haas-vf", "--plugin", "r3964"]);
    told(&["machine", "list", "--machines", "nowhere"]);
    for (file, text) in [
        ("none.toml", "name = 1"),
        ("name.toml", "name = \"A b\"\ntitle = \"x\"\nplugin = \"xon-xoff\""),
        ("path.toml", "name = \"a\"\ntitle = \"x\"\nplugin = \"../x.wasm\""),
        ("text.toml", "name = \"a\"\ntitle = \"\\u001b[2J\"\nplugin = \"xon-xoff\""),
        ("bidi.toml", "name = \"a\"\ntitle = \"\\u202e\"\nplugin = \"xon-xoff\""),
        ("key.toml", "name = \"a\"\ntitle = \"x\"\nplugin = \"xon-xoff\"\ncolour = 1"),
        ("long.toml", &"#".repeat(70_000)),
    ] {
        fs::create_dir(bench.path("own")).unwrap();
        bench.write(&format!("own/{file}"), text);
        told(&["machine", "list", "--machines", "own"]);
        fs::remove_dir_all(bench.path("own")).unwrap();
    }
    fs::create_dir(bench.path("own")).unwrap();
    let twice = "name = \"a\"\ntitle = \"x\"\nplugin = \"xon-xoff\"";
    bench.write("own/1.toml", twice);
    bench.write("own/2.toml", twice);
    told(&["machine", "list", "--machines", "own"]);
    snapshot("machine-refusals", all);
}

#[test]
fn what_does_not_pass_is_told_with_count_place_and_what_to_write() {
    let bench = Bench::new();
    let text = "%\nO1 (Gr\u{f6}\u{df}e)\nN1 g1\tX1 ;a\nN2 [#1]$\u{1}\nM30\n%\n";
    bench.write("O1.nc", text);
    bench.write("latin.nc", b"%\nO1 (Gr\xf6\xdfe)\n%\n");
    let mut all = String::new();
    let mut told = |file: &str, words: &[&str], code| {
        let ran = bench.run(&[&["check", file][..], words].concat()).with_code(code);
        write!(all, "$ check {file} {}\n{}{}", words.join(" "), ran.out, ran.err).unwrap();
    };
    told("O1.nc", &["--machine", "fanuc-0m"], 1);
    told("O1.nc", &["--machine", "fanuc-0m", "--set", "unsupported=space"], 0);
    told("O1.nc", &["--machine", "fanuc-0m", "--set", "unsupported=drop", "--strict"], 1);
    told("O1.nc", &["--machine", "fanuc-0m", "--set", "preset=eia"], 1);
    told("O1.nc", &["--machine", "haas-vf"], 0);
    told("O1.nc", &["--plugin", "xon-xoff", "--line", "9600 8N1"], 0);
    told("O1.nc", &["--plugin", "r3964"], 0);
    told("latin.nc", &["--machine", "haas-vf"], 0);
    snapshot("check", all);
}

#[test]
fn a_program_that_passes_passes() {
    let bench = Bench::new();
    bench.write("O1.nc", program("drilling.nc"));
    let ran = bench.run(&["check", "O1.nc", "--machine", "haas-vf", "--json"]).with_code(0).json();
    assert_eq!(ran["result"], "passes");
    assert_eq!(ran["characters"], serde_json::json!([]));
    // What the plug-in takes for its own is refused in a program, and no other character is.
    bench.write("held.nc", "%\nO1\n\u{13}N1\n%\n");
    let ran =
        bench.run(&["check", "held.nc", "--machine", "haas-vf", "--json"]).with_code(1).json();
    assert_eq!(ran["result"], "refused");
    assert_eq!(ran["characters"][0]["character"], "byte 13");
    assert_eq!(ran["characters"].as_array().unwrap().len(), 1, "{ran}");
}

#[test]
fn a_program_that_does_not_say_its_name_as_the_machine_wants_it_is_remarked_on() {
    let bench = Bench::new();
    let told = |text: &str, machine: &str| {
        bench.write("P.nc", text);
        bench.run(&["check", "P.nc", "--machine", machine]).with_code(0).err
    };
    assert_eq!(told("%\nO12 (X)\nM30\n%\n", "fanuc-0m"), "");
    assert_eq!(
        told("%\nN1 G0\nM30\n%\n", "fanuc-0m"),
        "P.nc does not say its name as fanuc-0m wants it: O{number}\n"
    );
    assert_eq!(
        told("%\nO12345\nM30\n%\n", "fanuc-0m"),
        "P.nc is called O12345, and a number has 4 digits on fanuc-0m\n"
    );
    assert_eq!(told("%\nO12345\nM30\n%\n", "haas-vf"), "");
    assert_eq!(told("G0 X1\nM30\n", "heidenhain-tnc"), "");
}

#[test]
fn a_program_may_come_from_standard_input() {
    let bench = Bench::new();
    let words = ["check", "-", "--machine", "fanuc-0m", "--json"];
    let mut child = bench
        .command(&words)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(b"%\nO1\ng1\n%\n").unwrap();
    let ran = Ran::from(child.wait_with_output().unwrap()).with_code(0).json();
    assert_eq!((&ran["bytes"], &ran["result"]), (&10.into(), &"altered".into()));
    assert_eq!(ran["characters"][0]["what"], "sent as G");
}
