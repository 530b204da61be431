//! Replacing expectations by what was observed.

use super::{HOLD, parse_body};
use crate::*;

/// Entries written as a body.
fn entries(body: &str) -> Vec<Entry> {
    parse_body(body).unwrap().entries().cloned().collect()
}

fn blessed(body: &str, observed: &str) -> String {
    let trace = parse_body(body).unwrap();
    let new = trace.with_expectations(entries(observed), &NoFiles).unwrap();
    let text = new.format();
    assert_eq!(Trace::parse(&text).unwrap(), new);
    text.split_once("---\n").unwrap().1.to_owned()
}

#[test]
fn what_holds_stays_as_it_was_written() {
    let trace = Trace::parse(HOLD).unwrap();
    let observed = entries("> 0.0 \"AB\"\n> 2.0 43 44\n= 2.002084 done 1 sent=4\n");
    assert_eq!(trace.with_expectations(observed, &NoFiles).unwrap().format(), HOLD);
    let window =
        "? 0.000000 send 1 gen:nc(1,5)\n> 0.000000~1.000000 gen:nc(1,5)\n= 2.000000 done 1\n";
    let bytes = parse_body(window)
        .unwrap()
        .inputs()
        .next()
        .unwrap()
        .what
        .payload()
        .unwrap()
        .bytes(&NoFiles)
        .unwrap();
    let mut observed = entries("> 0.5 41\n= 2.0 done 1 sent=5\n");
    observed[0].what = What::Expected(Expected::Send(Payload::from_bytes(&bytes)));
    let trace = parse_body(window).unwrap();
    assert_eq!(trace.with_expectations(observed, &NoFiles).unwrap(), trace);
}

#[test]
fn what_differs_is_replaced_in_its_place() {
    let body = "\
# Start.
? 0.000000 send 1 \"AB\"
# Both at once.
> 0.000000 \"AB\"

# Then a stop.
< 0.500000 13             ; DC3=XOFF
= 1.000000 done 1
. 3.000000
# The end.
";
    let new =
        blessed(body, "> 0.1 41 42\n> 0.5 \"x\"\n= 2.0 fail 1 held-too-long\n= 4.0 withdraw 9\n");
    assert_eq!(
        new,
        "\
# Start.
? 0.000000 send 1 \"AB\"
# Both at once.
> 0.100000 41 42          ; 'AB'

# Then a stop.
< 0.500000 13             ; DC3=XOFF
> 0.500000 \"x\"
= 2.000000 fail 1 held-too-long
. 3.000000
= 4.000000 withdraw 9
# The end.
"
    );
}

#[test]
fn alternatives_go_and_their_comments_stay() {
    let body = "? 0.000000 send 1 \"A\"\n{ alt p.c\n  # Either\n  > 1.000000 \"A\"\n|\n  # or\n  > 2.000000 \"A\"\n}\n";
    assert_eq!(
        blessed(body, "> 2.0 \"A\"\n"),
        "? 0.000000 send 1 \"A\"\n# Either\n# or\n> 2.000000 \"A\"\n"
    );
    assert_eq!(blessed(body, ". 0.0\n".replace(". 0.0", "> 0.0 41").as_str()).lines().count(), 4);
}

#[test]
fn nothing_observed_leaves_the_inputs() {
    let trace = Trace::parse(HOLD).unwrap();
    let silent = trace.with_expectations(Vec::new(), &NoFiles).unwrap();
    assert_eq!(silent.inputs().count(), 3);
    assert!(silent.entries().all(|entry| !entry.what.is_expectation()));
}

#[test]
fn what_cannot_be_taken_over() {
    let trace = Trace::parse(HOLD).unwrap();
    let input = trace.with_expectations(entries("< 1.0 41\n"), &NoFiles).unwrap_err();
    assert_eq!(
        input.to_string(),
        "a line `<` at 1.000000 is no expectation; only `>` and `=` lines can be observed"
    );
    let mut long = entries("> 1.0 41\n");
    long[0].what = What::Expected(Expected::Send(Payload::hex(&vec![0; limits::LINE_BYTES / 3])));
    let when = long[0].when;
    assert_eq!(trace.with_expectations(long, &NoFiles), Err(BlessError::LineTooLong { when }));
    let only = parse_body("> 0.0 41\n").unwrap();
    assert_eq!(only.with_expectations(Vec::new(), &NoFiles), Err(BlessError::Nothing));
}
