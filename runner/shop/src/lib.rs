//! A shop in virtual time as it would be built: each unit runs a real plug-in against a simulated
//! control with XON/XOFF, byte by byte, and the bus is served by the gateway's own scheduler.
//!
//! [`softplug_plan::simulate`] holds a plan to the model that it was reckoned with. This holds it
//! to what the model leaves out: whole bytes in frames, a control that holds the line and lets it
//! go on at marks of its own, a plug-in that obeys it a character later, and a scheduler that knows
//! nothing of the plan.
//!
//! ```
//! use softplug_abi::manifest::Manifest;
//! use softplug_link::LinkOptions;
//! use softplug_native::NativePlugin;
//! use softplug_plan::{Shop, plan};
//! use softplug_shop::{Options, Unit, simulate};
//!
//! let shop = Shop::parse(
//!     r#"
//! [bus]
//! rate = 250_000
//! efficiency = 0.4
//! switch = "2ms"
//!
//! [[machine]]
//! name = "mill"
//! rate = 19_200
//! efficiency = 0.8
//! consumes = 6_000
//! buffer = 256
//! count = 4
//! "#,
//! )?;
//! let plugin = NativePlugin::XonXoff;
//! let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
//! let settings = manifest.resolve_settings([])?;
//! let units = shop.each().map(|_| Unit {
//!     instance: plugin.instantiate(),
//!     options: LinkOptions { settings: settings.clone(), ..LinkOptions::default() },
//! });
//! let options = Options { seconds: 20.0, ..Options::default() };
//! let simulated = simulate(&shop, &plan(&shop).service(), units.collect(), &options, |_| {})?;
//! assert!(simulated.holds());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod bus;
mod error;
mod machine;
mod program;

pub use error::ShopFault;
pub use machine::Unit;

use softplug_abi::{Instance, Micros};
use softplug_plan::{Outcome, Service, Shop};
use softplug_unit_bus::BusFigures;

use crate::bus::SimulatedBus;
use crate::machine::Machine;

/// Longest step of time between two looks at the bus, as the gateway looks at its units.
const STEP: Micros = Micros::from_millis(20);

/// What is simulated of a shop.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Options {
    /// For how long, in seconds of virtual time.
    pub seconds: f64,
    /// Whether levels over time are kept: some [`Outcome::MOST_SAMPLES`] of each machine.
    pub keeps_levels: bool,
}

impl Default for Options {
    /// A minute, and no levels.
    fn default() -> Self {
        Self { seconds: 60.0, keeps_levels: false }
    }
}

/// What came of it.
#[derive(Clone, PartialEq, Debug)]
pub struct Simulated {
    /// Levels, dry spells, and bytes lost in controls.
    pub outcome: Outcome,
    /// Names of machines at which another byte came than was sent: a lost, doubled or altered one.
    pub altered: Vec<String>,
    /// The bus in its last minute, as the gateway measures it.
    pub bus: BusFigures,
}

impl Simulated {
    /// Whether no machine ran dry, no byte was lost, and each came as it was sent.
    pub fn holds(&self) -> bool {
        self.outcome.holds() && self.altered.is_empty()
    }
}

/// Simulates a shop whose units have these buffers. Unit and control are full when a machine
/// begins, and each cuts a program without an end. There is one unit for each machine, in the order
/// of [`Shop::each`]; its line is set here. `progress` is told how many seconds are over.
///
/// A control has 8N1 characters at the rate at which its line carries what the shop says, takes
/// whole bytes a second, sends XOFF when an eighth of its buffer is free, and XON at a quarter.
///
/// # Errors
/// A plug-in fails or gives up its job; a line or a buffer is none that a control can have.
pub fn simulate<I: Instance>(
    shop: &Shop,
    service: &Service,
    units: Vec<Unit<I>>,
    options: &Options,
    mut progress: impl FnMut(f64),
) -> Result<Simulated, ShopFault<I::Fault>> {
    let mut bus = SimulatedBus::new(shop.bus());
    let mut machines = Vec::with_capacity(units.len());
    for (index, ((name, planned), unit)) in shop.each().zip(units).enumerate() {
        let buffer = service.buffers.get(index).copied().unwrap_or(0.0);
        machines.push(Machine::begin(name, planned, buffer, unit, options)?);
    }
    let end = Micros((options.seconds * 1e6) as i64);
    let mut now = Micros::ZERO;
    while now < end {
        let next = bus.go_on(now, &mut machines).min(now + STEP).min(end);
        now = next.max(now + Micros(1));
        for machine in &mut machines {
            machine.go_to(now)?;
        }
        progress(now.as_secs_f64());
    }
    let altered = machines.iter().filter(|machine| machine.is_altered());
    Ok(Simulated {
        altered: altered.map(|machine| machine.name().to_owned()).collect(),
        bus: bus.figures(now),
        outcome: Outcome {
            seconds: options.seconds,
            is_complete: true,
            services: bus.turns(),
            machines: machines.into_iter().map(Machine::conclude).collect(),
        },
    })
}
