//! What is worth trying.

use softplug_abi::{LineParameters, ModemLines, Parity};

/// Clauses that the model judges.
pub(super) const CLAUSES: &[&str] = &[];

/// Values of settings.
pub(super) const VALUES: &[(&str, &[&str])] = &[
    ("mode", &["reader", "reader", "remote-b"]),
    ("code", &["iso", "iso", "eia"]),
    ("receive_code", &["auto", "iso", "eia"]),
    ("parity", &["uart", "software", "none"]),
    ("plain_codes", &["off", "on"]),
    ("eob", &["lf", "crlf", "lfcrcr", "lfcr", "cr"]),
    ("line_end", &["lf", "crlf"]),
    ("leader", &["0", "3", "200"]),
    ("trailer", &["0", "40", "3", "300"]),
    ("tv_pad", &["off", "on"]),
    ("tv_check", &["off", "on"]),
    ("tv_cr", &["on", "off"]),
    ("tv_comments", &["on", "off"]),
    ("upper", &["on", "off"]),
    ("unsupported", &["refuse", "space", "drop"]),
    ("replace", &["", "5F 2D 3B 2F", "41 42 42 43", "78 25"]),
    ("ascii", &["off", "on"]),
    ("eia_codes", &["", "23 5D 3D 5B 3A 6D"]),
    ("percent", &["on", "off"]),
    ("after_end", &["refuse", "drop"]),
    ("block_numbers", &["keep", "strip", "renumber"]),
    ("number_step", &["10", "1", "1000"]),
    ("dc1_timeout", &["0", "1000", "1", "60000"]),
    ("held_timeout", &["0", "1000", "1", "120000"]),
    ("end_wait", &["0", "2000", "1", "60000"]),
    ("watch_dsr", &["off", "on"]),
    ("output_flow", &["dc3", "dc3", "rts", "none"]),
    ("resume_code", &["dc1", "dc2"]),
    ("need_dc2", &["on", "off"]),
    ("answer_dc2", &["off", "on"]),
    ("end_quiet", &["500", "1", "3000"]),
    ("after_dc4", &["200", "0", "1", "5000"]),
    ("quiet_time", &["10000", "0", "100", "60000"]),
    ("programs", &["keep", "split"]),
    ("on_line_error", &["fail", "keep"]),
    ("request_program", &["9999", "0", "7"]),
    ("request_pattern", &["(SEND *)", "(SEND *)", "", "(*)", "(GET *.NC)"]),
];

const fn two_stop_bits(baud: u32, data_bits: u8, parity: Parity) -> LineParameters {
    LineParameters { baud, data_bits, parity, stop_half_bits: 4 }
}

/// Characters of the line.
pub(super) const LINES: &[LineParameters] = &[
    two_stop_bits(4_800, 8, Parity::None),
    two_stop_bits(4_800, 7, Parity::Even),
    two_stop_bits(9_600, 7, Parity::Even),
    LineParameters::new(9_600),
    two_stop_bits(300, 8, Parity::None),
    LineParameters::new(115_200),
];

/// Inputs that mean something, and outputs.
pub(super) const MODEM_LINES: &[Option<(ModemLines, ModemLines)>] = &[
    None,
    Some((ALL, ModemLines::DSR)),
    Some((ALL, ModemLines::DSR.union(ModemLines::CTS))),
    Some((ALL, ModemLines::CTS)),
    Some((ModemLines::CTS, ModemLines::CTS)),
];

const ALL: ModemLines = ModemLines::CTS.union(ModemLines::DSR).union(ModemLines::RTS);

/// Control codes with parity and without, `%`, EOBs, comments, numbers.
pub(super) const SPECIAL: &[u8] = &[
    0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x93, 0x95, 0x96, b'%', 0xA5, 0x0B, 0x0A, 0x0D, 0x80, 0x00,
    0x7F, b'O', b'(', b')', b' ',
];
