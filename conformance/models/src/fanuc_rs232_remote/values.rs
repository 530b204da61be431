//! What sessions are drawn from.

use softplug_abi::{LineParameters, ModemLines, Parity};

/// The clauses that this model judges.
pub(super) const CLAUSES: &[&str] = &[
    "fanuc-rs232.feed.dsr",
    "fanuc-rs232.feed.one-job",
    "fanuc-rs232.feed.abort-clean",
    "fanuc-rs232.feed.from-block",
    "fanuc-rs232.feed.from-sequence",
    "fanuc-rs232.feed.preamble",
    "fanuc-rs232.tape.eob-in",
    "fanuc-rs232.tape.eob-out",
    "fanuc-rs232.tape.percent",
    "fanuc-rs232.tape.after-end",
    "fanuc-rs232.tape.percent-in-comment",
    "fanuc-rs232.tape.tv-pad",
    "fanuc-rs232.tape.upper",
    "fanuc-rs232.tape.replace",
    "fanuc-rs232.tape.unsupported",
    "fanuc-rs232.tape.block-numbers",
    "fanuc-rs232.remote.sum",
    "fanuc-rs232.remote.initialise",
    "fanuc-rs232.remote.data",
    "fanuc-rs232.remote.end",
    "fanuc-rs232.remote.wait",
    "fanuc-rs232.remote.status",
    "fanuc-rs232.remote.reset",
    "fanuc-rs232.remote.alarm",
    "fanuc-rs232.remote.repeat",
    "fanuc-rs232.remote.ask-again",
    "fanuc-rs232.remote.silence",
    "fanuc-rs232.remote.end-code",
    "fanuc-rs232.remote.abort",
    "fanuc-rs232.code.iso",
    "fanuc-rs232.code.software-parity",
    "fanuc-rs232.code.no-parity",
    "fanuc-rs232.code.ascii",
    "fanuc-rs232.link.down",
    "fanuc-rs232.link.close",
    "fanuc-rs232.link.swap",
];

/// Values of settings.
pub(super) const VALUES: &[(&str, &[&str])] = &[
    ("mode", &["remote-a"]),
    ("packet_end", &["cr", "etx"]),
    ("packet_size", &["1024", "16", "40", "17", "300"]),
    ("poll_time", &["5000", "1000", "100", "60000"]),
    ("parity", &["uart", "software", "none"]),
    ("eob", &["lf", "lf", "lfcrcr", "crlf", "lfcr", "cr"]),
    ("tv_pad", &["off", "on"]),
    ("tv_cr", &["on", "off"]),
    ("tv_comments", &["on", "off"]),
    ("upper", &["on", "off"]),
    ("unsupported", &["refuse", "space", "drop"]),
    ("replace", &["", "5F 2D", "3B 2F 63 6B", "5F 25", "42 4E", "41 28 5B 29"]),
    ("ascii", &["off", "on"]),
    ("percent", &["on", "off"]),
    ("after_end", &["refuse", "drop"]),
    ("block_numbers", &["keep", "strip", "renumber"]),
    ("number_step", &["10", "1", "1000"]),
    ("watch_dsr", &["off", "on"]),
    // These have no part in packets.
    ("leader", &["0", "3"]),
    ("trailer", &["0", "2"]),
    ("dc1_timeout", &["0", "1"]),
    ("held_timeout", &["0", "1"]),
    ("end_wait", &["0", "2000"]),
    ("need_dc2", &["on", "off"]),
    ("receive_code", &["auto", "eia", "iso"]),
    ("plain_codes", &["off", "on"]),
    ("output_flow", &["dc3", "rts"]),
];

/// Characters of the line.
pub(super) const LINES: &[LineParameters] = &[
    LineParameters::new(9_600),
    LineParameters { baud: 9_600, data_bits: 7, parity: Parity::Even, stop_half_bits: 4 },
    LineParameters { baud: 4_800, data_bits: 8, parity: Parity::None, stop_half_bits: 4 },
    LineParameters { baud: 1_200, data_bits: 8, parity: Parity::None, stop_half_bits: 4 },
    LineParameters { baud: 115_200, data_bits: 8, parity: Parity::None, stop_half_bits: 2 },
];

const ALL: ModemLines =
    ModemLines::CTS.union(ModemLines::DSR).union(ModemLines::DCD).union(ModemLines::RTS);

/// DSR means something with `watch_dsr`, others never do.
pub(super) const MODEM_LINES: &[Option<(ModemLines, ModemLines)>] =
    &[None, Some((ALL, ALL)), Some((ALL, ModemLines(0))), Some((ModemLines::DSR, ModemLines::DSR))];

/// End codes, characters of messages, and what means something elsewhere.
pub(super) const SPECIAL: &[u8] = &[
    b'\r', 0x03, b'\n', 0x00, 0x7F, 0x11, 0x13, 0x12, 0x14, 0x16, 0x15, b'%', b'E', b'C', b'G',
    b'T', b'D', b'0', 0x8D,
];
