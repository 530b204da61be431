//! Where a script takes place: the plug-in that is judged, and the log.

use super::ScriptFailure;
use super::erased::{Anything, Starts};
use super::play::Play;
use crate::fault::{Fault, FaultClass};
use crate::partners::Partner;
use crate::replay::Seen;
use crate::{Class, Fuel, show};
use softplug_abi::manifest::Manifest;
use softplug_abi::{LineParameters, Micros, ModemLines};
use softplug_link::LinkOptions;

/// How a scenario, or a part of it, went.
pub(super) type Outcome<T = ()> = Result<T, Box<ScriptFailure>>;

/// Room in bytes where a scenario says nothing.
const ROOM: u32 = 4_096;

/// Bytes that stand on one line of the log.
const BYTES: usize = 16;

/// The plug-in that is judged, and the log.
pub(super) struct Stage<'a> {
    pub(super) subject: Anything<'a>,
    pub(super) log: Vec<String>,
    pub(super) fuel: Fuel,
    pub(super) bytes: u64,
}

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
        let settings = manifest
            .resolve_settings(asked)
            .map_err(|error| Fault::new(FaultClass::NotApplicable, Micros::ZERO, &error))?;
        Ok(LinkOptions {
            line: self.line,
            transmit_room: self.transmit_room,
            delivery_room: self.delivery_room,
            modem_lines: self.modem_lines,
            settings,
        })
    }
}

impl<'a> Stage<'a> {
    pub(super) fn new(subject: &'a dyn Starts) -> Self {
        Self { subject: Anything(subject), log: Vec::new(), fuel: Fuel::default(), bytes: 0 }
    }

    pub(super) fn manifest(&self) -> &'a Manifest {
        self.subject.0.manifest()
    }

    /// The plug-in and `partner` on one line, opened at time 0. What was seen until the
    /// scenario ended, well or not, goes into the log.
    pub(super) fn play<P: Partner>(
        &mut self,
        setup: &Setup,
        partner: P,
        scenario: impl FnOnce(&mut Play<'_, P>) -> Outcome,
    ) -> Outcome {
        let mut play = Play::new(self.subject, setup, partner)?;
        let done = play.open().and_then(|()| scenario(&mut play));
        let (seen, fuel, bytes) = play.finish();
        self.write(setup.line, &seen);
        self.count(fuel, bytes);
        done
    }

    /// Writes what was seen into the log.
    pub(super) fn write(&mut self, line: LineParameters, seen: &[Seen]) {
        let entries = show::entries(line, self.manifest(), seen, BYTES, |_| false);
        self.log.extend(entries.iter().map(ToString::to_string));
    }
}

impl Stage<'_> {
    /// Adds to what the plug-in's computing has cost.
    pub(super) fn count(&mut self, fuel: Fuel, bytes: u64) {
        self.fuel.total = self.fuel.total.saturating_add(fuel.total);
        self.fuel.largest = self.fuel.largest.max(fuel.largest);
        self.bytes += bytes;
    }
}

/// A failure that the plug-in's behaviour shows.
#[expect(clippy::unnecessary_box_returns, reason = "it is the error of a small result")]
pub(super) fn diverged(
    at: Micros,
    message: impl Into<String>,
    expected: impl Into<String>,
    observed: impl Into<String>,
) -> Box<ScriptFailure> {
    Box::new(ScriptFailure {
        class: Class::Diverged,
        at_us: at.0,
        message: message.into(),
        expected: expected.into(),
        observed: observed.into(),
    })
}

impl Stage<'_> {
    #[expect(clippy::unnecessary_box_returns, reason = "it is the error of a small result")]
    pub(super) fn not_applicable(reason: &str) -> Box<ScriptFailure> {
        Fault::new(FaultClass::NotApplicable, Micros::ZERO, reason).into()
    }
}
