//! What drives lanes: the reactor those with a port of this computer, the units' thread those of
//! front-end units.

use std::collections::HashSet;
use std::sync::Arc;

use softplug_host::Session;
use softplug_live::PortError;
use softplug_live::reactor::{
    Command, LaneId, LaneSetup, LaneStatus, Probation, Reactor, ReactorOptions, Report, When,
};
use softplug_live::units::{
    BusSetup, BusSurvey, UnitCommand, UnitLinkFigures, UnitPlugin, UnitSetup, Units,
};

/// Both, as one.
pub(super) struct Drivers {
    reactor: Reactor<Session>,
    units: Units,
    of_units: HashSet<LaneId>,
}

impl Drivers {
    pub(super) fn start(
        options: ReactorOptions,
        reports: impl Fn(LaneId, Report) + Clone + Send + Sync + 'static,
    ) -> Result<Self, PortError> {
        let reactor = Reactor::start(options, reports.clone())?;
        let units = Units::start(identity(), reports)?;
        Ok(Self { reactor, units, of_units: HashSet::new() })
    }

    pub(super) fn add(&mut self, id: LaneId, setup: LaneSetup<Session>) {
        self.reactor.add(id, setup);
    }

    pub(super) fn add_unit(&mut self, id: LaneId, setup: UnitSetup) {
        self.of_units.insert(id);
        self.units.add(id, setup);
    }

    pub(super) fn set_buses(&self, buses: Vec<BusSetup>) {
        self.units.set_buses(buses);
    }

    pub(super) fn buses(&self) -> Vec<BusSurvey> {
        self.units.buses()
    }

    pub(super) fn unit_figures(&self, id: LaneId) -> Option<UnitLinkFigures> {
        self.units.figures(id)
    }

    /// The lane's end was told.
    pub(super) fn forget(&mut self, id: LaneId) {
        if self.of_units.remove(&id) {
            self.units.remove(id);
        }
    }

    pub(super) fn status(&self, id: LaneId) -> Option<Arc<LaneStatus>> {
        if self.of_units.contains(&id) { self.units.status(id) } else { self.reactor.status(id) }
    }

    pub(super) fn tell(&self, id: LaneId, command: Command<Session>) {
        if !self.of_units.contains(&id) {
            self.reactor.tell(id, command);
        } else if let Some(command) = for_unit(command) {
            self.units.tell(id, command);
        }
    }

    pub(super) fn swap_in_unit(
        &self,
        id: LaneId,
        plugin: UnitPlugin,
        when: When,
        probation: Probation,
    ) {
        self.units.tell(id, UnitCommand::Swap { plugin, when, probation });
    }

    pub(super) fn replace_in_unit(&self, id: LaneId, plugin: UnitPlugin) {
        self.units.tell(id, UnitCommand::Replace(plugin));
    }
}

/// What a unit is told; nothing where it has no such thing.
fn for_unit(command: Command<Session>) -> Option<UnitCommand> {
    Some(match command {
        Command::Begin(feed) => UnitCommand::Begin(feed),
        Command::Pause(job) => UnitCommand::Pause(job),
        Command::Resume(job) => UnitCommand::Resume(job),
        Command::Abort(job) => UnitCommand::Abort(job),
        Command::ForceResume => UnitCommand::ForceResume,
        Command::Refill { job, source } => UnitCommand::Refill { job, source },
        Command::Answer { request, answer } => UnitCommand::Answer { request, answer },
        Command::CancelSwap => UnitCommand::CancelSwap,
        Command::Halt(why) => UnitCommand::Halt(why),
        Command::Reopen => UnitCommand::Reopen,
        Command::Close { .. } => UnitCommand::Close,
        // What passes on a unit's line never leaves the unit, and its plug-ins are modules: see
        // `swap_in_unit` and `replace_in_unit`.
        Command::Watch(_) | Command::Swap(_) | Command::Replace { .. } => return None,
    })
}

/// New at each start: units tell servers apart by it.
fn identity() -> u64 {
    let mut bytes = [0; 8];
    let random = std::fs::File::open("/dev/urandom")
        .and_then(|mut source| std::io::Read::read_exact(&mut source, &mut bytes));
    if let Err(error) = random {
        tracing::warn!(%error, "no random number is to be had: the time is taken for one");
        return crate::view::now_ms();
    }
    u64::from_le_bytes(bytes)
}
