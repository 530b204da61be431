//! The machine that is spoken to, out of the catalogue.

use std::env;
use std::path::PathBuf;

use clap::Args;
use softplug_catalogue::{Catalogue, Machine};

use crate::failure::Failure;
use crate::guess::nearest;

/// Where machines are looked for.
#[derive(Debug, Args)]
pub(crate) struct Machines {
    /// Folder with .toml files of machines of your own [env: SOFTPLUG_MACHINES]
    #[arg(long, value_name = "DIR")]
    machines: Option<PathBuf>,
}

impl Machines {
    /// The machines that are known, and those of the folder.
    pub(crate) fn load(&self) -> Result<Catalogue, Failure> {
        let mut catalogue = Catalogue::known();
        let variable = env::var_os("SOFTPLUG_MACHINES").filter(|folder| !folder.is_empty());
        if let Some(folder) = self.machines.clone().or(variable.map(PathBuf::from)) {
            catalogue.add_folder(&folder).map_err(Failure::usage)?;
        }
        Ok(catalogue)
    }
}

/// The machine of this name.
pub(crate) fn find<'a>(catalogue: &'a Catalogue, name: &str) -> Result<&'a Machine, Failure> {
    catalogue.find(name).ok_or_else(|| {
        let failure = Failure::usage(format_args!("there is no machine \"{name}\""));
        let names = catalogue.machines().iter().map(|machine| &*machine.name);
        match nearest(name, names) {
            Some(meant) => failure.hint(format_args!("did you mean \"{meant}\"?")),
            None => failure.hint("`softplug machine list` lists them"),
        }
    })
}

/// The machine at the other end.
#[derive(Debug, Args)]
pub(crate) struct MachineArguments {
    /// The machine: its plug-in, line and settings, where no others are given
    #[arg(long, short, value_name = "MACHINE")]
    machine: Option<String>,
    #[command(flatten)]
    machines: Machines,
}

impl MachineArguments {
    /// The machine that was asked for.
    pub(crate) fn find(&self) -> Result<Option<Machine>, Failure> {
        let Some(name) = &self.machine else { return Ok(None) };
        find(&self.machines.load()?, name).cloned().map(Some)
    }
}
