//! Why a trial told nothing of the program.

use std::error::Error;
use std::io;

use softplug_link::LinkFault;
use softplug_machines::{fanuc, pulse_lathe, r3964};
use thiserror::Error;

use crate::budget::MeteredFault;
use crate::reason::WAITS;

/// Why a trial told nothing, by who is to blame. `E` is what making an instance may fail with, `F`
/// what one may end with.
///
/// ```
/// use softplug_trial::TrialError;
///
/// type Error = TrialError<std::fmt::Error, std::fmt::Error>;
/// assert_eq!(Error::Spent.to_string(), "it takes more computing than a trial may");
/// assert_eq!(
///     Error::Waits.to_string(),
///     "the plug-in waits for something that only a real partner sends"
/// );
/// ```
#[derive(Debug, Error)]
pub enum TrialError<E: Error + 'static, F: Error + 'static> {
    /// No instance of the plug-in can be made.
    #[error(transparent)]
    Instance(E),
    /// The plug-in trapped, used up its fuel for an event or broke a rule of the ABI.
    #[error("the plug-in cannot go on: {0}")]
    Plugin(LinkFault<MeteredFault<F>>),
    /// No partner can be made for these settings.
    #[error(transparent)]
    Partner(#[from] PartnerError),
    /// The program cannot be read.
    #[error("the program cannot be read: {0}")]
    Program(#[source] io::Error),
    /// The program has more different characters than the budget allows.
    #[error("it has more than {most} different characters")]
    Characters {
        /// That many are tried.
        most: usize,
    },
    /// There is nobody for the plug-in to speak with.
    #[error("{WAITS}")]
    Waits,
    /// The budget is used up.
    #[error("it takes more computing than a trial may")]
    Spent,
    /// Somebody has stopped it.
    #[error("the trial was stopped")]
    Stopped,
}

/// Why there is no partner for a plug-in with its settings.
///
/// ```
/// use softplug_machines::r3964::OptionsError;
/// use softplug_trial::PartnerError;
///
/// let error = PartnerError::from(OptionsError::NoTime);
/// assert_eq!(error.to_string(), OptionsError::NoTime.to_string());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum PartnerError {
    /// No station of the 3964 family.
    #[error(transparent)]
    R3964(#[from] r3964::OptionsError),
    /// No FANUC control.
    #[error(transparent)]
    Fanuc(#[from] fanuc::OptionsError),
    /// No lathe without a control.
    #[error(transparent)]
    Lathe(#[from] pulse_lathe::LatheOptionsError),
}
