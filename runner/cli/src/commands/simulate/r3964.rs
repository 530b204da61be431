//! `softplug simulate r3964` and `r3964-simplified`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use softplug_abi::{LineParameters, Micros};
use softplug_machines::r3964::{Fault, Faults, Noise, Options, Priority, When, rk512};

use super::{Common, RunOptions, faults, micros, seconds};
use crate::failure::Failure;
use crate::files;

const EXAMPLES: &str = "Examples:
  softplug simulate r3964
  softplug simulate r3964 --once --expect telegram.bin
  softplug simulate r3964 --send telegrams.bin --every 0.5 --fault wrong-check@2
  softplug simulate r3964 --fault nak-acknowledgement --fault no-answer@50/1000 --seed 7
  softplug simulate r3964 --noise 2 --seed 1
  softplug simulate r3964 --rk512 --memory DB5=64 --memory DB16=words.bin";

const SIMPLIFIED_EXAMPLES: &str = "Examples:
  softplug simulate r3964-simplified --once --expect telegram.bin
  softplug simulate r3964-simplified --no-handshake --send telegrams.bin
  softplug simulate r3964-simplified --fault nak-answer --fault wrong-check@always";

/// A station that speaks 3964R or 3964, sends and receives blocks, and makes faults on demand.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports: blocks, repetitions, conflicts,
/// errors. Ends with 1 if one of its own blocks was not acknowledged or it did not get what was
/// expected. It has high priority unless told otherwise, so that the plug-in's default fits. A
/// pseudo-terminal carries no parity and no breaks.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
#[command(after_long_help = format!("{EXAMPLES}\n\n{}", faults::HELP))]
pub(super) struct R3964 {
    #[command(flatten)]
    station: Station,
    /// React to RK512 commands, out of the areas given with --memory
    #[arg(long, conflicts_with_all = ["send", "expect", "out"])]
    rk512: bool,
    /// An area: so many bytes of zeros, or the content of a file; DB5, DX5, I, Q, M, T, C
    #[arg(long, value_name = "AREA=BYTES|FILE", requires = "rk512", value_parser = area)]
    memory: Vec<(rk512::Area, Memory)>,
}

/// A station that speaks simplified 3964R: three tries of STX, one of the block, no priorities.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports. Takes all that `softplug simulate
/// r3964` takes, except RK512.
#[derive(Debug, Args)]
#[command(after_help = SIMPLIFIED_EXAMPLES)]
#[command(after_long_help = format!("{SIMPLIFIED_EXAMPLES}\n\n{}", faults::HELP))]
pub(super) struct R3964Simplified {
    #[command(flatten)]
    station: Station,
}

#[derive(Debug, Args)]
struct Station {
    /// Baud rate; it paces what the station itself sends
    #[arg(long, default_value_t = 9_600, value_parser = clap::value_parser!(u32).range(50..=16_000_000))]
    baud: u32,
    /// Blocks end without a block check character: 3964
    #[arg(long)]
    no_bcc: bool,
    /// STX, data and end go in one, without waiting for DLE
    #[arg(long)]
    no_handshake: bool,
    /// A DLE in the data goes once
    #[arg(long)]
    no_doubling: bool,
    /// Who gives way when both begin at once [default: high; simplified: none]
    #[arg(long, value_enum, value_name = "WHO")]
    priority: Option<PriorityBy>,
    /// Acknowledgement delay [default: 2000, without BCC 550]
    #[arg(long, value_name = "MILLISECONDS", value_parser = millis(1))]
    qvz: Option<i64>,
    /// Character delay [default: 220]
    #[arg(long, value_name = "MILLISECONDS", value_parser = millis(1))]
    zvz: Option<i64>,
    /// Wait for a bad block's repetition [default: 4000; simplified: 0]
    #[arg(long, value_name = "MILLISECONDS", value_parser = millis(0))]
    bwz: Option<i64>,
    /// Wait for a free buffer [default: 400; simplified: 0]
    #[arg(long, value_name = "MILLISECONDS", value_parser = millis(0))]
    buffer_wait: Option<i64>,
    /// Tries of STX [default: 6; simplified: 3]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=255))]
    setup_attempts: Option<u32>,
    /// Tries of a whole block [default: 6; simplified: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=255))]
    transmission_attempts: Option<u32>,
    /// Largest block [default: 1024; simplified: 128]
    #[arg(long, value_name = "BYTES", value_parser = clap::value_parser!(u32).range(1..=65_535))]
    block_size: Option<u32>,
    /// How long the station takes to react
    #[arg(long, default_value_t = 0, value_name = "MICROSECONDS", value_parser = clap::value_parser!(i64).range(0..=10_000_000))]
    reaction: i64,
    /// Send this file, in blocks of the largest size
    #[arg(long, value_name = "FILE")]
    send: Option<PathBuf>,
    /// Seconds until the first block
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, requires = "send", value_parser = seconds)]
    send_after: f64,
    /// Seconds from one block's beginning to the next
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, requires = "send", value_parser = seconds)]
    every: f64,
    /// A fault: its name, value and when it happens.
    #[arg(
        help = "A fault, NAME[=VALUE][@WHEN]; may be repeated; --help lists them",
        long, value_name = "FAULT", value_parser = faults::parse)]
    fault: Vec<(When, Fault)>,
    /// Characters in a thousand with a wrong bit, either way
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1_000))]
    noise: u16,
    /// Characters in a thousand that are lost, either way
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1_000))]
    drop: u16,
    /// Seed of all that happens by chance
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    common: Common,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, ValueEnum)]
enum PriorityBy {
    Low,
    High,
    None,
}

