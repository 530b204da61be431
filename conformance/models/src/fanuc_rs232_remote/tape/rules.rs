//! Settings of a program, and what it can be refused for.

use crate::settings::Settings;
use softplug_abi::Failure;

/// What becomes of a character outside the code.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(in super::super) enum Unsupported {
    Refuse,
    Space,
    Drop,
}

/// What becomes of N numbers.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(in super::super) enum BlockNumbers {
    Keep,
    Strip,
    Renumber,
}

/// Settings under their names.
#[derive(Clone, Debug)]
pub(in super::super) struct TapeRules {
    pub(in super::super) eob: &'static [u8],
    pub(in super::super) tv_pad: bool,
    pub(super) tv_cr: bool,
    pub(super) tv_comments: bool,
    pub(super) upper: bool,
    pub(super) unsupported: Unsupported,
    /// Pairs: character, sent.
    pub(super) replace: Vec<u8>,
    pub(super) ascii: bool,
    pub(super) percent: bool,
    /// `after_end` is `drop`.
    pub(super) drops_behind: bool,
    pub(super) block_numbers: BlockNumbers,
    pub(super) number_step: u64,
}

impl TapeRules {
    pub(in super::super) fn new(settings: &Settings) -> Self {
        Self {
            eob: match settings.name("eob", "lf") {
                "crlf" => b"\r\n",
                "lfcrcr" => b"\n\r\r",
                "lfcr" => b"\n\r",
                "cr" => b"\r",
                _ => b"\n",
            },
            tv_pad: settings.is_on("tv_pad", false),
            tv_cr: settings.is_on("tv_cr", true),
            tv_comments: settings.is_on("tv_comments", true),
            upper: settings.is_on("upper", true),
            unsupported: match settings.name("unsupported", "refuse") {
                "space" => Unsupported::Space,
                "drop" => Unsupported::Drop,
                _ => Unsupported::Refuse,
            },
            replace: settings.bytes("replace", &[]),
            ascii: settings.is_on("ascii", false),
            percent: settings.is_on("percent", true),
            drops_behind: settings.name("after_end", "refuse") == "drop",
            block_numbers: match settings.name("block_numbers", "keep") {
                "strip" => BlockNumbers::Strip,
                "renumber" => BlockNumbers::Renumber,
                _ => BlockNumbers::Keep,
            },
            number_step: settings.int("number_step", 10) as u64,
        }
    }
}

/// Why a job is refused; the default is a good one.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Refused {
    pub(in super::super) failure: Option<Failure>,
    pub(in super::super) status: u16,
    pub(in super::super) line: u32,
    pub(in super::super) column: u32,
    pub(in super::super) clause: &'static str,
}
