//! Where a script takes place: the plug-in that is judged, and the log.

use super::failure::Outcome;
use super::play::Play;
use super::setup::Setup;
use crate::run::erased::{Anything, Starts};
use crate::run::seen::Seen;
use crate::run::subject::Fuel;
use crate::run::transcript;
use softplug_abi::LineParameters;
use softplug_abi::manifest::Manifest;
use softplug_machines::Partner;

/// Bytes that stand on one line of the log.
const BYTES: usize = 16;

/// The plug-in that is judged, and the log.
pub(super) struct ScriptContext<'a> {
    pub(super) subject: Anything<'a>,
    pub(super) log: Vec<String>,
    pub(super) fuel: Fuel,
    pub(super) bytes: u64,
}

impl<'a> ScriptContext<'a> {
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
        let entries = transcript::entries(line, self.manifest(), seen, BYTES, |_| false);
        self.log.extend(entries.iter().map(ToString::to_string));
    }
}

impl ScriptContext<'_> {
    /// Adds to what the plug-in's computing has cost.
    pub(super) fn count(&mut self, fuel: Fuel, bytes: u64) {
        self.fuel.total = self.fuel.total.saturating_add(fuel.total);
        self.fuel.largest = self.fuel.largest.max(fuel.largest);
        self.bytes += bytes;
    }
}
