//! How large the buffers between a bus and its machines must be, so that no machine runs dry.
//!
//! Many machines are fed over one bus. Each has a front-end unit: it takes data from the bus into
//! a buffer of its own, and gives it to the machine's control over a serial line. The bus serves
//! one unit after the other. [`plan`] says how large each unit's buffer must be, or why no size
//! will do and what would mend it; [`simulate`] runs the same shop in virtual time and shares no
//! arithmetic with it. `docs/plan.md` explains the model.
//!
//! | module | subject |
//! |---|---|
//! | `shop` | bus and machines, and what can be meant by them |
//! | `file` | `shop.toml` |
//! | `measured` | figures of a live bus in the place of those of the file |
//! | `model` | the constraints, and what follows from them in closed form |
//! | `programme` | the same as a linear programme |
//! | `planning` | the plan |
//! | `change` | what would mend a shop that cannot be planned |
//! | `simulation` | a shop in virtual time |
//! | `pulses` | machines that take their feed pulses from one computer |
//! | `picture` | levels over time as SVG |
//!
//! ```
//! use softplug_plan::{Discipline, Options, Shop, plan, simulate};
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
//! count = 8
//! "#,
//! )?;
//! let plan = plan(&shop);
//! assert!(plan.feasible);
//! assert_eq!(plan.largest_equal, 16);
//!
//! let options = Options { seconds: 60.0, ..Options::default() };
//! let outcome = simulate(&shop, &plan.service(), Discipline::Slots, &options);
//! assert!(outcome.holds());
//! # Ok::<(), softplug_plan::ShopError>(())
//! ```
#![forbid(unsafe_code)]

mod change;
mod error;
mod file;
mod limits;
mod measured;
mod model;
mod picture;
mod planning;
mod programme;
mod pulses;
mod shop;
mod simulation;
pub mod span;

pub use change::{Change, Parameter};
pub use error::{Place, ShopError, Wrong};
pub use file::MOST_FILE_BYTES;
pub use limits::{
    DEFAULT_MARGIN, LEAST_RATE, MOST_BUFFER, MOST_MACHINES, MOST_MARGIN, MOST_NAME, MOST_RATE,
    MOST_SWITCH,
};
pub use measured::{Measured, Taken};
pub use picture::{picture, picture_of};
pub use planning::{BusPlan, MachinePlan, Plan, Service, plan};
pub use pulses::{PulseBudget, Pulses};
pub use shop::{Bus, Machine, Shop};
pub use simulation::{Discipline, Dry, MachineOutcome, Options, Outcome, Sample, Start, simulate};
