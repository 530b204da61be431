//! A trace takes over what a plug-in was seen to do.

use crate::course::micros;
use crate::lines::line_parameters;
use crate::{Case, Fault, Judge, Permutation, show};
use softplug_trace::{BlessError, Trace, What};
use std::collections::BTreeSet;

/// Bytes that stand on one new line.
const BYTES: usize = 1_024;

/// A trace cannot take over what was seen.
#[derive(Debug, thiserror::Error)]
pub enum BlessFailure {
    /// The run ended before its time.
    #[error("the plug-in {}: {}", .0.class.text(), .0.message)]
    Fault(Fault),
    /// The trace cannot hold what was seen.
    #[error(transparent)]
    Trace(#[from] BlessError),
}

/// The trace with its expectations replaced by what the plug-in does. A line that
/// holds stays as it was written.
///
/// # Errors
/// The plug-in faults, or the trace cannot hold what it does.
pub fn bless(subject: &dyn Judge, case: &Case) -> Result<Trace, BlessFailure> {
    let outcome = subject.run(case, Permutation::Uncut, 0);
    if let Some(fault) = outcome.fault {
        return Err(BlessFailure::Fault(fault));
    }
    // New lines begin and end where old ones do, so that these can stay.
    let line = line_parameters(&case.trace.front.line);
    let mut places = BTreeSet::new();
    let mut most = BYTES;
    for entry in case.trace.entries() {
        let from = micros(entry.when.from);
        places.insert(from);
        if let What::Send(payload) = &entry.what
            && let Some(length) = payload.length()
        {
            places.insert(from + line.characters(length));
            most = most.max(usize::try_from(length).unwrap_or(most));
        }
    }
    let entries =
        show::entries(line, subject.manifest(), &outcome.seen, most, |at| places.contains(&at));
    Ok(case.trace.with_expectations(entries, &case.files())?)
}
