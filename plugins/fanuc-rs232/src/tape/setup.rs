//! The settings, with what follows from them for each character.

use super::{DROPPED, REFUSED, SPECIAL};
use crate::code::{Code, encode, paired};
use crate::{BlockNumbers, Eob, SendCode, Settings, Unsupported};
use core::ops::Deref;

/// The settings, and the tables of the characters that are sent.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Setup {
    settings: Settings,
    pub(super) eob: &'static [u8],
    /// Each byte of a file: the character that is sent for it.
    pub(super) characters: [u8; 256],
    /// Each character on the wire.
    pub(super) wire: [u8; 128],
}

impl Deref for Setup {
    type Target = Settings;

    fn deref(&self) -> &Settings {
        &self.settings
    }
}

impl Setup {
    pub(crate) fn new(settings: &Settings) -> Self {
        let (code, eob): (_, &[u8]) = match (settings.code, settings.eob) {
            (SendCode::Eia, _) => (Code::Eia, b"\n"),
            (SendCode::Iso, Eob::Lf) => (Code::Iso, b"\n"),
            (SendCode::Iso, Eob::CrLf) => (Code::Iso, b"\r\n"),
            (SendCode::Iso, Eob::LfCrCr) => (Code::Iso, b"\n\r\r"),
            (SendCode::Iso, Eob::LfCr) => (Code::Iso, b"\n\r"),
            (SendCode::Iso, Eob::Cr) => (Code::Iso, b"\r"),
        };
        let mut setup = Self { settings: *settings, eob, characters: [0; 256], wire: [0; 128] };
        for (byte, own) in setup.characters.iter_mut().enumerate() {
            *own = character(settings, code, byte as u8);
        }
        for (character, own) in setup.wire.iter_mut().enumerate() {
            *own = encode(settings, code, character as u8).unwrap_or_default();
        }
        setup
    }

    /// How many bytes one byte of a program becomes at most, over many.
    pub(crate) fn growth(&self) -> u32 {
        let eob = self.eob.len() as u32 + u32::from(self.tv_pad);
        // `N1` can become `N99999`.
        if self.block_numbers == BlockNumbers::Renumber { eob.max(3) } else { eob }
    }
}

/// What is sent for a byte of a file.
fn character(settings: &Settings, code: Code, byte: u8) -> u8 {
    let character = paired(settings.replace.as_slice(), 0, byte);
    let character = character.unwrap_or(byte);
    let character = if settings.upper { character.to_ascii_uppercase() } else { character };
    match character {
        b'\n' | b'\r' | b'%' | b'(' | b')' => character | SPECIAL,
        _ if encode(settings, code, character).is_some() => character,
        _ => match settings.unsupported {
            Unsupported::Refuse => REFUSED,
            Unsupported::Space => b' ',
            Unsupported::Drop => DROPPED,
        },
    }
}
