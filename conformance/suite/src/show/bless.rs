//! A trace takes over what a plug-in was seen to do.

use crate::given::lines::line_parameters;
use crate::given::load::Case;
use crate::given::timeline::micros;
use crate::judge::run::Judge;
use crate::run::fault::Fault;
use crate::run::permute::Permutation;
use crate::run::transcript;
use softplug_trace::{BlessError, Trace, What};
use std::collections::BTreeSet;

/// Bytes that stand on one new line.
const BYTES: usize = 1_024;

/// A trace cannot take over what was seen.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{BlessFailure, FaultClass, FromFn, bless, load};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// // The plug-in has no such setting.
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let text = case.trace.format().replace("since: 1", "config: speed=9\nsince: 1");
/// let failure = bless(&subject, &case.with_trace(Trace::parse(&text)?)).unwrap_err();
/// let BlessFailure::Fault(fault) = failure else { panic!("{failure}") };
/// assert_eq!(fault.class, FaultClass::NotApplicable);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, bless, load};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// // "CE" is demanded, "CD" is what is sent.
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let wrong = case.trace.format().replace("43 44 ", "43 45 ");
/// let blessed = bless(&subject, &case.with_trace(Trace::parse(&wrong)?))?;
/// assert!(blessed.format().contains("> 2.000000 43 44 "));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The plug-in faults, or the trace cannot hold what it does.
pub fn bless(subject: &dyn Judge, case: &Case) -> Result<Trace, BlessFailure> {
    let outcome = subject.run(case, &Permutation::Uncut, 0);
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
    let entries = transcript::entries(line, subject.manifest(), &outcome.seen, most, |at| {
        places.contains(&at)
    });
    Ok(case.trace.with_expectations(entries, &case.files())?)
}
