//! `softplug plan`: how large the buffers of units on one bus must be.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{ArgGroup, Args};
use serde::Serialize;
use softplug_live::plain_text;
use softplug_plan::{
    DEFAULT_MARGIN, Discipline, MOST_FILE_BYTES, MachinePlan, Options, Outcome, Plan, Shop,
    ShopError, Taken, Wrong, picture, picture_of, plan, simulate,
};

use super::plan_cell::{self, CellArguments};
use super::plan_pulses::{self, PulseArguments};
use super::remote::{self, Remote};
use super::with_plugin;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers::{count, span, things};
use crate::plugin::{Chosen, Library};
use crate::screen::{BAD, GOOD, HEADING, Screen, WARNING};
use crate::table::Table;

/// Most changes that people are shown; machines get all.
const MOST_SHOWN: usize = 6;
/// Rounds that are drawn of a shop with a plug-in.
const ROUNDS: f64 = 3.0;

/// Says how large the buffers of units on one bus must be, so that no machine runs dry.
///
/// Each machine has a unit that takes data from the bus and gives it to the control over a serial
/// line. The file has the bus and the machines. If no buffers will do, it is said which constraint
/// of which machine fails, and which change would mend it.
///
/// With --cell it replays programs of machines that work together, without machines: how long they
/// take together, where each waits, and deadlocks before anything is cut. With --pulses it says how
/// many machines one computer can give their feed pulses.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("tried").multiple(true))]
#[command(after_help = "Examples:
  softplug plan shop.toml
  softplug plan shop.toml --svg levels.svg
  softplug plan shop.toml --simulate 10 --json
  softplug plan shop.toml --simulate 1 --plugin xon-xoff
  softplug plan shop.toml --from http://gateway:8117
  softplug plan gateway.toml --cell shafts --program lathe-1=O1.nc --program lathe-2=O2.nc
  softplug plan --pulses 4000 --service 50us

The file:
  [bus]
  rate = 250_000        # bit/s
  efficiency = 0.4      # data bits of all bits
  switch = \"2ms\"        # from one unit to the next
  margin = 0.1          # optional: how much of each limit is left unused

  [[machine]]           # in the order of service
  name = \"mill\"
  rate = 19_200         # of the serial line, bit/s
  efficiency = 0.8
  consumes = 6_000      # data that the control takes at most, bit/s
  buffer = 256          # the control's own, bytes
  count = 8             # optional: so many that are alike")]
pub(crate) struct Arguments {
    /// The bus and its machines
    #[arg(value_name = "SHOP.TOML", required_unless_present = "pulses")]
    shop: Option<PathBuf>,
    /// Draw the levels of the first rounds, as simulated, into this file
    #[arg(long, value_name = "FILE", group = "tried")]
    svg: Option<PathBuf>,
    /// Also simulate 1 to 1000 whole virtual hours, each unit having the bus for a whole fill
    #[arg(
        long,
        value_name = "HOURS",
        value_parser = hours,
        allow_negative_numbers = true,
        group = "tried"
    )]
    simulate: Option<u16>,
    /// Picture and simulation are of this plug-in for XON/XOFF in each unit, byte by byte, served as
    /// a gateway serves them
    #[arg(long, value_name = "PLUGIN", requires = "tried")]
    plugin: Option<String>,
    #[command(flatten)]
    library: Library,
    #[command(flatten)]
    cell: CellArguments,
    #[command(flatten)]
    pulses: PulseArguments,
    /// Plan with what this gateway has measured: efficiency and switch of its bus, and what
    /// machines consume that are called as its links
    #[arg(long, value_name = "URL")]
    from: Option<String>,
    /// The gateway's bus, if it has several
    #[arg(long, value_name = "NAME", requires = "from")]
    bus: Option<String>,
    /// File with the token; without it $SOFTPLUG_TOKEN is the token
    #[arg(long, value_name = "FILE", requires = "from")]
    token_file: Option<PathBuf>,
    /// Certificate (PEM) of the authority that signed the gateway's
    #[arg(long, value_name = "FILE", requires = "from")]
    ca: Option<PathBuf>,
}

/// All results, for machines.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    plan: &'a Plan,
    #[serde(skip_serializing_if = "Option::is_none")]
    taken: Option<&'a [Taken]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    simulation: Option<&'a Simulation>,
}

#[derive(Serialize)]
struct Simulation {
    /// Whether no machine ran dry and no bit was lost, as far as it was simulated.
    holds: bool,
    /// Whether units fed their controls also while they were filled.
    feeds_while_filled: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    plugin: Option<SimulatedPlugin>,
    #[serde(flatten)]
    outcome: Outcome,
}

