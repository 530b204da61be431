//! The settings.

use crate::model::Conditions;
use softplug_abi::Micros;

#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) is_iso: bool,
    pub(super) start_block: u64,
    pub(super) is_single: bool,
    pub(super) is_diameter: bool,
    /// Periods.
    pub(super) dwell: u64,
    pub(super) increments: u64,
    pub(super) echo_time: Micros,
    /// Of tools 0 to 7, in pulses of x and z.
    pub(super) offsets: [(i64, i64); 8],
}

impl Rules {
    pub(super) fn new(conditions: &Conditions) -> Self {
        let settings = &conditions.settings;
        let mut offsets = [(0, 0); 8];
        for (tool, offset) in offsets.iter_mut().enumerate().skip(1) {
            let axis = |axis| settings.int(&format!("{axis}_offset_{tool}"), 0);
            *offset = (axis("x"), axis("z"));
        }
        Self {
            is_iso: settings.name("input", "octal") == "iso",
            start_block: settings.int("start_block", 1) as u64,
            is_single: settings.is_on("single_block", false),
            is_diameter: settings.is_on("diameter", true),
            dwell: settings.int("dwell", 500) as u64 * 4,
            increments: settings.int("spindle_increments", 1_024) as u64,
            echo_time: Micros::from_millis(settings.int("echo_time", 10_000)),
            offsets,
        }
    }
}
