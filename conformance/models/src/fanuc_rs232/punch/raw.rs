//! Characters whose code is not known.

use crate::fanuc_rs232::code::decoded;
use crate::fanuc_rs232::rules::{Code, Parity, Rules};

/// What came before the code was known.
#[derive(Copy, Clone, Debug)]
pub(super) enum Raw {
    Whole(u8),
    Damaged(u8),
    Break,
    Overrun,
}

/// Whether a character can be a first `%` while the code is not known.
pub(super) fn may_be_first(byte: u8, rules: &Rules) -> bool {
    let is_iso = match rules.parity {
        Parity::Software => byte == 0xA5,
        Parity::Uart | Parity::None => byte & 0x7F == b'%',
    };
    is_iso || byte == 0x0B
}

pub(super) fn is_blank(byte: u8, code: Code, rules: &Rules) -> bool {
    match (code, rules.parity) {
        (Code::Iso, Parity::Software) => [0x00, 0xFF].contains(&byte),
        (Code::Iso, Parity::Uart | Parity::None) => [0x00, 0x7F].contains(&(byte & 0x7F)),
        (Code::Eia, _) => [0x00, 0x7F].contains(&byte),
    }
}

/// What the first EOB tells. A CR is none of EIA.
pub(super) fn told(byte: u8) -> Option<Code> {
    if byte == 0x80 {
        return Some(Code::Eia);
    }
    // A CR tells it, too, whatever its bit 7 is, and an LF with a bit 7 does not; the page
    // does not say so.
    (byte == b'\n' || byte & 0x7F == b'\r').then_some(Code::Iso)
}

/// Without an EOB: EIA, if all of it can be, and a `%` of it has come; the page does not say.
pub(super) fn guess(raws: &[Raw], rules: &Rules) -> Code {
    let is_eia = |raw: &Raw| match raw {
        Raw::Whole(0x7F) | Raw::Damaged(0x7F) => false,
        Raw::Whole(byte) | Raw::Damaged(byte) => decoded(*byte, Code::Eia, rules).is_some(),
        Raw::Break | Raw::Overrun => true,
    };
    let is_percent = |raw: &Raw| match raw {
        Raw::Whole(byte) | Raw::Damaged(byte) => decoded(*byte, Code::Eia, rules) == Some(b'%'),
        Raw::Break | Raw::Overrun => false,
    };
    if raws.iter().all(is_eia) && raws.iter().any(is_percent) { Code::Eia } else { Code::Iso }
}