/// What an area holds.
#[derive(Clone, Debug)]
enum Memory {
    Zeros(usize),
    File(PathBuf),
}

/// A simulation that was checked.
pub(crate) struct R3964Simulation {
    pub(crate) options: Options,
    pub(crate) noise: Noise,
    /// Blocks to send.
    pub(crate) blocks: Vec<Vec<u8>>,
    pub(crate) send_after: Micros,
    pub(crate) every: Micros,
    /// RK512 with these areas.
    pub(crate) memory: Option<Vec<(rk512::Area, Vec<u8>)>>,
    pub(crate) run: RunOptions,
}

impl R3964 {
    pub(super) fn prepare(self) -> Result<R3964Simulation, Failure> {
        let mut simulation = self.station.prepare(&Options::default())?;
        if self.rk512 {
            let load = |(area, memory)| match memory {
                Memory::Zeros(bytes) => Ok((area, vec![0; bytes])),
                Memory::File(path) => Ok((area, files::read(&path)?)),
            };
            let areas: Result<_, Failure> = self.memory.into_iter().map(load).collect();
            simulation.memory = Some(areas?);
        }
        Ok(simulation)
    }
}

impl R3964Simplified {
    pub(super) fn prepare(self) -> Result<R3964Simulation, Failure> {
        self.station.prepare(&Options::simplified())
    }
}

impl Station {
    fn prepare(self, normal: &Options) -> Result<R3964Simulation, Failure> {
        let millis = |value: Option<i64>, normal| value.map_or(normal, Micros::from_millis);
        let qvz = if self.no_bcc { Options::without_check().qvz } else { normal.qvz };
        let options = Options {
            line: LineParameters::new(self.baud),
            bcc: !self.no_bcc,
            handshake: !self.no_handshake,
            doubling: !self.no_doubling,
            priority: match self.priority {
                Some(PriorityBy::Low) => Priority::Low,
                Some(PriorityBy::High) => Priority::High,
                Some(PriorityBy::None) => Priority::None,
                None => normal.priority,
            },
            qvz: millis(self.qvz, qvz),
            zvz: millis(self.zvz, normal.zvz),
            bwz: millis(self.bwz, normal.bwz),
            buffer_wait: millis(self.buffer_wait, normal.buffer_wait),
            setup_attempts: self.setup_attempts.unwrap_or(normal.setup_attempts),
            transmission_attempts: self
                .transmission_attempts
                .unwrap_or(normal.transmission_attempts),
            block_size: self.block_size.map_or(normal.block_size, |size| size as usize),
            reaction: Micros(self.reaction),
            faults: Faults { seed: self.seed, plan: self.fault },
            ..normal.clone()
        };
        options.check().map_err(Failure::usage)?;
        let bytes = self.send.as_deref().map(files::read).transpose()?.unwrap_or_default();
        Ok(R3964Simulation {
            blocks: bytes.chunks(options.block_size).map(<[u8]>::to_vec).collect(),
            noise: Noise {
                seed: self.seed,
                flip_one: self.noise,
                drop: self.drop,
                ..Noise::default()
            },
            options,
            send_after: micros(self.send_after),
            every: micros(self.every),
            memory: None,
            run: self.common.run_options(self.send.is_some())?,
        })
    }
}

fn millis(least: i64) -> clap::builder::RangedI64ValueParser<i64> {
    clap::value_parser!(i64).range(least..=600_000)
}

/// `DB5=64` or `M=flags.bin`.
fn area(text: &str) -> Result<(rk512::Area, Memory), String> {
    let (area, content) =
        text.split_once('=').ok_or("an area is written AREA=BYTES or AREA=FILE")?;
    let number = |digits: &str| digits.parse::<u8>().ok();
    let area = match area {
        "I" => Some(rk512::Area::Inputs),
        "Q" => Some(rk512::Area::Outputs),
        "M" => Some(rk512::Area::Flags),
        "T" => Some(rk512::Area::Timers),
        "C" => Some(rk512::Area::Counters),
        _ => match area.split_at_checked(2) {
            Some(("DB", digits)) => number(digits).map(rk512::Area::Db),
            Some(("DX", digits)) => number(digits).map(rk512::Area::Dx),
            _ => None,
        },
    };
    let area = area.ok_or("the areas are DB0 to DB255, DX0 to DX255, I, Q, M, T and C")?;
    let memory = match content.parse::<usize>() {
        Ok(bytes) if bytes <= 65_536 => Memory::Zeros(bytes),
        Ok(_) => return Err("an area has at most 65536 bytes".to_owned()),
        Err(_) => Memory::File(PathBuf::from(content)),
    };
    Ok((area, memory))
}
