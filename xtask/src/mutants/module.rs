//! Has every plug-in's module changed, one instruction at a time.

use std::process::{Command, ExitCode};

use crate::run::{cargo, status};
use crate::workspace::Workspace;
use crate::{Error, plugins};

/// Changes of a plug-in that are tried where it shall be quick.
const SAMPLE: &str = "60";
/// Where it may take an hour, and the sessions that are run against each: as many as for a verdict.
const LONG_SAMPLE: &str = "300";
const LONG_SESSIONS: &str = "2000";

/// Crossed traces of each profile that show whether the rest can be told.
const LONG_CROSSED: &str = "20000";

/// Scores each plug-in whose name contains the filter, by the profiles that it claims.
pub(crate) fn run(
    workspace: &Workspace,
    long: bool,
    filter: Option<&str>,
) -> Result<ExitCode, Error> {
    plugins::build(workspace, plugins::Report::Table)?;
    if long {
        let status = status(&mut write(workspace, filter))?;
        return Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
    }
    let softplug = plugins::build_command(workspace, false)?;
    let mut worst = ExitCode::SUCCESS;
    for plugin in workspace.plugins() {
        let name = plugin.name;
        if !name.contains(filter.unwrap_or_default()) {
            continue;
        }
        let mut command = Command::new(&softplug);
        command.arg("certify").arg(workspace.plugin_folder().join(format!("{name}.wasm")));
        // Each reference plug-in is called like the first of its profiles.
        command.args(["--profile", &name, "--score", SAMPLE]);
        if !status(&mut command)?.success() {
            worst = ExitCode::FAILURE;
        }
    }
    Ok(worst)
}

/// Writes the scores that are kept.
fn write(workspace: &Workspace, filter: Option<&str>) -> Command {
    let mut command = cargo();
    command.current_dir(workspace.root()).args(["run", "--release", "--quiet"]);
    command.args(["-p", super::PACKAGE, "--example", "scores", "--"]);
    command.arg(workspace.plugin_folder());
    command.args(["fixtures/scores.toml", LONG_SAMPLE, LONG_SESSIONS, LONG_CROSSED]);
    command.arg(filter.unwrap_or_default());
    command
}
