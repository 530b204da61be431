//! Two traces held against each other.

use crate::bench::{Bench, snapshot};
use crate::files::TRACE;

#[test]
fn what_differs_is_told_and_decides_the_exit_code() {
    let bench = Bench::new();
    bench.write("a.spt", TRACE);
    // Other words and other lines, but the same events.
    let same = TRACE
        .replace("title: The program", "title: A program")
        .replace("> 0.000000 41             ; 'A'\n", "")
        .replace("> 0.001042 42             ; 'B'", "# Both.\n> 0.000000 \"AB\"");
    bench.write("same.spt", same);
    let ran = bench.run(&["trace", "diff", "a.spt", "same.spt"]).with_code(0);
    assert_eq!(ran.out, "no difference\n");
    let other = TRACE
        .replace("9600 8N1", "9600 8E1")
        .replace("42             ; 'B'", "43             ; 'C'")
        .replace("= 0.002084 done", "= 0.002090 done");
    bench.write("other.spt", other);
    let ran = bench.run(&["trace", "diff", "a.spt", "other.spt"]).with_code(1);
    snapshot("trace-diff", ran.out);
    let json = bench.run(&["trace", "diff", "a.spt", "other.spt", "--json"]).with_code(1);
    snapshot("trace-diff-json", json.out);
    let close = bench.run(&["trace", "diff", "a.spt", "other.spt", "--tolerance", "6"]);
    assert!(!close.with_code(1).out.contains("done"), "6 µs are tolerated");
}

#[test]
fn what_is_no_trace_is_not_compared() {
    let bench = Bench::new();
    bench.write("a.spt", TRACE);
    bench.write("b.spt", TRACE.replace(" 41 ", " 4Z "));
    let mut text = bench.run(&["trace", "diff", "a.spt", "b.spt"]).with_code(2).err;
    text += &bench.run(&["trace", "diff", "a.spt", "none.spt"]).with_code(2).err;
    snapshot("trace-diff-refusals", text);
}
