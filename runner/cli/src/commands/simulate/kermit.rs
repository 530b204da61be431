//! `softplug simulate kermit`.

use std::path::PathBuf;

use clap::Args;
use softplug_abi::LineParameters;
use softplug_machines::kermit::Options;

use super::{Common, RunOptions};
use crate::failure::Failure;
use crate::files;

/// A machine that speaks Kermit: it takes files, sends one, or asks for one.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports: transfers, packets, bytes. Behind
/// a transfer it begins anew. Ends with 1 if a transfer failed, none took place, or it did not get
/// what was expected.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug simulate kermit
  softplug simulate kermit --check 1 --once --out came.nc
  softplug simulate kermit --file O0001.nc --long 1000 --once
  softplug simulate kermit --ask O0002.NC --damage 3 --lose 5 --once")]
pub(super) struct Kermit {
    /// Baud rate; it paces what the machine itself sends
    #[arg(long, default_value_t = 9_600, value_parser = clap::value_parser!(u32).range(50..=16_000_000))]
    baud: u32,
    /// The best check that it offers
    #[arg(long, value_name = "TYPE", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=3))]
    check: u8,
    /// Take packets of up to so many characters
    #[arg(long, value_name = "CHARACTERS", value_parser = clap::value_parser!(u16).range(100..=9_024))]
    long: Option<u16>,
    /// Send this file, under its name
    #[arg(long, value_name = "FILE", conflicts_with = "ask")]
    file: Option<PathBuf>,
    /// Ask for the file of this name, and take it
    #[arg(long, value_name = "NAME")]
    ask: Option<String>,
    /// Turn a bit of this packet, counted from 1 as they come or go; may be repeated
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    damage: Vec<u32>,
    /// Lose this answer of its own, counted from 1; may be repeated
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    lose: Vec<u32>,
    #[command(flatten)]
    common: Common,
}

/// A simulation that was checked.
pub(crate) struct KermitSimulation {
    pub(crate) options: Options,
    pub(crate) run: RunOptions,
}

impl Kermit {
    pub(super) fn prepare(self) -> Result<KermitSimulation, Failure> {
        let file = self.file.as_deref().map(|path| {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
            files::read(path).map(|bytes| (name.unwrap_or_default(), bytes))
        });
        let file = file.transpose()?;
        let sends = file.is_some();
        let options = Options {
            line: LineParameters::new(self.baud),
            check: self.check.into(),
            long: self.long.map(usize::from),
            file,
            wanted: self.ask,
            damaged: self.damage,
            lost: self.lose,
            ..Options::default()
        };
        Ok(KermitSimulation { options, run: self.common.run_options(sends)? })
    }
}
