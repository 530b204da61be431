//! The settings, and times in µs.

use super::program;
use crate::model::Conditions;
use softplug_abi::{LineParameters, Micros};

/// The profile's settings, and the line.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) line: LineParameters,
    /// `parity`: the parity bit is made and checked here.
    pub(super) makes_parity: bool,
    pub(super) repeats: u32,
    pub(super) answer_time: Micros,
    pub(super) character_time: Micros,
    /// `None`: for ever.
    pub(super) block_time: Option<Micros>,
    /// `None`: for ever.
    pub(super) request_time: Option<Micros>,
    pub(super) job_time: Micros,
    pub(super) dc1: bool,
    pub(super) bcc_space: bool,
    pub(super) line_end: &'static [u8],
    /// Our queue takes some characters only.
    pub(super) has_small_queue: bool,
    /// So many answers find room in any case: those for which the queue has room that was told,
    /// which is three quarters of it, and those that wait for some.
    pub(super) answers: usize,
}

/// A queue that takes less is small.
pub(super) const SMALL: u32 = 64;
/// Answers that wait for room.
const WAITING: usize = 16;

impl Rules {
    /// `None`: the line cannot carry the parity bit that we make.
    pub(super) fn new(conditions: &Conditions) -> Option<Self> {
        let settings = &conditions.settings;
        let time = |name, millis| Micros::from_millis(settings.int(name, millis));
        let or_ever = |time: Micros| Some(time).filter(|time| *time != Micros::ZERO);
        let makes_parity = settings.name("parity", "port") == "even";
        if makes_parity && conditions.line.data_bits < 8 {
            return None;
        }
        Some(Self {
            has_small_queue: conditions.transmit_room < SMALL,
            answers: conditions.transmit_room as usize * 3 / 4 + WAITING,
            line: conditions.line,
            makes_parity,
            repeats: settings.int("repeats", 3) as u32,
            answer_time: time("answer_time", 10_000),
            character_time: time("character_time", 1_000),
            block_time: or_ever(time("block_time", 30_000)),
            request_time: or_ever(time("request_time", 0)),
            job_time: time("job_time", 5_000),
            dc1: settings.is_on("dc1", true),
            bcc_space: settings.is_on("bcc_space", false),
            line_end: if settings.name("line_end", "lf") == "crlf" { b"\r\n" } else { b"\n" },
        })
    }

    /// The most characters of a line that is sent.
    pub(super) fn longest(&self) -> usize {
        if self.bcc_space { 239 } else { 240 }
    }

    /// The lines of a program, or why it cannot be sent.
    pub(super) fn lines(&self, data: &[u8]) -> Result<Vec<Vec<u8>>, program::Fault> {
        program::lines(data, self.longest())
    }

    /// Of a line without a known rate every character leaves as soon as it begins.
    pub(super) fn leaves_at_once(&self) -> bool {
        self.line.baud == 0
    }
}

/// A character with its even parity as bit 8.
pub(super) fn even(character: u8) -> u8 {
    let is_odd = (character & 0x7F).count_ones() % 2 == 1;
    character & 0x7F | u8::from(is_odd) << 7
}
