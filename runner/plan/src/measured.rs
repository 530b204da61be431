//! Figures that were measured on a live bus, in the place of those that were assumed.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::error::ShopError;
use crate::shop::{Shop, number};
use crate::span;

/// What was measured on a live bus.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Measured {
    /// Data bits of all bits on the bus.
    pub efficiency: Option<f64>,
    /// Seconds to switch from one unit to the next.
    pub switch: Option<f64>,
    /// The most data bits per second that each machine took, by its name.
    pub consumes: BTreeMap<String, f64>,
}

/// A figure that was taken.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Taken {
    /// The key in `shop.toml`.
    pub parameter: &'static str,
    /// The machine, or machines that are alike; `None`: the bus.
    pub machine: Option<String>,
    /// What the file has.
    pub from: f64,
    /// What was measured.
    pub to: f64,
}

impl Shop {
    /// This shop with what was measured, and which figures were taken. Machines that are alike stay
    /// so: they are planned with what the one took that took most. What was not measured stays as
    /// it is.
    ///
    /// ```
    /// use softplug_plan::{Measured, Shop};
    ///
    /// let shop = Shop::parse(
    ///     r#"
    /// bus = { rate = 250_000, efficiency = 0.4, switch = "2ms" }
    /// machine = [{ name = "mill", rate = 19_200, efficiency = 0.8, consumes = 6_000, buffer = 256, count = 2 }]
    /// "#,
    /// )?;
    /// let consumes = [("mill-1".to_owned(), 5_400.0), ("mill-2".to_owned(), 5_500.0)].into();
    /// let measured = Measured { consumes, ..Measured::default() };
    /// let (shop, taken) = shop.with_measured(&measured)?;
    /// assert_eq!(shop.machines()[0].consumes, 5_500.0);
    /// assert_eq!(taken[0].to_string(), "consumes of mill 5500 bit/s, in the file 6000 bit/s");
    /// # Ok::<(), softplug_plan::ShopError>(())
    /// ```
    ///
    /// # Errors
    /// What was measured cannot be meant.
    pub fn with_measured(&self, measured: &Measured) -> Result<(Self, Vec<Taken>), ShopError> {
        let mut taken = Vec::new();
        let mut take = |parameter, machine: Option<&str>, place: &mut f64, to: Option<f64>| {
            let Some(to) = to else { return };
            let from = std::mem::replace(place, to);
            taken.push(Taken { parameter, machine: machine.map(str::to_owned), from, to });
        };
        let mut bus = *self.bus();
        take("efficiency", None, &mut bus.efficiency, measured.efficiency);
        take("switch", None, &mut bus.switch, measured.switch);
        let mut machines = self.machines().to_vec();
        let mut names = self.each().map(|(name, _)| name);
        for machine in &mut machines {
            let of_kind = names.by_ref().take(machine.count as usize);
            let most = of_kind.filter_map(|name| measured.consumes.get(&name).copied());
            let most = most.reduce(f64::max);
            take("consumes", Some(&machine.name), &mut machine.consumes, most);
        }
        Ok((Self::new(bus, machines)?, taken))
    }
}

impl fmt::Display for Taken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = |value: f64| match self.parameter {
            "switch" => span::shown(value),
            "consumes" => format!("{} bit/s", number(value.round())),
            _ => number((value * 1e4).round() / 1e4),
        };
        let of = self.machine.as_deref().unwrap_or("the bus");
        let (from, to) = (value(self.from), value(self.to));
        write!(f, "{} of {of} {to}, in the file {from}", self.parameter)
    }
}