#[derive(Serialize)]
struct SimulatedPlugin {
    name: String,
    version: String,
    /// Machines at which another byte came than was sent.
    altered: Vec<String>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    if let Some(rate) = arguments.pulses.pulses {
        return Ok(plan_pulses::run(rate, &arguments.pulses, screen));
    }
    let file = arguments.shop.as_deref().unwrap_or(Path::new("shop.toml"));
    if let Some(cell) = &arguments.cell.cell {
        return plan_cell::plan_cell(file, cell, &arguments.cell, screen);
    }
    let shop = read(file)?;
    if let Some(file) = arguments.svg.as_ref().filter(|svg| is_same_file(svg, file)) {
        let file = shown(file);
        return Err(Failure::usage(format_args!(
            "{file} is the file of the shop itself, which the picture would overwrite; give --svg \
             another one"
        )));
    }
    let measured = arguments.from.as_ref().map(|url| with_measured(&shop, url, arguments));
    let (shop, taken) = match measured.transpose()? {
        Some((shop, taken)) => (shop, Some(taken)),
        None => (shop, None),
    };
    let plan = plan(&shop);
    let tried = Tried {
        plugin: arguments.plugin.as_deref().map(|name| arguments.library.load(name)).transpose()?,
        shop: &shop,
        plan: &plan,
        screen,
    };
    let simulation = arguments.simulate.map(|hours| tried.simulation(hours)).transpose()?;
    if let Some(file) = &arguments.svg {
        fs::write(file, tried.picture()?)
            .map_err(|error| Failure::usage(format_args!("{}: {error}", shown(file))))?;
    }
    let (of_gateway, simulated) = (taken.as_deref(), simulation.as_ref());
    screen.document(&Document { plan: &plan, taken: of_gateway, simulation: simulated });
    if plan.feasible {
        show(&shop, &plan, screen);
    } else {
        show_refusal(&shop, &plan, screen);
    }
    if let (Some(taken), Some(url)) = (&taken, &arguments.from) {
        for taken in taken {
            row(screen, "measured", taken);
        }
        if taken.is_empty() {
            row(
                screen,
                "measured",
                format_args!("nothing yet at {}: all is as in the file", plain_text(url)),
            );
        }
    }
    if let (Some(simulation), Some(hours)) = (&simulation, arguments.simulate) {
        show_simulation(simulation, hours, screen);
    }
    if let Some(file) = &arguments.svg {
        row(screen, "picture", shown(file));
    }
    let tried = match (simulation.is_some(), arguments.svg.is_some()) {
        _ if plan.feasible => None,
        (true, true) => Some("in simulation and picture"),
        (true, false) => Some("in the simulation"),
        (false, true) => Some("in the picture"),
        (false, false) => None,
    };
    if let Some(tried) = tried {
        row(screen, "buffers", format_args!("{tried}: the largest that constraint 3 allows"));
    }
    Ok(exit(&plan, simulation.as_ref()))
}

/// What is known to be wrong comes first, and then what is not known.
fn exit(plan: &Plan, simulation: Option<&Simulation>) -> Exit {
    match simulation {
        _ if !plan.feasible => Exit::Failed,
        Some(simulation) if !simulation.holds => Exit::Failed,
        Some(simulation) if !simulation.outcome.is_complete => Exit::Incomplete,
        _ => Exit::Done,
    }
}

/// The shop with what a gateway has measured.
fn with_measured(
    shop: &Shop,
    url: &str,
    arguments: &Arguments,
) -> Result<(Shop, Vec<Taken>), Failure> {
    let Arguments { token_file, ca, bus, .. } = arguments;
    let gateway = Some(url.to_owned());
    let remote = Remote { gateway, token_file: token_file.clone(), ca: ca.clone() };
    let measured = remote::measured(&remote, bus.as_deref())?;
    shop.with_measured(&measured).map_err(|error| {
        Failure::usage(format_args!("what {url} has measured cannot be planned with: {error}"))
    })
}

/// A file's name as it can be shown.
fn shown(file: &Path) -> String {
    plain_text(&file.display().to_string())
}

fn hours(text: &str) -> Result<u16, &'static str> {
    let hours = text.parse().ok().filter(|hours| (1..=1_000).contains(hours));
    hours.ok_or("give whole hours from 1 to 1000")
}

/// Whether both lead to one file, through links of either kind too.
fn is_same_file(one: &Path, other: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        // A terminal or a pipe can be both without harm.
        let identity = |path: &Path| {
            let file = fs::metadata(path).ok().filter(fs::Metadata::is_file)?;
            Some((file.dev(), file.ino()))
        };
        identity(one).is_some_and(|file| Some(file) == identity(other))
    }
    #[cfg(not(unix))]
    {
        one.canonicalize().is_ok_and(|one| other.canonicalize().is_ok_and(|other| one == other))
    }
}

