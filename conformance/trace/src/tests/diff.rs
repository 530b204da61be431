//! Two traces held against each other.

use super::parse_body;
use crate::*;

fn differences(first: &str, second: &str, tolerance: u64) -> Vec<String> {
    let (first, second) = (parse_body(first).unwrap(), parse_body(second).unwrap());
    let found = diff((&first, &NoFiles), (&second, &NoFiles), tolerance).unwrap();
    found.iter().map(|found| found.to_string().replace("   (line", " (line")).collect()
}

#[test]
fn how_bytes_are_written_makes_no_difference() {
    // A character takes 1,041 and two thirds µs.
    let lines = "> 0.000000 41\n> 0.001042 42\n> 0.002084 43\n# All.\n. 1.000000\n";
    assert_eq!(differences(lines, "> 0.000000 \"ABC\"\n. 1.000000\n", 0), [""; 0]);
    let burst = "<< 0.000000 \"ABC\"\n";
    let singly = "< 0.000000 41\n< 0.001042 42\n< 0.002084 43\n";
    assert_eq!(differences(burst, singly, 0), [""; 0]);
    let same = "? 0.000000 send 1 \"A\"\n> 0.000000 41\n";
    assert_eq!(differences(same, "> 0.000000 41\n? 0.000000 send 1 \"A\"\n", 0), [""; 0]);
}

#[test]
fn a_byte_that_is_missing_does_not_make_all_behind_it_differ() {
    let found = differences("< 1.000000 41 42 43 44\n", "< 1.000000 41 43 45 44\n", 0);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].starts_with("- < 1.000000 42 "), "{found:?}");
    assert!(found[1].starts_with("+ < 1.000000 45 "), "{found:?}");
}

#[test]
fn times_are_compared_with_a_tolerance() {
    let (first, second) = ("> 1.000000 \"ABC\"\n", "> 1.000500 \"ABC\"\n");
    assert_eq!(differences(first, second, 500), [""; 0]);
    let found = differences(first, second, 499);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("500 µs later, at 1.000500"), "{found:?}");
    let found = differences(second, first, 0);
    assert!(found[0].contains("500 µs earlier"), "{found:?}");
    let window = "> 1.000000~2.000000 41\n";
    assert_eq!(differences(window, "> 1.000000~3.000000 41\n", 0).len(), 1);
}

#[test]
fn only_what_changes_the_run_counts_of_the_front_matter() {
    let first = parse_body(". 1.000000\n").unwrap();
    let mut second = first.clone();
    second.front.title = "Another title".to_owned();
    let of = |second: &Trace| diff((&first, &NoFiles), (second, &NoFiles), 0).unwrap();
    assert_eq!(of(&second), []);
    second.front.line.baud = 1_200;
    let found = of(&second);
    assert!(matches!(found[..], [Difference::Front { key: "line", .. }]), "{found:?}");
}

#[test]
fn very_long_and_very_different_traces_are_compared_too() {
    let long = |seed: u32| format!("< 1.000000 41 gen:bytes({seed},200000) 5A\n");
    assert_eq!(differences(&long(1), &long(1), 0), [""; 0]);
    let found = differences(&long(1), &long(2), 0);
    assert!(found.len() == 2, "{}", found.len());
}
