//! Why there is no report.

/// There is no report.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::certify::{CertifyError, CertifyOptions, Loaded, certify};
/// use std::sync::atomic::AtomicBool;
///
/// let (corpus, options) = (Corpus::embedded(), CertifyOptions::new("xon"));
/// let nothing = Loaded::new(b"")?;
/// let error = certify(&nothing, &corpus, &options, &|_| {}, &AtomicBool::new(false)).unwrap_err();
/// assert!(matches!(&error, CertifyError::UnknownProfile { name, .. } if name == "xon"));
/// assert!(error.to_string().starts_with("there is no profile \"xon\"; there are 3964, abi,"));
/// # Ok::<(), CertifyError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CertifyError {
    /// The corpus has no such profile.
    #[error("there is no profile \"{name}\"; there are {known}")]
    UnknownProfile {
        /// The name.
        name: String,
        /// All that there are.
        known: String,
    },
    /// The profile has no such revision.
    #[error("the profile \"{profile}\" has no revision {revision}; the newest is {newest}")]
    UnknownRevision {
        /// The profile.
        profile: String,
        /// The revision.
        revision: u32,
        /// The newest.
        newest: u32,
    },
    /// No case fits the patterns.
    #[error(
        "no case of the profile \"{profile}\" is selected; `softplug cases --profile {profile}` lists them"
    )]
    NothingSelected {
        /// The profile.
        profile: String,
    },
    /// A case of the profile cites what its ledger does not have.
    #[error(
        "{case}: the ledger has no clause \"{clause}\"; `softplug cases --lint` lists all that is wrong with the corpus"
    )]
    UnknownClause {
        /// The case.
        case: String,
        /// The clause.
        clause: String,
    },
    /// The two engines show different things: a fault of the suite or of an engine.
    #[error(
        "{case}: the engines {first} and {second} do different things; this is no fault of the plug-in, report it"
    )]
    EnginesDiffer {
        /// The case.
        case: String,
        /// One engine.
        first: String,
        /// The other.
        second: String,
    },
    /// The suite failed.
    #[error("the suite failed, which is no fault of the plug-in: {0}")]
    Internal(String),
}