fn read(path: &Path) -> Result<Shop, Failure> {
    let failure = |error: &dyn std::fmt::Display| {
        Failure::usage(format_args!("{} cannot be read: {error}", shown(path)))
    };
    let meant = |error: ShopError| {
        let gap = if error.place.is_some() { "" } else { " " };
        Failure::usage(format_args!("{}:{gap}{error}", shown(path)))
    };
    let file = File::open(path).map_err(|error| failure(&error))?;
    let mut bytes = Vec::new();
    // One more than is meant, so that what is too long is refused as such, and before its
    // characters are looked at: the last may be cut.
    file.take(MOST_FILE_BYTES as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| failure(&error))?;
    if bytes.len() > MOST_FILE_BYTES {
        let wrong = Wrong::TooLong { bytes: bytes.len(), most: MOST_FILE_BYTES };
        return Err(meant(ShopError { place: None, wrong }));
    }
    let text = String::from_utf8(bytes).map_err(|_| failure(&"it is not UTF-8"))?;
    Shop::parse(&text).map_err(meant)
}

/// A plan that is tried, by the model or with a plug-in.
struct Tried<'a> {
    shop: &'a Shop,
    plan: &'a Plan,
    plugin: Option<Chosen>,
    screen: &'a Screen,
}

impl Tried<'_> {
    fn simulation(&self, hours: u16) -> Result<Simulation, Failure> {
        let seconds = 3_600.0 * f64::from(hours);
        let Some(plugin) = &self.plugin else {
            let feeds_while_filled = self.plan.must_feed_while_filled();
            let options = Options { seconds, feeds_while_filled, ..Options::default() };
            let service = self.plan.service();
            let outcome = simulate(self.shop, &service, Discipline::Slots, &options);
            let holds = outcome.holds_so_far();
            return Ok(Simulation { holds, feeds_while_filled, plugin: None, outcome });
        };
        let simulated = self.with_plugin(plugin, seconds, false)?;
        let manifest = plugin.manifest();
        Ok(Simulation {
            holds: simulated.holds(),
            feeds_while_filled: true,
            plugin: Some(SimulatedPlugin {
                name: manifest.name.clone(),
                version: manifest.version.clone(),
                altered: simulated.altered,
            }),
            outcome: simulated.outcome,
        })
    }

    fn picture(&self) -> Result<String, Failure> {
        let Some(plugin) = &self.plugin else { return Ok(picture_of(self.shop, self.plan)) };
        let seconds = ROUNDS * self.plan.service().round_seconds(self.shop.bus());
        Ok(picture(&self.with_plugin(plugin, seconds, true)?.outcome))
    }

    fn with_plugin(
        &self,
        plugin: &Chosen,
        seconds: f64,
        keeps_levels: bool,
    ) -> Result<softplug_shop::Simulated, Failure> {
        let options = softplug_shop::Options { seconds, keeps_levels };
        with_plugin::simulated(self.shop, self.plan, plugin, &options, self.screen)
    }
}

fn row(screen: &Screen, title: &str, text: impl std::fmt::Display) {
    screen.say(format_args!("  {HEADING}{title:<10}{HEADING:#}{text}"));
}

fn bits(number: Option<f64>) -> String {
    number.map_or_else(|| "-".to_owned(), |number| count(number as u64))
}

fn seconds(number: Option<f64>) -> String {
    number.map_or_else(|| "-".to_owned(), |number| format!("{number:.3} s"))
}

/// The first machine of each kind with how many there are; all of a kind have the same plan.
fn kinds<'a>(
    shop: &'a Shop,
    plan: &'a Plan,
) -> impl Iterator<Item = (&'a softplug_plan::Machine, &'a MachinePlan)> {
    let firsts = shop.machines().iter().scan(0, |at, machine| {
        let first = *at;
        *at += machine.count as usize;
        Some((machine, first))
    });
    firsts.filter_map(|(machine, first)| Some((machine, plan.machines.get(first)?)))
}

fn head(shop: &Shop, plan: &Plan, screen: &Screen) {
    let carries = (plan.bus.payload_bits_per_second) as u64;
    let load = 100.0 * plan.bus.load;
    row(screen, "bus", format_args!("{} bit/s of data, {load:.1} % of it taken", count(carries)));
    let first = shop.machines().first().map_or("", |machine| machine.name.as_str());
    let most = things(plan.largest_equal, "machine");
    row(screen, "carries", format_args!("{most} if all are like {first}"));
    let margin = format!("{:.4}", 100.0 * plan.bus.margin);
    let margin = margin.trim_end_matches('0').trim_end_matches('.');
    row(screen, "margin", format_args!("{margin} % of each limit is left unused"));
}

