//! The three profiles of the page that have a station of their own.

use super::Station;
use super::rules::Procedure;
use crate::model::{Preset, Profile};
use softplug_abi::{LineParameters, Parity};

const fn line(baud: u32, parity: Parity, data_bits: u8) -> LineParameters {
    LineParameters { baud, data_bits, parity, stop_half_bits: 2 }
}

/// The manifests name 8E1; any other only changes times, but for 7 data bits.
const LINES: &[LineParameters] = &[
    line(9_600, Parity::Even, 8),
    line(9_600, Parity::Even, 8),
    line(2_400, Parity::None, 8),
    line(19_200, Parity::Odd, 8),
    line(115_200, Parity::Even, 8),
    line(300, Parity::Even, 8),
    line(0, Parity::None, 8),
    LineParameters { baud: 1_200, data_bits: 8, parity: Parity::None, stop_half_bits: 4 },
    line(600, Parity::Even, 8),
    line(4_800, Parity::Even, 8),
    line(38_400, Parity::Even, 8),
    line(57_600, Parity::Even, 7),
];

/// The page's table, without the one of 3964.
const PRESETS: &[Preset] = &[
    ("cp440", &[("block_size", "400")]),
    ("sinumerik", &[("block_size", "128"), ("buffer_wait", "0")]),
    ("buderus", &[("qvz", "2000"), ("setup_attempts", "3")]),
    (
        "vipa-cp240",
        &[
            ("block_size", "250"),
            ("bwz", "2000"),
            ("priority", "low"),
            ("qvz", "500"),
            ("setup_attempts", "3"),
        ],
    ),
    (
        "vipa-cp040",
        &[
            ("bwz", "200"),
            ("priority", "low"),
            ("qvz", "200"),
            ("setup_attempts", "5"),
            ("zvz", "200"),
        ],
    ),
    (
        "euchner",
        &[("qvz", "500"), ("setup_attempts", "3"), ("transmission_attempts", "3"), ("zvz", "128")],
    ),
    ("ifm", &[("priority", "high"), ("qvz", "3000"), ("zvz", "200")]),
    (
        "wago",
        &[("block_size", "128"), ("nak_on_garbage", "off"), ("priority", "low"), ("qvz", "2000")],
    ),
];

/// That of 3964.
const PRESETS_3964: &[Preset] = &[("3964", &[("bcc", "off")])];

/// Characters that mean something.
const SPECIAL: &[u8] = &[0x02, 0x10, 0x03, 0x15];

/// 3964R.
pub(crate) const R3964: Profile = Profile {
    name: "r3964",
    clauses: &[
        "r3964.line.frame",
        "r3964.line.bcc",
        "r3964.line.any-format",
        "r3964.line.seven-bits",
        "r3964.tx.set-up",
        "r3964.tx.qvz",
        "r3964.tx.set-up-refused",
        "r3964.tx.set-up-attempts",
        "r3964.tx.late-dle",
        "r3964.tx.stop-on-nak",
        "r3964.tx.stop-on-other",
        "r3964.tx.acknowledged",
        "r3964.tx.repeat",
        "r3964.tx.no-false-success",
        "r3964.tx.transmission-attempts",
        "r3964.tx.one-attempt",
        "r3964.tx.too-long",
        "r3964.tx.split",
        "r3964.tx.waits",
        "r3964.tx.pause",
        "r3964.tx.abort",
        "r3964.rx.set-up",
        "r3964.rx.second-stx",
        "r3964.rx.not-waiting",
        "r3964.rx.transparent",
        "r3964.rx.deliver",
        "r3964.rx.zvz",
        "r3964.rx.dle-error",
        "r3964.rx.line-error",
        "r3964.rx.bcc",
        "r3964.rx.repetition",
        "r3964.rx.attempts",
        "r3964.rx.bwz",
        "r3964.rx.first-error",
        "r3964.rx.too-long",
        "r3964.rx.no-buffer",
        "r3964.rx.garbage",
        "r3964.rx.ignored",
        "r3964.rx.at-least-once",
        "r3964.conflict.low",
        "r3964.conflict.attempts-anew",
        "r3964.conflict.high",
        "r3964.conflict.glued",
        "r3964.conflict.both-high",
        "r3964.conflict.both-low",
        "r3964.conflict.none",
        "r3964.line.start-nak",
        "r3964.line.break",
        "r3964.line.down",
        "r3964.line.close",
        "r3964.line.swap",
    ],
    values: &[
        ("block_size", &["1024", "1", "2", "8", "128", "400", "1023"]),
        ("buffer_wait", &["400", "0", "1", "50", "51", "100", "2000", "20000"]),
        ("bwz", &["4000", "0", "1", "50", "1000", "60000"]),
        ("doubling", &["on", "on", "on", "off"]),
        ("handshake", &["on", "on", "on", "on", "off"]),
        ("nak_at_start", &["on", "off"]),
        ("nak_on_garbage", &["on", "off"]),
        ("priority", &["low", "high", "none"]),
        ("qvz", &["0", "1", "20", "200", "2000", "60000"]),
        ("setup_attempts", &["6", "1", "2", "3", "130", "255"]),
        ("split", &["off", "on"]),
        ("transmission_attempts", &["6", "1", "2", "3", "130", "255"]),
        ("zvz", &["220", "1", "5", "50", "1000", "60000"]),
    ],
    presets: PRESETS,
    lines: LINES,
    rooms: &[],
    modem_lines: &[None],
    special: SPECIAL,
    start: |conditions| Station::start(Procedure::R3964, conditions),
};

