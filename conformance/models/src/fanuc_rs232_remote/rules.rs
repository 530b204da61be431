//! The settings of a session in the words of the page.

use super::tape::TapeRules;
use crate::model::Conditions;
use softplug_abi::Micros;

/// Settings of the dialogue; those of a program stand apart.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    /// The end of a packet: CR or ETX.
    pub(super) end: u8,
    pub(super) packet_size: usize,
    pub(super) poll_time: Micros,
    /// `parity` is `software`.
    pub(super) makes_parity: bool,
    pub(super) watch_dsr: bool,
    pub(super) tape: TapeRules,
}

impl Rules {
    /// `None` where the settings select another operation, or make no sense.
    pub(super) fn new(conditions: &Conditions) -> Option<Self> {
        let settings = &conditions.settings;
        let is_etx = settings.name("packet_end", "cr") == "etx";
        let rules = Self {
            end: if is_etx { 0x03 } else { b'\r' },
            packet_size: settings.int("packet_size", 1_024) as usize,
            poll_time: Micros::from_millis(settings.int("poll_time", 5_000)),
            makes_parity: settings.name("parity", "uart") == "software",
            watch_dsr: settings.is_on("watch_dsr", false),
            tape: TapeRules::new(settings),
        };
        let is_remote = settings.name("mode", "reader") == "remote-a";
        // EIA in packets is refused, as are halves of pairs.
        let is_iso = settings.name("code", "iso") == "iso";
        let pairs =
            ["replace", "eia_codes"].map(|name| settings.bytes(name, &[]).len().is_multiple_of(2));
        let pattern = settings.name("request_pattern", "(SEND *)");
        let is_one_name = pattern.matches('*').count() <= 1;
        // The page does not say it: an end code that an EOB contains would end packets
        // in their middle.
        let has_end = rules.tape.eob.contains(&rules.end);
        // Parity is made on 8 bits.
        let has_bit = !rules.makes_parity || conditions.line.data_bits == 8;
        let fits = is_remote && is_iso && pairs == [true; 2] && is_one_name;
        (fits && !has_end && has_bit).then_some(rules)
    }
}
