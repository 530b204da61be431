//! Control codes.

use super::rules::{Code, Parity, Rules};

/// What the control says.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Control {
    /// Reader on.
    Dc1,
    /// Punch on.
    Dc2,
    /// Reader off.
    Dc3,
    /// Punch off.
    Dc4,
    /// It was reset.
    Syn,
    /// It met an alarm.
    Nak,
}

/// With even parity.
const WITH_PARITY: [(u8, Control); 6] = [
    (0x11, Control::Dc1),
    (0x12, Control::Dc2),
    (0x93, Control::Dc3),
    (0x14, Control::Dc4),
    (0x96, Control::Syn),
    (0x95, Control::Nak),
];

/// Those whose parity bit is set, without it.
const PLAIN: [(u8, Control); 3] =
    [(0x13, Control::Dc3), (0x16, Control::Syn), (0x15, Control::Nak)];

/// Where characters stand that come.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Context {
    Iso,
    /// EIA, or a code that is not known: 13, 15 and 16 are digits.
    Eia,
    /// EIA that we feed to a control with `plain_codes`.
    PlainEia,
}

impl Context {
    /// Of text in a code.
    pub(super) fn of(code: Option<Code>) -> Self {
        if code == Some(Code::Iso) { Self::Iso } else { Self::Eia }
    }

    /// What a character that came whole says, if it is a control code.
    pub(super) fn control(self, byte: u8, rules: &Rules) -> Option<Control> {
        let is_unmarked = self == Self::Iso && rules.parity == Parity::None;
        let byte = if is_unmarked && PLAIN.iter().all(|(plain, _)| *plain != byte & 0x7F) {
            byte & 0x7F
        } else {
            byte
        };
        let plain: &[_] = if self == Self::Eia { &[] } else { &PLAIN };
        let known = WITH_PARITY.iter().chain(plain).find(|(known, _)| *known == byte);
        known.map(|(_, control)| *control)
    }
}