/// 3964: no check character, and a shorter QVZ.
pub(crate) const PLAIN_3964: Profile = Profile {
    name: "3964",
    clauses: &[
        "3964.line.frame",
        "3964.tx.acknowledged",
        "3964.tx.qvz",
        "3964.tx.repeat",
        "3964.rx.acknowledge",
        "3964.rx.repetition",
        "3964.rx.zvz",
        "3964.rx.garbage",
        "3964.conflict.low",
        "3964.conflict.both-high",
    ],
    values: &[
        ("bcc", &["off"]),
        ("nak_at_start", &["on", "off"]),
        ("priority", &["low", "high"]),
        ("qvz", &["0", "1", "20", "550", "2000"]),
        ("setup_attempts", &["6", "1", "2", "3", "130", "255"]),
        ("transmission_attempts", &["6", "1", "2", "3", "130", "255"]),
    ],
    presets: PRESETS_3964,
    lines: LINES,
    rooms: &[],
    modem_lines: &[None],
    special: SPECIAL,
    start: |conditions| Station::start(Procedure::Plain3964, conditions),
};

/// The subset that small devices share.
pub(crate) const SIMPLIFIED: Profile = Profile {
    name: "r3964-simplified",
    clauses: &[
        "r3964-simplified.line.frame",
        "r3964-simplified.line.block-size",
        "r3964-simplified.line.no-start-nak",
        "r3964-simplified.line.no-doubling",
        "r3964-simplified.line.no-check",
        "r3964-simplified.line.seven-bits",
        "r3964-simplified.line.values",
        "r3964-simplified.tx.set-up",
        "r3964-simplified.tx.set-up-attempts",
        "r3964-simplified.tx.one-transmission",
        "r3964-simplified.tx.no-arbitration",
        "r3964-simplified.tx.late-dle",
        "r3964-simplified.tx.no-handshake",
        "r3964-simplified.tx.abort",
        "r3964-simplified.rx.set-up",
        "r3964-simplified.rx.no-handshake",
        "r3964-simplified.rx.one-attempt",
        "r3964-simplified.rx.busy",
        "r3964-simplified.rx.garbage-ignored",
        "r3964-simplified.rx.zvz",
        "r3964-simplified.rx.at-least-once",
    ],
    // The first of each is what this profile has: any other has its say in 3964R.
    values: &[
        ("bcc", &["on", "off"]),
        ("block_size", &["128", "1", "4", "127", "1024", "20"]),
        ("buffer_wait", &["0", "50", "400", "20000"]),
        ("bwz", &["0", "50", "4000"]),
        ("doubling", &["on", "off"]),
        ("handshake", &["on", "off"]),
        ("nak_at_start", &["off", "on"]),
        ("nak_on_garbage", &["off", "on"]),
        ("priority", &["none", "low", "high"]),
        ("qvz", &["2000", "0", "20", "550"]),
        ("setup_attempts", &["3", "1", "6", "130", "255"]),
        ("split", &["off", "on"]),
        ("transmission_attempts", &["1", "3", "6", "130", "255"]),
        ("zvz", &["220", "5", "1000"]),
    ],
    presets: &[],
    lines: LINES,
    rooms: &[],
    modem_lines: &[None],
    special: SPECIAL,
    start: |conditions| Station::start(Procedure::Simplified, conditions),
};
