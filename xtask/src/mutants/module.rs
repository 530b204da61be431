//! Has the command score every plug-in: its module is changed, one instruction at a time.

use std::process::{Command, ExitCode};

use crate::run::status;
use crate::workspace::Workspace;
use crate::{Error, plugins};

/// Changes of a plug-in that are tried where not all of them are.
const SAMPLE: &str = "60";

/// Scores each plug-in whose name contains the filter, by the profiles that it claims.
pub(crate) fn run(
    workspace: &Workspace,
    all: bool,
    filter: Option<&str>,
) -> Result<ExitCode, Error> {
    plugins::build(workspace, plugins::Report::Table)?;
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
        command.args(["--profile", &name, "--score", if all { "all" } else { SAMPLE }]);
        if !status(&mut command)?.success() {
            worst = ExitCode::FAILURE;
        }
    }
    Ok(worst)
}
