//! What every verb that speaks with a gateway takes.

use std::path::PathBuf;

use clap::Args;

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