fn show(shop: &Shop, plan: &Plan, screen: &Screen) {
    let machines = things(plan.machines.len() as u64, "machine");
    screen.say(format_args!("{GOOD}feasible{GOOD:#}: none of {machines} runs dry"));
    head(shop, plan, screen);
    row(screen, "round", seconds(plan.bus.round_seconds));
    // Sizes in whole bits, each on the side on which it still does.
    let mut table =
        Table::new(["machine", "count", "buffer", "least", "most", "fill", "wait", "line"]);
    for (machine, plan) in kinds(shop, plan) {
        table.row([
            machine.name.clone(),
            count(machine.count),
            bits(plan.unit_buffer_bits),
            bits(plan.unit_buffer_min_bits.map(f64::ceil)),
            bits(plan.unit_buffer_max_bits),
            seconds(plan.fill_seconds),
            seconds(plan.wait_seconds),
            format!(
                "{} of {}",
                bits(plan.line_needed_bits_per_second),
                count(machine.line() as u64)
            ),
        ]);
    }
    screen.say(format_args!("\n{table}\n"));
    if plan.must_feed_while_filled() {
        screen.say(format_args!(
            "{WARNING}only if{WARNING:#} units feed their controls while they are filled: where \
             \"line\" needs more than it carries, a unit that pauses for its fill cannot make up for it"
        ));
    }
}

fn show_refusal(shop: &Shop, plan: &Plan, screen: &Screen) {
    let machines = things(plan.machines.len() as u64, "machine");
    screen
        .say(format_args!("{BAD}not feasible{BAD:#}: no buffers feed {machines} without a break"));
    head(shop, plan, screen);
    let mut table = Table::new(["machine", "count", "fails"]);
    let margin = plan.bus.margin;
    for (machine, plan) in kinds(shop, plan) {
        let fails: Vec<_> =
            plan.violated.iter().map(|number| constraint(*number, margin)).collect();
        table.row([machine.name.clone(), count(machine.count), fails.join("; ")]);
    }
    screen.say(format_args!("\n{table}\n"));
    for (index, change) in plan.changes.iter().take(MOST_SHOWN).enumerate() {
        row(screen, if index == 0 { "mended by" } else { "or by" }, change);
    }
    if plan.changes.is_empty() {
        row(screen, "mended by", "no change of one thing alone");
    }
    if plan.changes.len() > MOST_SHOWN {
        row(screen, "", format_args!("and {} more, in --json", plan.changes.len() - MOST_SHOWN));
    }
}

/// A constraint that fails, in words. With a margin it may be the margin that makes it fail.
fn constraint(number: u8, margin: f64) -> String {
    let with = if margin > DEFAULT_MARGIN { "with the margin, " } else { "" };
    let fails = match number {
        1 => "the serial line does not carry more than the control takes",
        2 => "no buffer is large enough to feed the control while the others are filled",
        3 => "the fill that it needs is not over before its control's buffer is empty",
        _ => "its buffer is nothing",
    };
    format!("{number}: {with}{fails}")
}

fn show_simulation(simulation: &Simulation, hours: u16, screen: &Screen) {
    let outcome = &simulation.outcome;
    let dry: u64 = outcome.machines.iter().map(|machine| machine.times_dry).sum();
    let fills = match &simulation.plugin {
        Some(plugin) => {
            format!("{} {}, {}", plugin.name, plugin.version, things(outcome.services, "turn"))
        }
        None => things(outcome.services, "fill"),
    };
    let so_far = if outcome.is_complete { "" } else { " so far" };
    let what = match dry {
        0 => format!("{GOOD}no machine ran dry{so_far}{GOOD:#}"),
        dry => format!("{BAD}dry{BAD:#} {}{so_far}", things(dry, "time")),
    };
    let what = match &simulation.plugin {
        None => what,
        Some(plugin) => {
            let lost: f64 =
                outcome.machines.iter().map(|machine| machine.overflow_bits / 8.0).sum();
            match (plugin.altered.is_empty(), lost as u64) {
                (true, 0) => format!("{what}, no byte was lost, doubled or altered"),
                (true, lost) => format!("{what}, {BAD}lost{BAD:#} {}", things(lost, "byte")),
                (false, _) => {
                    format!("{what}, {BAD}altered{BAD:#} at {}", plugin.altered.join(", "))
                }
            }
        }
    };
    if outcome.is_complete {
        row(screen, "simulated", format_args!("{hours}.0 h, {fills}: {what}"));
        return;
    }
    let time = span(Duration::from_secs_f64(outcome.seconds));
    row(
        screen,
        "simulated",
        format_args!(
            "{time} of {} h, {fills}: {WARNING}ended early{WARNING:#}, as no more fills are simulated; \
             {what}",
            count(hours.into())
        ),
    );
}
