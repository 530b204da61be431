//! The control bytes and the escape of the transparent mode.

use crate::Settings;

/// A control byte from the partner.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Control {
    Xon,
    Xoff,
}

/// The bytes that mean something on this link.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Codes {
    pub(crate) xon: u8,
    pub(crate) xoff: u8,
    mask: u8,
    escape: u8,
    escape_xor: u8,
}

impl Codes {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            xon: settings.xon as u8,
            xoff: settings.xoff as u8,
            mask: settings.parity_mask as u8,
            escape: settings.escape as u8,
            escape_xor: settings.escape_xor as u8,
        }
    }

    /// The control that a byte on the line stands for, its parity bit masked.
    pub(crate) fn control(&self, byte: u8) -> Option<Control> {
        if (byte ^ self.xoff) & self.mask == 0 {
            return Some(Control::Xoff);
        }
        ((byte ^ self.xon) & self.mask == 0).then_some(Control::Xon)
    }

    /// Whether a data byte must be escaped: control bytes with either parity
    /// bit, and the escape itself.
    pub(crate) fn must_escape(&self, byte: u8) -> bool {
        byte == self.escape || (byte ^ self.xon) & 0x7F == 0 || (byte ^ self.xoff) & 0x7F == 0
    }

    /// The two bytes that stand for a data byte in transparent mode, if it
    /// must be escaped.
    pub(crate) fn escaped(&self, byte: u8) -> Option<[u8; 2]> {
        self.must_escape(byte).then_some([self.escape, byte ^ self.escape_xor])
    }
}
