//! The settings of a station, with the page's defaults.

use super::rules::Procedure;
use crate::model::Conditions;
use softplug_abi::{LineParameters, Micros};

/// What a station does when both partners send STX.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Priority {
    /// Gives way.
    Low,
    /// Insists.
    High,
    /// STX is a wrong character.
    None,
}

/// The largest telegram of RK512: a header of 10 bytes and 128 of data.
const TELEGRAM: usize = 138;

/// The page's names for them.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Parameters {
    pub(super) procedure: Procedure,
    pub(super) line: LineParameters,
    pub(super) bcc: bool,
    pub(super) handshake: bool,
    pub(super) doubling: bool,
    pub(super) priority: Priority,
    pub(super) qvz: Micros,
    pub(super) zvz: Micros,
    pub(super) bwz: Micros,
    pub(super) buffer_wait: Micros,
    pub(super) setup_attempts: i64,
    pub(super) transmission_attempts: i64,
    pub(super) block_size: usize,
    pub(super) split: bool,
    pub(super) nak_at_start: bool,
    pub(super) nak_on_garbage: bool,
}

impl Parameters {
    /// `None` where these settings are those of another profile.
    pub(super) fn new(procedure: Procedure, conditions: &Conditions) -> Option<Self> {
        let settings = &conditions.settings;
        let layer = settings.name("layer", "none");
        let is_simplified = procedure == Procedure::Simplified;
        let number = |name, otherwise, simplified| {
            settings.int(name, if is_simplified { simplified } else { otherwise })
        };
        let millis =
            |name, otherwise, simplified| Micros::from_millis(number(name, otherwise, simplified));
        let bcc = settings.is_on("bcc", procedure != Procedure::Plain3964);
        let qvz = match number("qvz", 0, 2_000) {
            0 if bcc => 2_000,
            0 => 550,
            set => set,
        };
        let priority = match settings.name("priority", if is_simplified { "none" } else { "low" }) {
            "low" => Priority::Low,
            "high" => Priority::High,
            _ => Priority::None,
        };
        let parameters = Self {
            procedure,
            line: conditions.line,
            bcc,
            handshake: settings.is_on("handshake", true),
            doubling: settings.is_on("doubling", true),
            priority,
            qvz: Micros::from_millis(qvz),
            zvz: millis("zvz", 220, 220),
            bwz: millis("bwz", 4_000, 0),
            buffer_wait: millis("buffer_wait", 400, 0),
            setup_attempts: number("setup_attempts", 6, 3),
            transmission_attempts: number("transmission_attempts", 6, 1),
            block_size: match procedure {
                Procedure::Rk512 if layer == "rk512" => TELEGRAM,
                _ => number("block_size", 1_024, 128) as usize,
            },
            split: layer != "rk512" && settings.is_on("split", false),
            nak_at_start: settings.is_on("nak_at_start", !is_simplified),
            nak_on_garbage: settings.is_on("nak_on_garbage", !is_simplified),
        };
        let fits = match procedure {
            Procedure::R3964 => bcc,
            Procedure::Plain3964 => !bcc,
            Procedure::Simplified | Procedure::Rk512 => true,
        };
        // The profile of the layer has something to say without it, too.
        let fits = fits && (layer == "none" || procedure == Procedure::Rk512);
        fits.then_some(parameters)
    }
}
