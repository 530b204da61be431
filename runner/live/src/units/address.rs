//! Where a unit and its links are.

use std::fmt;
use std::str::FromStr;

use softplug_unit_uplink::CanAddress;

use crate::error::BadSpec;

/// A unit, and how it is reached.
///
/// ```
/// use softplug_live::units::UnitPlace;
///
/// let unit: UnitPlace = "10.0.0.17:7640".parse().unwrap();
/// assert_eq!(unit.to_string(), "10.0.0.17:7640");
/// assert!(matches!("can0/17".parse(), Ok(UnitPlace::Can(_))));
/// assert!("10.0.0.17".parse::<UnitPlace>().is_err());
/// ```
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub enum UnitPlace {
    /// Over TCP.
    Tcp {
        /// Its name or address.
        host: String,
        /// Its port.
        port: u16,
    },
    /// Over a CAN bus.
    Can(CanAddress),
}

impl FromStr for UnitPlace {
    type Err = BadSpec;

    fn from_str(text: &str) -> Result<Self, BadSpec> {
        if let Some((host, port)) = crate::port::host_and_port(text) {
            return Ok(Self::Tcp { host, port });
        }
        text.parse().map(Self::Can).map_err(|_| BadSpec::Unit(text.to_owned()))
    }
}

impl fmt::Display for UnitPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp { host, port } => f.write_str(&crate::port::address_text(host, *port)),
            Self::Can(address) => address.fmt(f),
        }
    }
}

/// A link of a unit: `unit://host:port/link`, or `unit://can0/17/link` over a CAN bus, where the
/// link may be left out if the unit has no other.
///
/// ```
/// use softplug_live::units::UnitAddress;
///
/// let address: UnitAddress = "unit://10.0.0.17:7640/mill-7".parse().unwrap();
/// assert_eq!(address.link.as_deref(), Some("mill-7"));
/// let address: UnitAddress = "unit://can0/17".parse().unwrap();
/// assert_eq!(address.link, None);
/// assert!("unit://10.0.0.17/mill-7".parse::<UnitAddress>().is_err());
/// ```
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct UnitAddress {
    /// The unit.
    pub unit: UnitPlace,
    /// The link's name in the unit's configuration; `None`: the only one.
    pub link: Option<String>,
}

impl UnitAddress {
    /// How such an address begins.
    pub const SCHEME: &'static str = "unit:";
}

impl FromStr for UnitAddress {
    type Err = BadSpec;

    fn from_str(text: &str) -> Result<Self, BadSpec> {
        let wrong = || BadSpec::Unit(text.to_owned());
        let address = text.strip_prefix(Self::SCHEME).ok_or_else(wrong)?;
        let address = address.strip_prefix("//").unwrap_or(address);
        if let Ok(unit) = address.parse::<CanAddress>().map(UnitPlace::Can) {
            return Ok(Self { unit, link: None });
        }
        let (unit, link) = address.rsplit_once('/').ok_or_else(wrong)?;
        let unit = unit.parse().map_err(|_| wrong())?;
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if link.is_empty() || !link.chars().all(is_plain) {
            return Err(wrong());
        }
        Ok(Self { unit, link: Some(link.to_owned()) })
    }
}

impl fmt::Display for UnitAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unit://{}", self.unit)?;
        self.link.as_ref().map_or(Ok(()), |link| write!(f, "/{link}"))
    }
}
