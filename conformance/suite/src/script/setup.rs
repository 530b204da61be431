//! What the plug-in of a script is put on: its settings, its line, its port.

use super::failure::{Outcome, not_applicable};
use softplug_abi::manifest::Manifest;
use softplug_abi::{LineParameters, Micros, ModemLines};
use softplug_link::LinkOptions;

/// Room in bytes where a scenario says nothing.
const ROOM: u32 = 4_096;

/// What a link is made with.
#[derive(Clone, Debug)]
pub(super) struct Setup {
    pub(super) settings: Vec<(&'static str, String)>,
    pub(super) line: LineParameters,
    /// Characters that the plug-in's port holds.
    pub(super) depth: usize,
    /// From the end of a character until the plug-in is told.
    pub(super) reaction: Micros,
    pub(super) modem_lines: Option<(ModemLines, ModemLines)>,
    pub(super) transmit_room: u32,
    pub(super) delivery_room: u32,
}

impl Setup {
    pub(super) fn new(line: LineParameters, settings: &[(&'static str, &str)]) -> Self {
        let settings = settings.iter().map(|(name, value)| (*name, (*value).to_owned()));
        Self {
            settings: settings.collect(),
            line,
            depth: 1,
            reaction: Micros::ZERO,
            modem_lines: None,
            transmit_room: ROOM,
            delivery_room: ROOM,
        }
    }

    pub(super) fn options(&self, manifest: &Manifest) -> Outcome<LinkOptions> {
        let asked = self.settings.iter().map(|(name, value)| (*name, value.as_str()));
        let settings = manifest.resolve_settings(asked).map_err(|error| not_applicable(&error))?;
        Ok(LinkOptions {
            line: self.line,
            transmit_room: self.transmit_room,
            delivery_room: self.delivery_room,
            modem_lines: self.modem_lines,
            settings,
        })
    }
}
