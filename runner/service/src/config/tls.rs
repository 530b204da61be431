//! Keys for units that are reached with TLS.

use std::path::Path;

use softplug_live::units::{NoTlsKey, TlsKeys, TlsPrivateKey, TlsPublicKey, UnitPlace};

use super::finding::ConfigFindings;
use super::link::PortConfig;
use super::written::Text;

/// What `[gateway]` says of the gateway's own key.
pub(super) enum GatewayKey {
    /// Nothing.
    None,
    /// A file that cannot be used; it has been told.
    Unfit,
    /// This.
    Is(TlsPrivateKey),
}

impl GatewayKey {
    pub(super) fn read(
        file: Option<&Text>,
        folder: &Path,
        problems: &mut ConfigFindings<'_>,
    ) -> Self {
        let Some(file) = file else { return Self::None };
        match TlsPrivateKey::read(&folder.join(file.get_ref())) {
            Ok(key) => Self::Is(key),
            Err(error) => {
                let text = error.to_string();
                let (message, hint) = text.split_once(": ").unwrap_or((&text, "name another file"));
                problems.add(file.span(), message, hint);
                Self::Unfit
            }
        }
    }

    /// With the key of a link's unit.
    pub(super) fn with(
        &self,
        unit_key: Option<&Text>,
        link: &str,
        port: Option<&PortConfig>,
        problems: &mut ConfigFindings<'_>,
    ) -> Option<TlsKeys> {
        let text = unit_key?;
        let is_over_tcp = match port? {
            PortConfig::Unit(address) => matches!(address.unit, UnitPlace::Tcp { .. }),
            PortConfig::Port(_) | PortConfig::Simulated(_) => false,
        };
        if !is_over_tcp {
            let message =
                format!("the link \"{link}\" is not of a unit over TCP, and has a unit-key");
            let hint = "take `unit-key` away, or give it a port unit://host:port/link";
            problems.add(text.span(), message, hint);
            return None;
        }
        let Ok(unit) = text.get_ref().parse::<TlsPublicKey>() else {
            let message = format!("\"{}\" is no public key", text.get_ref().escape_debug());
            problems.add(text.span(), message, NoTlsKey::WRITE);
            return None;
        };
        match self {
            Self::Is(own) if own.public() == unit => {
                let message =
                    format!("the unit-key of the link \"{link}\" is the gateway's own key");
                problems.add(text.span(), message, "name the unit's public key");
                None
            }
            Self::Is(own) => Some(TlsKeys::of_gateway(own, &[unit])),
            Self::Unfit => None,
            Self::None => {
                let message =
                    format!("the link \"{link}\" has a unit-key, and the gateway has no key");
                let hint = "make one with `softplug unit key gateway.key`, and name it: key = \
                            \"gateway.key\" in [gateway]";
                problems.add(text.span(), message, hint);
                None
            }
        }
    }
}
