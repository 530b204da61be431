//! Tests of the format as a whole.

mod bless;
mod diff;
mod faults;
mod good;
mod limits;
mod property;
mod rate;

use crate::{ParseError, Trace};

/// A case with most of what a sender needs.
pub(crate) const HOLD: &str = r#"id: xon-xoff.tx.hold
title: XOFF stops the sender, XON lets it go on
profile: xon-xoff
clauses: xon-xoff.tx.obey-xoff xon-xoff.tx.resume
level: must
line: 9600 8N1 depth=1 reaction=0
config: parity_mask=0x7F feed_start="0d 0a"
since: 1
origin: hand-written
permute: cuts swap
---
# The control is slow.
? 0.000000 send 1 "ABCD"
> 0.000000 41 42          ; 'AB'
< 0.001500 13             ; DC3=XOFF

# It has read what it had.
< 2.000000 11             ; DC1=XON
> 2.000000 "CD"
= 2.002084 done 1 sent=4
. 5.000000
"#;

/// A trace with this body.
fn with_body(body: &str) -> String {
    format!(
        "id: p.case\ntitle: T\nprofile: p\nclauses: p.c\nlevel: may\nline: 9600 8N1 depth=1 reaction=0\n\
         since: 1\norigin: hand-written\n---\n{body}"
    )
}

fn parse_body(body: &str) -> Result<Trace, ParseError> {
    Trace::parse(&with_body(body))
}

/// The canonical body of a trace with this body.
fn canonical(body: &str) -> String {
    let trace = parse_body(body).unwrap_or_else(|error| panic!("{}", error.report("test.spt")));
    let text = trace.format();
    let again =
        Trace::parse(&text).unwrap_or_else(|error| panic!("{}", error.report("canonical.spt")));
    assert_eq!(again, trace);
    assert_eq!(again.format(), text);
    text.split_once("---\n").expect("the formatter ends the front matter so").1.to_owned()
}

/// Checks that a body of canonical lines stays as it is.
fn stays(body: &str) {
    assert_eq!(canonical(body), body);
}
