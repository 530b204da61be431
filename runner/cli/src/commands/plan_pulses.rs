//! `softplug plan --pulses`: how many lathes one computer gives their feed pulses.

use clap::Args;
use serde::Serialize;
use softplug_plan::span::{self, shown};
use softplug_plan::{PulseBudget, Pulses};

use crate::exit::Exit;
use crate::numbers::count;
use crate::screen::Screen;
use crate::table::Table;

#[derive(Debug, Args)]
pub(super) struct PulseArguments {
    /// Plan machines that take their feed pulses from one computer: periods a second, in each of which
    /// a machine may take a pulse
    #[arg(long, value_name = "RATE", value_parser = rate, requires = "service", conflicts_with_all = ["shop", "cell", "tried", "from"])]
    pub(super) pulses: Option<f64>,
    /// Time to compute one period of one machine, as `50us` or `40ns`
    #[arg(long, value_name = "TIME", value_parser = time, requires = "pulses")]
    service: Option<f64>,
    /// Time to enter and leave an interrupt
    #[arg(long, value_name = "TIME", value_parser = time, default_value = "60us")]
    interrupt: f64,
    /// Time to write one batch to a port
    #[arg(long, value_name = "TIME", value_parser = time, default_value = "5us")]
    write: f64,
    /// Periods in a batch
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    batch: u32,
}

/// The budgets, for machines.
#[derive(Serialize)]
struct Document {
    #[serde(flatten)]
    pulses: Pulses,
    interrupts: PulseBudget,
    polling: PulseBudget,
    batches: PulseBudget,
}

pub(super) fn run(rate: f64, arguments: &PulseArguments, screen: &Screen) -> Exit {
    let PulseArguments { interrupt, write, batch, .. } = *arguments;
    let service = arguments.service.unwrap_or_default();
    let pulses = Pulses { rate, service, interrupt, write, batch };
    let document = Document {
        pulses,
        interrupts: pulses.by_interrupts(),
        polling: pulses.by_polling(),
        batches: pulses.by_batches(),
    };
    let mut table = Table::new(["served by", "most machines", "longest service for 4"]);
    for (name, budget) in [
        ("interrupts", document.interrupts),
        ("polling", document.polling),
        ("batches", document.batches),
    ] {
        let longest = match budget.longest_service {
            longest if longest <= 0.0 => "none will do".to_owned(),
            longest => shown(longest),
        };
        table.row([name.to_owned(), count(budget.machines), longest]);
    }
    screen.say(format_args!(
        "{} periods a second, {} to compute one; an interrupt takes {}, a batch of {batch} {} to write",
        count(rate as u64),
        shown(service),
        shown(interrupt),
        shown(write),
    ));
    screen.say(table);
    screen.say(format_args!(
        "  a batch lasts {}: so late may the next one be",
        shown(pulses.batch_seconds())
    ));
    screen.document(&document);
    Exit::Done
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok().filter(|rate| (1.0..=1e9).contains(rate));
    rate.ok_or_else(|| "give periods a second from 1 to 1e9".to_owned())
}

fn time(text: &str) -> Result<f64, String> {
    let seconds = span::seconds(text).ok().filter(|seconds| *seconds > 0.0 && *seconds <= 1.0);
    seconds.ok_or_else(|| "give a number and a unit, such as 40ns, 50us or 1ms".to_owned())
}
