//! A trace takes over what a plug-in was seen to do.

use crate::given::case::Case;
use crate::given::lines::line_parameters;
use crate::given::timeline::micros;
use crate::judge::run::Judge;
use crate::run::fault::Fault;
use crate::run::permute::Permutation;
use crate::run::seen::Seen;
use crate::run::transcript;
use crate::show::sent::{self, Held, Lost};
use softplug_abi::Micros;
use softplug_link::Observed;
use softplug_trace::{BlessError, Expected, Trace, What};
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
    Ok(blessing(subject, case)?.trace)
}

/// What blessing a trace would make of it, and at what price.
///
/// The example of [`blessing`] shows one.
#[derive(Clone, Debug)]
pub struct Blessing {
    /// The blessed trace.
    pub trace: Trace,
    /// What stood on `>` lines and is no longer sent.
    pub lost: Vec<Lost>,
    /// All bytes of it; a break counts as one.
    pub lost_bytes: usize,
    /// Bytes that stood on `>` lines.
    pub stood: usize,
    /// Bytes that are sent and did not stand there.
    pub more: usize,
    /// When the first of them leaves.
    pub more_at: Option<Micros>,
    /// Jobs that fail though no line says so: which, when and why.
    pub failed: Vec<(u32, Micros, &'static str)>,
    /// A delivery is under way at the end, and the head says of nothing that it is left.
    pub leaves_delivery: bool,
}

/// As [`bless`], with what the trace loses by it: bytes that stood there as sent, by a plug-in on a
/// live line or in somebody's mind, and that this plug-in does not send.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, blessing, load};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let wrong = case.trace.format().replace("43 44 ", "43 45 ");
/// let blessing = blessing(&subject, &case.with_trace(Trace::parse(&wrong)?))?;
/// let lost = blessing.lost[0].to_string();
/// assert!(lost.ends_with("recorded 45, sent 44 at 2.001042 s"), "{lost}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`bless`].
pub fn blessing(subject: &dyn Judge, case: &Case) -> Result<Blessing, BlessFailure> {
    let outcome = subject.run(case, &Permutation::Uncut, 0);
    if let Some(fault) = outcome.fault {
        return Err(BlessFailure::Fault(fault));
    }
    let held = sent::held(case, &outcome.seen);
    let failed = failures(case, &outcome.seen);
    let trace = with_seen(subject, case, &outcome.seen)?;
    let Held { stood, lost, lost_bytes, more, more_at } = held;
    let leaves_delivery = outcome.is_delivering && case.leaves_nothing();
    Ok(Blessing { trace, lost, lost_bytes, stood, more, more_at, failed, leaves_delivery })
}

/// Jobs that fail where no line has said so.
fn failures(case: &Case, seen: &[Seen]) -> Vec<(u32, Micros, &'static str)> {
    let said: BTreeSet<u32> = case
        .trace
        .variants()
        .into_iter()
        .flatten()
        .filter_map(|entry| match &entry.what {
            What::Expected(Expected::Fail { id, .. }) => Some(*id),
            _ => None,
        })
        .collect();
    let failed = seen.iter().filter_map(|seen| match &seen.what {
        Observed::Failed { job, failure, .. } if !said.contains(&job.0) => {
            Some((job.0, seen.at, failure.name()))
        }
        _ => None,
    });
    failed.collect()
}

/// The trace with this in the place of its expectations.
pub(crate) fn with_seen(
    subject: &dyn Judge,
    case: &Case,
    seen: &[Seen],
) -> Result<Trace, BlessError> {
    // New lines begin and end where old ones do, so that these can stay.
    let line = line_parameters(&case.trace.front.line);
    let mut places = BTreeSet::new();
    let mut most = BYTES;
    for entry in case.trace.entries() {
        let from = micros(entry.when.from);
        places.insert(from);
        if let What::Expected(Expected::Send(payload)) = &entry.what
            && let Some(length) = payload.length()
        {
            places.insert(from + line.characters(length));
            most = most.max(usize::try_from(length).unwrap_or(most));
        }
    }
    let entries =
        transcript::entries(line, subject.manifest(), seen, most, |at| places.contains(&at));
    case.trace.with_expectations(entries, &case.files())
}
