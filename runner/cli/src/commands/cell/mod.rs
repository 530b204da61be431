//! `softplug cell`: links that work together, in a running gateway.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use clap::{Args, Subcommand, ValueEnum};

use super::remote::Remote;

/// Shows cells of links that work together, gives axes to channels and lets a cell go on
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug cell show shafts
  softplug cell force shafts GANTRY lathe-2
  softplug cell mode shafts LATHES jog-in-auto")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    #[command(flatten)]
    pub(crate) remote: Remote,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Lists the cells: who runs, who waits, what is stuck
    #[command(after_help = "Example:
  softplug cell list")]
    List,
    /// Shows a cell: its channels, axes, groups, and what would free who is stuck
    #[command(after_help = "Examples:
  softplug cell show shafts
  softplug cell show shafts --json")]
    Show(Named),
    #[command(after_help = "Example:
  softplug cell release shafts gantry")]
    Release(Release),
    #[command(after_help = "Example:
  softplug cell force shafts gantry lathe-2")]
    Force(Force),
    #[command(after_help = "Example:
  softplug cell mode shafts turning jog")]
    Mode(Choice),
    /// Lets programs begin again after the gateway was ended in the middle of the cell's work
    #[command(after_help = "Example:
  softplug cell clear shafts")]
    Clear(Named),
}

// A cell by its name; the verb says what for.
#[derive(Debug, Args)]
pub(crate) struct Named {
    /// Name of the cell
    pub(crate) cell: String,
}

/// Makes an axis neutral, whoever has it: the next in its queue gets it
#[derive(Debug, Args)]
pub(crate) struct Release {
    /// Name of the cell
    pub(crate) cell: String,
    /// Name of the axis
    pub(crate) axis: String,
}

/// Gives an axis to a channel, whoever has it; who loses it stands until it has it back
#[derive(Debug, Args)]
pub(crate) struct Force {
    /// Name of the cell
    pub(crate) cell: String,
    /// Name of the axis
    pub(crate) axis: String,
    /// The channel that gets it
    pub(crate) channel: String,
}

/// Chooses the mode of a group of channels
#[derive(Debug, Args)]
pub(crate) struct Choice {
    /// Name of the cell
    pub(crate) cell: String,
    /// Name of the group; a channel without a group is one of its own
    pub(crate) group: String,
    /// The mode
    #[arg(value_enum, ignore_case = true)]
    pub(crate) mode: GroupMode,
}

/// A mode.
#[derive(Copy, Clone, Debug, ValueEnum)]
pub(crate) enum GroupMode {
    /// Programs run
    Auto,
    /// AUTO, while axes are moved by hand: programs stand where they are
    JogInAuto,
    /// Only what a person begins runs
    Mda,
    /// Axes are moved by hand; nothing begins
    Jog,
}
