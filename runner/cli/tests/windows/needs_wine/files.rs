//! What needs no port, and what is not there.

use crate::wine::{Wine, fixtures};

#[test]
fn a_trace_is_replayed() {
    let wine = Wine::new();
    let traces = fixtures().join("traces/xon-xoff");
    let mut traces: Vec<_> =
        traces.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    traces.sort();
    let case = traces.iter().find(|path| path.extension().is_some_and(|end| end == "spt")).unwrap();
    let ran = wine.run(&format!("replay xon-xoff {}", case.display())).with_code(0);
    assert!(ran.out.starts_with("passed: "), "{ran:?}");
}

#[test]
fn a_plug_in_is_certified() {
    let wine = Wine::new();
    let ran = wine.run("certify xon-xoff --profile xon-xoff").with_code(0);
    assert!(ran.out.starts_with("conformant: "), "{ran:?}");
}

#[test]
fn what_is_not_there_says_so() {
    let wine = Wine::new();
    for words in ["gateway run", "demo", "link list"] {
        let ran = wine.run(words).with_code(6);
        assert!(ran.err.contains("works on Linux only so far"), "{words}: {ran:?}");
    }
    let ran = wine.run("simulate xon-xoff").with_code(6);
    assert!(ran.err.contains("this system has no ptys"), "{ran:?}");
}
