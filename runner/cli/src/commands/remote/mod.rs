//! What every verb that speaks with a gateway takes.

#[cfg(target_os = "linux")]
pub(super) mod client;
#[cfg(target_os = "linux")]
mod measured;
#[cfg(target_os = "linux")]
pub(super) mod show;

#[cfg(target_os = "linux")]
pub(super) use measured::measured;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use softplug_live::quantity;

/// Where the gateway is, and who we are.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "The gateway")]
pub(crate) struct Remote {
    /// Its address; $SOFTPLUG_GATEWAY, or http://127.0.0.1:8117
    #[arg(long, global = true, value_name = "URL")]
    pub(crate) gateway: Option<String>,
    /// File with the token; without it $SOFTPLUG_TOKEN is the token
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
    /// Certificate (PEM) of the authority that signed the gateway's
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) ca: Option<PathBuf>,
}

/// From when to when.
#[derive(Clone, Debug, Args)]
pub(crate) struct Within {
    /// Of the last so much time, such as 8h or 7d
    #[arg(long, value_name = "SPAN", value_parser = quantity::span)]
    pub(crate) since: Option<Duration>,
    /// From before the last so much time
    #[arg(long, value_name = "SPAN", value_parser = quantity::span)]
    pub(crate) until: Option<Duration>,
}

#[cfg(not(target_os = "linux"))]
pub(super) fn measured(
    _: &Remote,
    _: Option<&str>,
) -> Result<softplug_plan::Measured, crate::failure::Failure> {
    Err(crate::failure::Failure::only_on_linux("speaking with a gateway"))
}
