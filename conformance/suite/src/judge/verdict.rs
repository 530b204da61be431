//! What a run of a trace came to.

use super::divergence::Divergence;
use crate::run::class::Class;
use crate::run::fault::Fault;
use serde::Serialize;
use std::fmt;

/// One run of one trace, judged.
///
/// The example of [`judge`](crate::judge()) shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Verdict {
    /// The case: the trace's id, a slash, the permutation.
    pub case: String,
    /// The plug-in.
    pub subject: String,
    /// How much the clauses bind: `must`, `should` or `may`.
    pub level: &'static str,
    /// `None`: passed.
    pub failure: Option<Failure>,
}

/// Why a run did not pass.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Class, Divergence, Filter, FromFn, judge, load};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// // The last byte of four is demanded to be another one.
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let wrong = case.trace.format().replace("43 44 ", "43 45 ");
/// let case = case.with_trace(Trace::parse(&wrong)?);
/// let (verdicts, _) = judge(&subject, &case, &Filter::only(["xon-xoff.tx.hold/uncut"]));
/// let failure = verdicts[0].failure.as_ref().expect("it sends the right one");
/// assert_eq!(failure.class, Class::Diverged);
/// let Some(Divergence { at_us, expected, observed, .. }) = &failure.divergence else { panic!() };
/// assert_eq!(*at_us, 2_001_042);
/// assert_eq!((expected.bytes.last(), observed.bytes.last()), (Some(&0x45), Some(&0x44)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Failure {
    /// What kind of failure.
    pub class: Class,
    /// The trace's file, as it was named.
    pub file: String,
    /// The first place where what was seen differs from what was demanded.
    pub divergence: Option<Divergence>,
    /// How the run ended before its time.
    pub fault: Option<Fault>,
    /// What was given and seen before that.
    pub before: Vec<String>,
    /// The command that runs it again.
    pub again: String,
}

impl Verdict {
    /// Whether it passed.
    pub fn is_passed(&self) -> bool {
        self.failure.is_none()
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.failure {
            None => write!(f, "passed {} [{}]", self.case, self.subject),
            Some(failure) => {
                write!(f, "FAILED {} [{}]", self.case, self.subject)?;
                write!(f, "\n{failure}")
            }
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "  the plug-in {}", self.class.text())?;
        let line = self.divergence.as_ref().and_then(|divergence| divergence.line);
        match line {
            Some(line) => writeln!(f, "  --> {}:{line}", self.file)?,
            None => writeln!(f, "  --> {}", self.file)?,
        }
        if let Some(fault) = &self.fault {
            let at = softplug_abi::Micros(fault.at_us);
            writeln!(f, "  at {at}: {}", fault.message)?;
        }
        if let Some(divergence) = &self.divergence {
            write!(f, "{divergence}")?;
        }
        if !self.before.is_empty() {
            writeln!(f, "  before that")?;
        }
        for line in &self.before {
            writeln!(f, "    {line}")?;
        }
        match self.class {
            Class::DependsOnPast => writeln!(
                f,
                "  a case that rightly leaves something for the next says so in its head: leaves: WHAT"
            )?,
            Class::DependsOnRooms => writeln!(
                f,
                "  a case whose course rightly hangs on the host's rooms says them in its head: room: WHICH"
            )?,
            _ => {}
        }
        write!(f, "  again: {}", self.again)
    }
}
