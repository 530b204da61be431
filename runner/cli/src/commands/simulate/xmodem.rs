//! `softplug simulate xmodem`.

use std::path::PathBuf;

use clap::Args;
use softplug_abi::LineParameters;
use softplug_machines::xmodem::Options;

use super::{Common, RunOptions};
use crate::failure::Failure;
use crate::files;

/// A control that speaks XMODEM: it calls for files, or sends one to whoever calls.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports: transfers, blocks, bytes. Behind
/// a transfer it begins anew. Ends with 1 if a transfer failed, none took place, or it did not get
/// what was expected. What it receives ends with the padding of the last block.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug simulate xmodem
  softplug simulate xmodem --checksum --once --out came.nc
  softplug simulate xmodem --file O0001.nc --long --once
  softplug simulate xmodem --damage 3 --lose 5 --once")]
pub(super) struct Xmodem {
    /// Baud rate; it paces what the control itself sends
    #[arg(long, default_value_t = 9_600, value_parser = clap::value_parser!(u32).range(50..=16_000_000))]
    baud: u32,
    /// Call with NAK, for checksums, instead of C
    #[arg(long, conflicts_with = "file")]
    checksum: bool,
    /// Send this file to whoever calls
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    /// Send it in blocks of 1,024 bytes
    #[arg(long, requires = "file")]
    long: bool,
    /// Turn a bit of this block, counted from 1 as they come or go; may be repeated
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    damage: Vec<u32>,
    /// Lose this answer of its own, counted from 1; may be repeated
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    lose: Vec<u32>,
    #[command(flatten)]
    common: Common,
}

/// A simulation that was checked.
pub(crate) struct XmodemSimulation {
    pub(crate) options: Options,
    pub(crate) run: RunOptions,
}

impl Xmodem {
    pub(super) fn prepare(self) -> Result<XmodemSimulation, Failure> {
        let file = self.file.as_deref().map(files::read).transpose()?;
        let sends = file.is_some();
        let options = Options {
            line: LineParameters::new(self.baud),
            is_crc: !self.checksum,
            file,
            is_long: self.long,
            damaged: self.damage,
            lost: self.lose,
            ..Options::default()
        };
        Ok(XmodemSimulation { options, run: self.common.run_options(sends)? })
    }
}
