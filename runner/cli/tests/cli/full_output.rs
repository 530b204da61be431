//! Standard output that cannot be written, as on a full disk: no command is done then.

use std::fs::File;
use std::process::Stdio;

use crate::bench::{Bench, Ran, program};

/// Words of each verb, and the exit code: 2 where all went well but the printing, else that of
/// what went wrong besides.
const RUNS: &[(&str, i32)] = &[
    ("--version", 2),
    ("--help", 2),
    ("send --help", 2),
    ("new my-machine", 2),
    ("build nowhere --json", 2),
    ("dev nowhere --json", 2),
    ("ports --json", 2),
    ("inspect xon-xoff", 2),
    ("inspect xon-xoff --json", 2),
    ("pack nowhere --json", 2),
    ("machine list", 2),
    ("machine show haas-vf --json", 2),
    ("check O1.nc --machine haas-vf", 2),
    ("send --dry-run --plugin xon-xoff O1.nc", 2),
    ("send --dry-run --plugin xon-xoff --json O1.nc", 2),
    ("send --dry-run --plugin xon-xoff --raw O1.nc", 2),
    ("receive --port pty: --plugin xon-xoff --wait 1 --out a.nc --json", 5),
    ("record --a pty: --b pty: --out a.spt --id p.a --line 9600~8N1 --duration 1", 2),
    ("replay xon-xoff nowhere.spt --json", 2),
    ("certify nowhere --json", 2),
    ("explore nowhere --profile r3964 --json", 2),
    ("explore xon-xoff --profile xon-xoff --only end-mark", 2),
    ("verify nowhere --json", 2),
    ("cases", 2),
    ("cases --json", 2),
    ("explain xon-xoff.tx.abort-clean", 2),
    ("trace fmt nowhere.spt --json", 2),
    ("plan nowhere.toml --json", 2),
    ("simulate xon-xoff --baud none --json", 2),
    ("doctor /dev/nowhere --json", 6),
    ("demo --plugins nowhere --json", 2),
    ("gateway check nowhere.toml --json", 2),
    ("unit check nowhere.toml --json", 2),
    ("unit key unit.key", 2),
    ("unit key --show nowhere.key --json", 2),
    ("unit list 127.0.0.1:1 --json", 6),
    ("link list --gateway http://127.0.0.1:1 --json", 6),
    ("job list --gateway http://127.0.0.1:1 --json", 6),
    ("journal --gateway http://127.0.0.1:1 --json", 6),
    ("cell list --gateway http://127.0.0.1:1 --json", 6),
    ("program list --gateway http://127.0.0.1:1 --json", 6),
    ("plugin list --json", 2),
    ("completions bash", 2),
    ("man", 2),
];

fn on_a_full_disk(bench: &Bench, line: &str) -> Ran {
    let words: Vec<_> = line.split(' ').map(|word| word.replace('~', " ")).collect();
    let full = File::options().write(true).open("/dev/full").unwrap();
    bench.command(&words).stdout(full).output().unwrap().into()
}

#[test]
fn output_that_is_not_written_is_an_error_of_every_verb() {
    let bench = Bench::new();
    bench.write("O1.nc", program("drilling.nc"));
    for (line, code) in RUNS {
        let ran = on_a_full_disk(&bench, line);
        assert_eq!(ran.code, *code, "softplug {line}: {ran:?}");
        let said = "error: standard output cannot be written: No space left on device";
        assert!(ran.err.contains(said), "softplug {line}: {ran:?}");
    }
    let help = bench.run(&["--help"]).out;
    let verbs = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let verbs: Vec<_> = verbs
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|verb| !verb.is_empty())
        .collect();
    assert!(verbs.len() > 20, "{help}");
    for verb in verbs {
        assert!(RUNS.iter().any(|(line, _)| line.split(' ').next() == Some(verb)), "{verb}");
    }
}

#[test]
fn what_machines_do_not_get_people_do() {
    let bench = Bench::new();
    let ran = on_a_full_disk(&bench, "send --dry-run --plugin xon-xoff --json nowhere.nc");
    assert_eq!(ran.code, 2);
    assert!(ran.err.contains("cannot read nowhere.nc"), "{ran:?}");
}

#[test]
fn who_has_read_enough_may_go() {
    let bench = Bench::new();
    let mut child = bench.command(&["cases"]).stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let ran = Ran::from(child.wait_with_output().unwrap()).with_code(0);
    assert!(!ran.err.contains("error"), "{ran:?}");
}
