//! Putting what was observed in the place of what was expected.

use crate::limits::LINE_BYTES;
use crate::model::{
    Entry, Files, Line, NoFiles, Payload, Time, Trace, What, When, tidy_blank_lines,
};

/// Why a trace cannot take over what was observed.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BlessError {
    /// Only what the plug-in does can be observed.
    #[error("a line `{sign}` at {when} is no expectation; only `>` and `=` lines can be observed")]
    NotAnExpectation {
        /// The line's kind.
        sign: &'static str,
        /// Its time.
        when: When,
    },
    /// A line would be too long to be read again.
    #[error(
        "what was observed at {when} does not fit a line of {LINE_BYTES} bytes; write its bytes as `gen:` or `file:` in the trace first"
    )]
    LineTooLong {
        /// Its time.
        when: When,
    },
    /// No event would be left.
    #[error("nothing was observed and the trace has no inputs: no event would be left")]
    Nothing,
}

impl Trace {
    /// The trace with all expectations replaced by what was observed, merged in
    /// the order of time. Inputs, `.` lines and comments stay, alternatives go:
    /// what was observed is one timeline. An expectation that holds
    /// (same content, time in its window) stays as it was written, with its
    /// window and its way to write bytes. `files` finds the data of `file:`
    /// items; where it does not, the item counts as different.
    ///
    /// ```
    /// use softplug_trace::{Entry, Expected, NoFiles, Payload, SourceLine, Time, Trace, What, When};
    ///
    /// # let text = "\
    /// # id: echo.tx.first
    /// # title: The first byte leaves at once
    /// # profile: echo
    /// # clauses: echo.tx.at-once
    /// # level: must
    /// # line: 9600 8N1 depth=1 reaction=0
    /// # since: 1
    /// # origin: hand-written
    /// # ---
    /// # ? 0.000000 send 1 \"A\"
    /// # > 0.000000 42             ; 'B'
    /// # ";
    /// let trace = Trace::parse(text)?;
    /// let mut observed = trace.entries().nth(1).unwrap().clone();
    /// observed.what = What::Expected(Expected::Send(Payload::hex(b"A")));
    /// let blessed = trace.with_expectations(vec![observed], &NoFiles).unwrap();
    /// assert!(blessed.format().ends_with("> 0.000000 41             ; 'A'\n"));
    /// # Ok::<(), softplug_trace::ParseError>(())
    /// ```
    ///
    /// # Errors
    /// An observed entry is no expectation or too long, or no event is left.
    pub fn with_expectations(
        &self,
        mut observed: Vec<Entry>,
        files: &impl Files,
    ) -> Result<Self, BlessError> {
        if let Some(entry) = observed.iter().find(|entry| !entry.what.is_expectation()) {
            return Err(BlessError::NotAnExpectation { sign: entry.what.sign(), when: entry.when });
        }
        let mut old: Vec<Option<&Entry>> =
            self.entries().filter(|entry| entry.what.is_expectation()).map(Some).collect();
        observed.sort_by_key(|entry| entry.when.from);
        // Both are sorted: what ended before this entry is over for all later ones.
        let mut open = 0;
        for entry in &mut observed {
            let now = entry.when.from;
            while old.get(open).is_some_and(|old| old.is_none_or(|old| old.when.to < now)) {
                open += 1;
            }
            let candidates =
                old[open..].iter_mut().take_while(|old| old.is_none_or(|old| old.when.from <= now));
            let found = candidates
                .filter(|old| old.is_some_and(|old| holds(old, entry, files)))
                .find_map(Option::take);
            if let Some(kept) = found {
                *entry = kept.clone();
            }
            if crate::format::line_bytes(entry) > LINE_BYTES {
                return Err(BlessError::LineTooLong { when: entry.when });
            }
        }
        // What holds begins where its window does.
        observed.sort_by_key(|entry| entry.when.from);

        let body = merge(self.kept(), observed);
        if !body.iter().any(|line| line.entry().is_some()) {
            return Err(BlessError::Nothing);
        }
        Ok(Self { front: self.front.clone(), body })
    }

    /// Inputs, comments and blank lines, each with the time before which it
    /// stands; `None`: at the end. A comment belongs to the line below it.
    fn kept(&self) -> Vec<(Option<Time>, Line)> {
        let mut kept = Vec::new();
        let mut below = None;
        for line in self.body.iter().rev() {
            below = line.start().or(below);
            match line {
                Line::Blank | Line::Comment(_) => kept.push((below, line.clone())),
                Line::Entry(entry) if !entry.what.is_expectation() => {
                    kept.push((below, line.clone()));
                }
                Line::Entry(_) => {}
                Line::Alternatives(block) => {
                    let comments = block
                        .branches
                        .iter()
                        .flatten()
                        .filter(|line| matches!(line, Line::Comment(_)));
                    let lifted: Vec<_> = comments.map(|line| (below, line.clone())).collect();
                    kept.extend(lifted.into_iter().rev());
                }
            }
        }
        kept.reverse();
        kept
    }
}

fn merge(kept: Vec<(Option<Time>, Line)>, observed: Vec<Entry>) -> Vec<Line> {
    let mut body = Vec::new();
    let mut observed = observed.into_iter().peekable();
    for (time, line) in kept {
        while let Some(entry) =
            observed.next_if(|entry| time.is_none_or(|time| entry.when.from < time))
        {
            body.push(Line::Entry(entry));
        }
        body.push(line);
    }
    body.extend(observed.map(Line::Entry));
    tidy_blank_lines(&mut body);
    body
}

/// Whether what was observed is what the old line expects.
fn holds(old: &Entry, observed: &Entry, files: &impl Files) -> bool {
    if !(old.when.contains(observed.when.from) && old.when.contains(observed.when.to)) {
        return false;
    }
    let without_bytes = |what: &What| what.clone().with_payload(Payload::default());
    let same_bytes = match (old.what.payload(), observed.what.payload()) {
        (Some(old), Some(observed)) => matches!(
            (old.bytes(files), observed.bytes(&NoFiles)),
            (Ok(old), Ok(observed)) if old == observed
        ),
        _ => true,
    };
    same_bytes && ignoring_open_counts(&without_bytes(&old.what), &without_bytes(&observed.what))
}

/// Whether two entries are equal where the old one leaves `sent` open.
fn ignoring_open_counts(old: &What, observed: &What) -> bool {
    use crate::model::Expected::{Done, Fail};
    match (old, observed) {
        (What::Expected(Done { id: a, sent: None }), What::Expected(Done { id: b, .. })) => a == b,
        (
            What::Expected(Fail { id: a, failure, status, sent: None }),
            What::Expected(Fail { id: b, failure: failure_b, status: status_b, .. }),
        ) => (a, failure, status) == (b, failure_b, status_b),
        (old, observed) => old == observed,
    }
}
