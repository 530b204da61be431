//! `softplug simulate pulse-lathe`.

use std::path::PathBuf;

use clap::Args;
use softplug_abi::Micros;
use softplug_machines::pulse_lathe::LatheOptions;

use super::{Common, RunOptions};
use crate::failure::Failure;
use crate::files;

/// A lathe without a control, which takes every feed pulse from its line.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports: pulses, where the axes stand,
/// gaps inside cuts, and what was lost at limit switches. Ends with 1 if there was a gap, a pulse
/// was lost, or it did not get what was expected. A pseudo-terminal keeps no rate: what arrives
/// waits as in a port, and leaves one byte each 250 µs. Send with a --depth that lasts for as long
/// as the computer may be late, such as 250.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug simulate pulse-lathe
  softplug simulate pulse-lathe --once --picture part.svg
  softplug simulate pulse-lathe --blank-diameter 30 --blank-length 80 --start-x 32 --start-z 2")]
pub(super) struct PulseLathe {
    /// Diameter of the blank in mm
    #[arg(long, default_value_t = 40.0, value_name = "MM", value_parser = millimetres)]
    blank_diameter: f64,
    /// Length of the blank in mm
    #[arg(long, default_value_t = 60.0, value_name = "MM", value_parser = millimetres)]
    blank_length: f64,
    /// Where the tool begins, as a diameter in mm
    #[arg(long, default_value_t = 50.0, value_name = "MM", value_parser = millimetres)]
    start_x: f64,
    /// Where the tool begins, in mm to the right of the blank's face
    #[arg(long, default_value_t = 5.0, value_name = "MM", value_parser = millimetres)]
    start_z: f64,
    /// How far x can go from there, in mm of radius
    #[arg(long, default_value_t = 100.0, value_name = "MM", value_parser = millimetres)]
    x_limit: f64,
    /// How far z can go from there, in mm
    #[arg(long, default_value_t = 200.0, value_name = "MM", value_parser = millimetres)]
    z_limit: f64,
    /// Increments of a turn of the spindle
    #[arg(long, default_value_t = 1_024, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=65_535))]
    increments: u64,
    /// Turns a minute of a speed step
    #[arg(long, default_value_t = 50, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000))]
    turns: u64,
    /// How long S, T and M take
    #[arg(long, default_value_t = 5, value_name = "MILLISECONDS", value_parser = clap::value_parser!(i64).range(0..=60_000))]
    work_time: i64,
    /// Draw the turned part and the way of the tool, as SVG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// A simulation that was checked.
pub(crate) struct PulseLatheSimulation {
    pub(crate) options: LatheOptions,
    pub(crate) picture: Option<PathBuf>,
    pub(crate) run: RunOptions,
}

impl PulseLathe {
    pub(super) fn prepare(self) -> Result<PulseLatheSimulation, Failure> {
        let (x_limit, z_limit) = (pulses(self.x_limit, 200.0), pulses(self.z_limit, 100.0));
        let options = LatheOptions {
            blank_radius: pulses(self.blank_diameter, 100.0),
            blank_length: pulses(self.blank_length, 100.0) as u32,
            start_x: pulses(self.start_x, 100.0),
            start_z: pulses(self.start_z, 100.0),
            x_limits: (-x_limit, x_limit),
            z_limits: (-z_limit, z_limit),
            increments: self.increments,
            turns_a_step: self.turns,
            work_time: Micros::from_millis(self.work_time),
        };
        options.check().map_err(Failure::usage)?;
        if let Some(picture) = &self.picture {
            files::check_picture(picture, "--picture")?;
        }
        let run = self.common.run_options(false)?;
        Ok(PulseLatheSimulation { options, picture: self.picture, run })
    }
}

fn pulses(millimetres: f64, of_one: f64) -> i64 {
    (millimetres * of_one).round() as i64
}

fn millimetres(text: &str) -> Result<f64, String> {
    let millimetres = text.parse::<f64>().ok().filter(|mm| (0.0..=1_000.0).contains(mm));
    millimetres.ok_or_else(|| "give mm, 0 to 1000".to_owned())
}
