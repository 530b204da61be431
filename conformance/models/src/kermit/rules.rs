//! The settings, and times in µs.

use super::packet::character;
use crate::model::Conditions;
use softplug_abi::{LineParameters, Micros};

/// The profile's settings, and the line.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) line: LineParameters,
    pub(super) is_text: bool,
    pub(super) check: usize,
    pub(super) crc_only: bool,
    pub(super) packet_length: usize,
    /// We ask for a prefix of the eighth bit.
    pub(super) wants_eighth: bool,
    pub(super) repeat_prefix: bool,
    pub(super) answer_time: Micros,
    pub(super) packet_time: Micros,
    pub(super) character_time: Micros,
    /// `None`: for ever.
    pub(super) begin_time: Option<Micros>,
    pub(super) job_time: Micros,
    pub(super) repeats: u32,
    /// So many characters of answers find room in any case: the queue has room that was told,
    /// three quarters of it, and 160 wait for some.
    pub(super) answers: usize,
}

impl Rules {
    pub(super) fn new(conditions: &Conditions) -> Self {
        let settings = &conditions.settings;
        let time = |name, millis| Micros::from_millis(settings.int(name, millis));
        let begin_time = time("begin_time", 0);
        Self {
            line: conditions.line,
            is_text: settings.name("mode", "binary") == "text",
            check: settings.int("check", 3) as usize,
            crc_only: settings.is_on("crc_only", false),
            packet_length: settings.int("packet_length", 1_000) as usize,
            wants_eighth: conditions.line.data_bits < 8
                || settings.name("eighth_bit", "auto") == "prefix",
            repeat_prefix: settings.is_on("repeat_prefix", true),
            answer_time: time("answer_time", 10_000),
            packet_time: time("packet_time", 15_000),
            character_time: time("character_time", 1_000),
            begin_time: Some(begin_time).filter(|time| *time != Micros::ZERO),
            job_time: time("job_time", 5_000),
            repeats: settings.int("repeats", 10) as u32,
            answers: conditions.transmit_room as usize * 3 / 4 + 160,
        }
    }

    pub(super) fn is_narrow(&self) -> bool {
        self.line.data_bits < 8
    }

    /// A line without a known rate: every character leaves as soon as it begins.
    pub(super) fn leaves_at_once(&self) -> bool {
        self.line.baud == 0
    }

    /// What our S says.
    pub(super) fn offer(&self) -> Vec<u8> {
        let seconds = (self.packet_time.0 + 999_999) / 1_000_000;
        let length = self.packet_length;
        vec![
            character(length.min(94)),
            character(seconds.clamp(1, 94) as usize),
            b' ',
            b'@',
            b'-',
            b'#',
            if self.wants_eighth { b'&' } else { b'Y' },
            48 + self.check as u8,
            if self.repeat_prefix { b'~' } else { b' ' },
            if length > 94 { b'"' } else { b' ' },
            b' ',
            character(length / 95),
            character(length % 95),
        ]
    }
}
