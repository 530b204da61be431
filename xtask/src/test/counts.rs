//! Reads how many tests passed out of what the test runners print.

use std::fmt;
use std::ops::Add;

/// Tests by result.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Counts {
    pub(crate) passed: u64,
    pub(crate) failed: u64,
    pub(crate) skipped: u64,
}

impl Counts {
    /// Sums up every result line of cargo test in `output`; where nextest sums up
    /// itself, its summary alone: it repeats the result lines of what failed.
    pub(crate) fn read(output: &str) -> Self {
        let summary = output.lines().filter_map(Self::read_summary).reduce(Add::add);
        let results = output.lines().filter_map(Self::read_result);
        summary.unwrap_or_else(|| results.fold(Self::default(), Add::add))
    }

    fn read_result(line: &str) -> Option<Self> {
        let line = line.trim_start();
        // test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 2 filtered out; …
        let (_, counts) = line.strip_prefix("test result: ")?.split_once(". ")?;
        Some(Self::sum(counts.split(';')))
    }

    fn read_summary(line: &str) -> Option<Self> {
        let line = line.trim_start();
        // Summary [ 0.5s] 7 tests run: 5 passed (1 slow), 1 failed, 1 timed out, 2 skipped
        let (head, counts) = line.split_once("run: ")?;
        let is_summary = head.starts_with("Summary [") && head.contains("test");
        is_summary.then(|| Self::sum(counts.split(',')))
    }

    fn sum<'a>(pieces: impl Iterator<Item = &'a str>) -> Self {
        let mut counts = Self::default();
        for piece in pieces {
            let mut words = piece.split_whitespace();
            let Some(count) = words.next().and_then(|word| word.parse::<u64>().ok()) else {
                continue;
            };
            match words.next() {
                Some("passed") => counts.passed += count,
                Some("failed" | "timed" | "exec") => counts.failed += count,
                Some("skipped" | "ignored" | "filtered") => counts.skipped += count,
                _ => {}
            }
        }
        counts
    }
}

impl Add for Counts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            passed: self.passed + other.passed,
            failed: self.failed + other.failed,
            skipped: self.skipped + other.skipped,
        }
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cargo_test_is_summed_over_its_binaries() {
        let output = "running 4 tests\n\
            test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 2 filtered out; \
            finished in 0.00s\n\
            test result: FAILED. 5 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out\n";
        let counts = Counts::read(output);
        assert_eq!(counts, Counts { passed: 8, failed: 2, skipped: 3 });
        assert_eq!(counts.to_string(), "8 passed, 2 failed, 3 skipped");
    }

    #[test]
    fn nextest_is_read_from_its_summary_only() {
        let output = "     Summary [   0.512s] 9 tests run: 5 passed (1 slow), 2 failed, \
            1 timed out, 1 exec failed, 3 skipped\n\
            test result: FAILED. 0 passed; 1 failed; 0 ignored; 0 measured; 38 filtered out\n\
            PASS [ 0.003s] softplug-abi the_line_says_run: 4 passed\n";
        assert_eq!(Counts::read(output), Counts { passed: 5, failed: 4, skipped: 3 });
        let single = "Summary [   0.003s] 1 test run: 1 passed, 0 skipped";
        assert_eq!(Counts::read(single), Counts { passed: 1, failed: 0, skipped: 0 });
    }

    #[test]
    fn what_a_test_prints_is_no_result() {
        assert_eq!(Counts::read("7 passed, 0 failed\nresult: ok. 3 passed;"), Counts::default());
    }
}
