//! Help, completions and manual pages.

use crate::bench::{Bench, snapshot};

const VERBS: &[&[&str]] = &[
    &[],
    &["new"],
    &["build"],
    &["dev"],
    &["ports"],
    &["inspect"],
    &["pack"],
    &["machine"],
    &["machine", "list"],
    &["machine", "show"],
    &["check"],
    &["send"],
    &["receive"],
    &["record"],
    &["replay"],
    &["certify"],
    &["verify"],
    &["explore"],
    &["cases"],
    &["explain"],
    &["trace"],
    &["trace", "new"],
    &["trace", "fmt"],
    &["trace", "case"],
    &["trace", "import"],
    &["trace", "export"],
    &["trace", "diff"],
    &["plan"],
    &["simulate"],
    &["simulate", "xon-xoff"],
    &["simulate", "r3964"],
    &["simulate", "r3964-simplified"],
    &["simulate", "fanuc-rs232"],
    &["simulate", "kermit"],
    &["simulate", "pulse-lathe"],
    &["simulate", "script"],
    &["simulate", "xmodem"],
    &["doctor"],
    &["demo"],
    &["gateway"],
    &["gateway", "run"],
    &["gateway", "check"],
    &["gateway", "token"],
    &["unit"],
    &["unit", "run"],
    &["unit", "check"],
    &["unit", "list"],
    &["unit", "flash"],
    &["unit", "sign"],
    &["unit", "key"],
    &["journal"],
    &["cell"],
    &["cell", "list"],
    &["cell", "show"],
    &["cell", "release"],
    &["cell", "force"],
    &["cell", "mode"],
    &["cell", "clear"],
    &["link"],
    &["link", "list"],
    &["link", "show"],
    &["link", "reopen"],
    &["link", "force-resume"],
    &["link", "quarantine"],
    &["link", "release"],
    &["link", "check"],
    &["link", "swap"],
    &["link", "watch"],
    &["link", "received"],
    &["job"],
    &["job", "list"],
    &["job", "show"],
    &["job", "submit"],
    &["job", "feed"],
    &["job", "wait"],
    &["job", "pause"],
    &["job", "resume"],
    &["job", "abort"],
    &["job", "acknowledge"],
    &["job", "restart"],
    &["job", "priority"],
    &["program"],
    &["program", "list"],
    &["program", "upload"],
    &["program", "download"],
    &["program", "delete"],
    &["plugin"],
    &["plugin", "add"],
    &["plugin", "list"],
    &["plugin", "show"],
    &["plugin", "remove"],
    &["plugin", "gc"],
    &["completions"],
    &["man"],
];

#[test]
fn every_verb_explains_itself() {
    let bench = Bench::new();
    for verb in VERBS {
        let mut words = verb.to_vec();
        words.push("--help");
        let ran = bench.run(&words).with_code(0);
        assert_eq!(ran.err, "", "{verb:?}");
        snapshot(
            &format!("help-{}", ["softplug", &verb.join("-")].join("-").trim_end_matches('-')),
            ran.out,
        );
    }
}

#[test]
fn every_verb_has_an_example() {
    let bench = Bench::new();
    for verb in VERBS {
        let help = bench.run(&[verb, &["--help"][..]].concat()).with_code(0).out;
        let has_verbs = help.lines().any(|line| line == "Commands:");
        let line = format!("  softplug {}", verb.join(" "));
        assert!(
            has_verbs || help.lines().any(|words| words.contains(line.trim_start())),
            "{verb:?}"
        );
        assert!(has_verbs || help.contains("\nExample"), "{verb:?}");
    }
}

#[test]
fn help_lists_every_verb_and_every_exit_code() {
    let bench = Bench::new();
    let help = bench.run(&["--help"]).with_code(0).out;
    for verb in VERBS.iter().filter(|verb| verb.len() == 1) {
        assert!(help.lines().any(|line| line.trim_start().starts_with(verb[0])), "{verb:?}");
    }
    for code in [0, 1, 2, 3, 4, 5, 6, 70] {
        assert!(help.lines().any(|line| line.starts_with(&format!("  {code:>2}  "))), "{code}");
    }
}

#[test]
fn completions_are_made_for_every_shell() {
    let bench = Bench::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = bench.run(&["completions", shell]).with_code(0).out;
        for verb in ["simulate", "replay", "receive"] {
            assert!(script.contains(verb), "{shell}: {verb}");
        }
    }
}

#[test]
fn manual_pages_are_made_for_every_verb() {
    let bench = Bench::new();
    let page = bench.run(&["man"]).with_code(0).out;
    assert!(page.contains(".TH softplug 1") && page.contains("Exit codes:"), "{page}");
    bench.run(&["man", "--out", "pages/man1"]).with_code(0);
    for verb in VERBS {
        let name = [&["softplug"], *verb].concat().join("-");
        let page = String::from_utf8(bench.read(&format!("pages/man1/{name}.1"))).unwrap();
        assert!(page.contains(".TH"), "{name}");
    }
}

#[test]
fn colours_come_only_where_they_are_asked_for() {
    let bench = Bench::new();
    let plain = bench.run(&["inspect", "xon-xoff"]).out;
    assert!(!plain.contains('\x1b'));
    let coloured = bench.run(&["inspect", "xon-xoff", "--color", "always"]).out;
    assert!(coloured.contains('\x1b'));
    let mut command = bench.command(&["inspect", "nothing", "--color=never"]);
    let err = command.env("CLICOLOR_FORCE", "1").output().unwrap().stderr;
    assert!(!err.contains(&0x1B));
}
