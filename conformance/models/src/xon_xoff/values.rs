//! What is worth trying.

use softplug_abi::{LineParameters, ModemLines, Parity};

/// Clauses that the model judges.
pub(super) const CLAUSES: &[&str] = &[
    "xon-xoff.tx.obey-xoff",
    "xon-xoff.tx.at-boundary",
    "xon-xoff.tx.depth",
    "xon-xoff.tx.resume-on-xon",
    "xon-xoff.tx.repeats-harmless",
    "xon-xoff.tx.no-leak",
    "xon-xoff.tx.settable-bytes",
    "xon-xoff.tx.parity-mask",
    "xon-xoff.tx.wait-for-xon",
    "xon-xoff.tx.held-timeout",
    "xon-xoff.tx.force-resume",
    "xon-xoff.tx.pause",
    "xon-xoff.tx.done-when-left",
    "xon-xoff.tx.one-job",
    "xon-xoff.tx.abort-clean",
    "xon-xoff.tx.abort-send",
    "xon-xoff.tx.feed-strings",
    "xon-xoff.tx.control-in-data",
    "xon-xoff.tx.line-ends",
    "xon-xoff.tx.drop",
    "xon-xoff.tx.transparent",
    "xon-xoff.rx.deliver",
    "xon-xoff.rx.quiet-ends",
    "xon-xoff.rx.several",
    "xon-xoff.rx.end-mark",
    "xon-xoff.rx.no-end-mark",
    "xon-xoff.rx.low-mark",
    "xon-xoff.rx.high-mark",
    "xon-xoff.rx.repeat-xon",
    "xon-xoff.rx.repeat-xoff",
    "xon-xoff.rx.speak",
    "xon-xoff.rx.overrun",
    "xon-xoff.rx.line-error",
    "xon-xoff.rx.break",
    "xon-xoff.rx.transparent",
    "xon-xoff.rx.escape-cut",
    "xon-xoff.rx.line-ends",
    "xon-xoff.rx.drop",
    "xon-xoff.rx.while-sending",
    "xon-xoff.rx.xon-at-open",
    "xon-xoff.rx.abort",
    "xon-xoff.link.down",
    "xon-xoff.link.close",
    "xon-xoff.link.swap",
];

/// 32 bytes to send.
const LONGEST_STRING: &str = "23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 23 0A";

/// 32 bytes to leave out.
const MOST_DROPPED: &str = "60 61 62 63 64 65 66 67 68 69 6A 6B 6C 6D 6E 6F 70 71 72 73 74 75 76 77 78 79 7A 7B 7C 7D 7E 7F";

/// 16 bytes that end a program.
const LONGEST_MARK: &str = "41 42 43 44 45 46 47 48 49 4A 4B 4C 4D 4E 4F 50";

/// Values of settings.
pub(super) const VALUES: &[(&str, &[&str])] = &[
    ("xon", &["17", "17", "17", "18", "255"]),
    ("xoff", &["19", "19", "19", "20", "0"]),
    ("parity_mask", &["255", "127", "127", "63"]),
    ("wait_for_xon", &["off", "on"]),
    ("held_timeout", &["0", "1000", "120000", "1", "7200000", "86400000"]),
    ("feed_start", &["", "12", "25 0A", "12 11", LONGEST_STRING]),
    ("feed_end", &["", "14 0D", "10", LONGEST_STRING]),
    ("abort_send", &["", "18 18", "03", "13 18", LONGEST_STRING]),
    ("send_line_end", &["keep", "lf", "cr", "crlf", "lfcrcr"]),
    ("send_drop", &["", "20 0D", "00 7F 13", "0A", MOST_DROPPED]),
    ("control_in_data", &["refuse", "drop", "send"]),
    ("while_sending", &["deliver", "ignore"]),
    ("transparent", &["off", "on"]),
    ("escape", &["16", "26", "27", "10", "13", "255"]),
    ("escape_xor", &["64", "32", "1", "255"]),
    ("speak", &["on", "on", "on", "off"]),
    ("low_mark", &["1024", "80", "1", "65535", "200"]),
    ("high_mark", &["2048", "120", "65535", "1"]),
    ("xon_repeat", &["1000", "0", "7", "100", "600000"]),
    ("xoff_repeat", &["32", "0", "4", "1", "300", "65535"]),
    ("xon_at_open", &["off", "on"]),
    ("receive_line_end", &["keep", "lf", "cr", "crlf", "lfcrcr"]),
    ("receive_drop", &["", "00 7F", "20 0D", "25", MOST_DROPPED]),
    ("end_mark", &["", "25", "4D 33 30", "61 61 62", "0A 25", LONGEST_MARK]),
    ("end_mark_count", &["1", "2", "3", "128", "255"]),
    ("end_quiet", &["500", "1", "5000", "600000"]),
    ("quiet_time", &["3000", "1000", "0", "1", "100", "60000", "600000"]),
    ("on_line_error", &["fail", "keep"]),
];

/// Characters of the line.
pub(super) const LINES: &[LineParameters] = &[
    LineParameters::new(9_600),
    LineParameters::new(9_600),
    LineParameters { baud: 4_800, data_bits: 7, parity: Parity::Even, stop_half_bits: 4 },
    LineParameters::new(300),
    LineParameters { baud: 115_200, data_bits: 8, parity: Parity::Even, stop_half_bits: 2 },
    LineParameters::new(600),
    LineParameters::new(1_200),
    LineParameters::new(2_400),
    LineParameters::new(19_200),
    LineParameters::new(38_400),
    LineParameters::new(57_600),
];

/// They mean nothing here.
pub(super) const MODEM_LINES: &[Option<(ModemLines, ModemLines)>] =
    &[None, None, Some((ModemLines::CTS.union(ModemLines::DSR), ModemLines::CTS))];

/// Control bytes, escapes, line ends, end marks and what is dropped.
pub(super) const SPECIAL: &[u8] = &[
    0x11, 0x13, 0x91, 0x93, 0x10, 0x0D, 0x0A, b'%', 0x00, 0x7F, 0x12, 0x14, 0x51, 0x53, b'a', b'b',
];
