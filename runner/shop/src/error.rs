//! Why a shop cannot be simulated with a plug-in.

use std::error::Error;

use softplug_abi::Failure;
use softplug_link::LinkFault;
use softplug_machines::xon_xoff::ControlOptionsError;
use thiserror::Error;

/// Why a shop cannot be simulated with a plug-in. `machine` is its name.
#[derive(Debug, Error)]
pub enum ShopFault<F: Error + 'static> {
    /// No serial line is so fast.
    #[error("{machine}: a line of {bits_per_second} bit/s cannot be simulated; give it at most {most}", most = u32::MAX)]
    Rate {
        /// Which machine.
        machine: String,
        /// What its line would have.
        bits_per_second: f64,
    },
    /// There is no such control.
    #[error("{machine}: {error}")]
    Control {
        /// Which machine.
        machine: String,
        /// Why.
        error: ControlOptionsError,
    },
    /// The plug-in is broken.
    #[error("{machine}: {error}")]
    Plugin {
        /// Which machine.
        machine: String,
        /// What it did.
        error: LinkFault<F>,
    },
    /// The plug-in gives up its job.
    #[error("{machine}: the plug-in ends its job: {failure}")]
    Job {
        /// Which machine.
        machine: String,
        /// Why.
        failure: Failure,
    },
    /// The plug-in has ended a job that has no end.
    #[error("{machine}: the plug-in says that its job is done, which has no end")]
    Done {
        /// Which machine.
        machine: String,
    },
}
