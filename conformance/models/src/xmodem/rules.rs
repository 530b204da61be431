//! The settings, and times in µs.

use crate::model::Conditions;
use softplug_abi::{LineParameters, Micros};

/// Which checks and lengths (`mode`).
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Mode {
    Auto,
    Checksum,
    Crc,
    Long,
}

/// The profile's settings, and the line.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) line: LineParameters,
    pub(super) mode: Mode,
    pub(super) call: bool,
    pub(super) call_time: Micros,
    pub(super) block_time: Micros,
    pub(super) character_time: Micros,
    pub(super) purge_time: Micros,
    pub(super) answer_time: Micros,
    /// `None`: for ever.
    pub(super) request_time: Option<Micros>,
    pub(super) repeats: u32,
    pub(super) pad: u8,
    pub(super) strips: bool,
    pub(super) end_twice: bool,
    /// So many answers find room in any case: those for which the queue has room that was told,
    /// which is three quarters of it, and those that wait for some.
    pub(super) answers: usize,
}

/// Answers that wait for room.
const WAITING: usize = 16;

impl Rules {
    pub(super) fn new(conditions: &Conditions) -> Self {
        let settings = &conditions.settings;
        let time = |name, millis| Micros::from_millis(settings.int(name, millis));
        let request_time = time("request_time", 0);
        Self {
            line: conditions.line,
            mode: match settings.name("mode", "auto") {
                "checksum" => Mode::Checksum,
                "crc" => Mode::Crc,
                "1k" => Mode::Long,
                _ => Mode::Auto,
            },
            call: settings.is_on("call", true),
            call_time: time("call_time", 3_000),
            block_time: time("block_time", 10_000),
            character_time: time("character_time", 1_000),
            purge_time: time("purge_time", 1_000),
            answer_time: time("answer_time", 60_000),
            request_time: Some(request_time).filter(|time| *time != Micros::ZERO),
            repeats: settings.int("repeats", 10) as u32,
            pad: settings.int("pad", 26) as u8,
            strips: settings.name("padding", "strip") == "strip",
            end_twice: settings.is_on("end_twice", true),
            answers: conditions.transmit_room as usize * 3 / 4 + WAITING,
        }
    }

    /// Whether the line can carry any byte.
    pub(super) fn is_wide(&self) -> bool {
        self.line.data_bits == 8
    }

    /// A line without a known rate: every character leaves as soon as it begins.
    pub(super) fn leaves_at_once(&self) -> bool {
        self.line.baud == 0
    }
}
