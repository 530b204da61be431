//! The profile.

use super::start;
use crate::model::Profile;
use softplug_abi::{LineParameters, Parity};

const fn line(baud: u32, parity: Parity) -> LineParameters {
    LineParameters { baud, data_bits: 8, parity, stop_half_bits: 2 }
}

/// With `reaction_timeout` 0 the time follows from the rate.
const LINES: &[LineParameters] = &[
    line(9_600, Parity::Even),
    line(9_600, Parity::Even),
    line(300, Parity::Even),
    line(600, Parity::None),
    line(1_200, Parity::Even),
    line(19_200, Parity::Odd),
    line(38_400, Parity::Even),
    line(115_200, Parity::None),
    line(0, Parity::None),
    line(2_400, Parity::Even),
    line(4_800, Parity::Even),
    LineParameters { baud: 57_600, data_bits: 7, parity: Parity::Even, stop_half_bits: 2 },
];

/// Below and above the data of one telegram.
const ROOMS: &[u32] = &[22, 100, 127, 128, 129, 130, 140, 150, 160];

/// Characters that mean something.
const SPECIAL: &[u8] = &[0x02, 0x10, 0x03, 0x15];

/// RK512.
pub(crate) const PROFILE: Profile = Profile {
    name: "rk512",
    clauses: &[
        "rk512.line.telegram",
        "rk512.line.header",
        "rk512.line.no-doubling",
        "rk512.line.seven-bits",
        "rk512.job.kinds",
        "rk512.job.fields",
        "rk512.job.pause",
        "rk512.job.abort",
        "rk512.send.command",
        "rk512.send.follow-up",
        "rk512.send.underneath",
        "rk512.fetch.command",
        "rk512.fetch.follow-up",
        "rk512.react.good",
        "rk512.react.error",
        "rk512.react.malformed",
        "rk512.react.unasked",
        "rk512.react.time-out",
        "rk512.serve.write",
        "rk512.serve.read",
        "rk512.serve.reaction",
        "rk512.serve.refused",
        "rk512.serve.time-out",
        "rk512.serve.withdrawn",
        "rk512.serve.follow-up",
        "rk512.serve.malformed",
        "rk512.cross.directions",
    ],
    values: &[
        ("layer", &["rk512", "rk512", "rk512", "rk512", "rk512", "none"]),
        ("bcc", &["on", "off"]),
        ("block_size", &["1024", "1", "16", "138", "256"]),
        ("buffer_wait", &["400", "0", "50", "20000"]),
        ("bwz", &["4000", "0", "50", "1000"]),
        ("doubling", &["on", "on", "on", "off"]),
        ("handshake", &["on", "on", "on", "off"]),
        ("nak_at_start", &["on", "off"]),
        ("nak_on_garbage", &["on", "off"]),
        ("priority", &["low", "high", "none"]),
        ("qvz", &["0", "20", "200", "2000"]),
        ("reaction_timeout", &["20000", "3000", "0", "500", "600000", "1"]),
        ("setup_attempts", &["6", "1", "2", "3", "130"]),
        ("split", &["off", "on"]),
        ("transmission_attempts", &["6", "1", "2", "3", "130"]),
        ("zvz", &["220", "5", "50", "1000"]),
    ],
    presets: &[],
    lines: LINES,
    rooms: ROOMS,
    modem_lines: &[None],
    special: SPECIAL,
    start,
};
