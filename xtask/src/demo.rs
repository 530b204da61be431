//! The main job, from a fresh clone: build all, then `softplug demo`.

use std::process::{Command, ExitCode};

use crate::run;
use crate::workspace::Workspace;
use crate::{Error, plugins};

/// Ends with the exit code of `softplug demo`.
pub(crate) fn run(workspace: &Workspace, arguments: &[String]) -> Result<ExitCode, Error> {
    // Optimised it would take more than twice as long to build, and show the same.
    if !plugins::built_command(workspace, true).exists() {
        eprintln!(
            "the first build takes 5 to 8 minutes on two cores, later ones seconds; the \
             demonstration then takes a minute"
        );
    }
    plugins::build(workspace, plugins::Report::Table)?;
    let softplug = plugins::build_command(workspace, true)?;
    let mut command = Command::new(softplug);
    command
        .current_dir(workspace.root())
        .env("SOFTPLUG_PLUGINS", workspace.plugin_folder())
        .arg("demo")
        .args(arguments);
    let status = run::status(&mut command)?;
    let code = status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1);
    Ok(ExitCode::from(code))
}
