//! What the control loop knows of one link.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use softplug_abi::{DeliveryId, Failure, JobId, RequestId};
use softplug_host::Digest;
use softplug_live::awaited::awaited;
use softplug_live::reactor::{AlarmKind, Condition, JobEnd, LaneFigures, LaneId, LaneStatus};
use softplug_live::reservoir::Gauge;
use softplug_trial::reason;

use super::history::History;
use super::loading::Prepared;
use super::rate::Rate;
use super::simulated::Simulated;
use crate::config::{LinkConfig, PortConfig, Probation};
use crate::jobs::{Extent, Job, LaneProgress};
use crate::supervise::{Follow, State, Supervisor};
use crate::view::{
    BlockView, FaultView, LinkState, PluginRef, SwapState, SwapView, SwapWhen, TimeMs,
    UnappliedView, now_ms,
};

/// What is awaited for less than this is in the course of things: an answer to each block.
const AWAITED: Duration = Duration::from_secs(1);
/// Faults that are shown.
const FAULTS: usize = 10;

/// One link.
pub(crate) struct Link {
    pub(crate) config: LinkConfig,
    /// Its configuration has changed; it is made anew once it is idle.
    pub(crate) next: Option<Box<(LinkConfig, Prepared)>>,
    /// What the configuration asks for and the link did not take.
    pub(crate) unapplied: Option<UnappliedView>,
    pub(crate) lane: Lane,
    pub(crate) status: Arc<LaneStatus>,
    pub(crate) plugin: Prepared,
    pub(crate) supervisor: Supervisor,
    pub(crate) follow: Follow<Digest>,
    pub(crate) port: PortFacts,
    pub(crate) condition: Option<String>,
    /// Since when the plug-in has said so.
    pub(crate) condition_since: Instant,
    pub(crate) alarms: Vec<(AlarmKind, TimeMs)>,
    pub(crate) job: Option<Running>,
    /// What comes, by the plug-in's numbers.
    pub(crate) deliveries: BTreeMap<DeliveryId, Arriving>,
    /// Requests that are being answered, with the job that an answer is.
    pub(crate) requests: HashMap<RequestId, Option<JobId>>,
    pub(crate) swap: Option<Swapping>,
    pub(crate) faults: VecDeque<FaultView>,
    pub(crate) gauge: Option<Gauge>,
    /// Counts of lanes that were closed.
    pub(crate) before: Before,
    /// What it did over the last day.
    pub(crate) history: History,
    /// The plug-in that ran before this one without a fault.
    pub(crate) ran_well: Option<PluginRef>,
    /// Ends with the lane.
    pub(crate) machine: Option<Simulated>,
}

/// Where its lane is.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Lane {
    Open(LaneId),
    /// It is closed, to be made anew or to go.
    Closing(LaneId, After),
}

impl Lane {
    pub(crate) fn id(self) -> LaneId {
        match self {
            Self::Open(id) | Self::Closing(id, _) => id,
        }
    }
}

/// What comes after a lane was closed.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum After {
    Remake,
    Remove,
}

/// What is known of the port.
#[derive(Debug, Default)]
pub(crate) struct PortFacts {
    pub(crate) is_up: bool,
    pub(crate) path: Option<PathBuf>,
    pub(crate) differences: Vec<String>,
    pub(crate) down: Option<crate::view::DownView>,
    pub(crate) client: Option<String>,
    pub(crate) endpoint_failure: Option<String>,
}

/// The job that the plug-in has.
#[derive(Debug)]
pub(crate) struct Running {
    pub(crate) job: Job,
    pub(crate) ends_as: EndsAs,
    /// Answers to it that are being put away.
    pub(crate) answers: u32,
    /// How it ended, while an answer is being put away.
    pub(crate) ended: Option<JobEnd>,
    /// The program is looked at; nothing of it is sent yet.
    pub(crate) is_check: bool,
    /// Its cell lets nothing more of it leave.
    pub(crate) is_held_by_cell: bool,
    /// How fast it gets on.
    pub(crate) rate: Rate,
    /// The block that is being sent, as it was last looked up.
    pub(crate) block: Option<BlockView>,
}

impl Running {
    /// What the machine answered is not on the disk.
    pub(crate) fn is_answer_lost(&self) -> bool {
        self.job.reception.as_ref().is_some_and(|reception| !reception.is_complete)
    }
}

/// How a job that is aborted is written down.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum EndsAs {
    /// As the plug-in says.
    ItIs,
    /// Somebody wanted it.
    Aborted,
    /// The gateway wanted it, for this reason.
    Interrupted(&'static str),
}

/// A delivery under way.
#[derive(Debug)]
pub(crate) struct Arriving {
    pub(crate) name: Option<String>,
    pub(crate) since_ms: TimeMs,
    pub(crate) gauge: Gauge,
}

/// A swap that was ordered, or the last one.
#[derive(Debug)]
pub(crate) struct Swapping {
    pub(crate) view: SwapView,
    pub(crate) successor: Prepared,
    /// The one before, while there is a way back to it.
    pub(crate) former: Option<Prepared>,
    /// Who waits for what comes of it.
    pub(crate) waits: Option<SyncSender<SwapView>>,
    /// What is to be done at once in its place, when it is known what became of it.
    pub(crate) then: Option<Box<WantedSwap>>,
    /// The plug-in as the configuration names it, if that asks for the swap.
    pub(crate) configured: Option<String>,
}

/// A swap that was prepared.
#[derive(Debug)]
pub(crate) struct WantedSwap {
    pub(crate) successor: Prepared,
    pub(crate) when: SwapWhen,
    /// As configured if `None`.
    pub(crate) probation: Option<Probation>,
    pub(crate) waits: Option<SyncSender<SwapView>>,
    /// The plug-in as the configuration names it, if that asks for the swap.
    pub(crate) configured: Option<String>,
}

/// Counts of closed lanes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Before(pub(crate) Option<LaneFigures>);

impl Before {
    /// Adds what a lane had counted when it ended.
    pub(crate) fn add(&mut self, figures: &LaneFigures) {
        let Some(before) = &mut self.0 else {
            self.0 = Some(figures.clone());
            return;
        };
        for (sum, count) in before.line_errors.iter_mut().zip(figures.line_errors) {
            *sum += count;
        }
        before.bytes_in += figures.bytes_in;
        before.bytes_out += figures.bytes_out;
        before.holds += figures.holds;
        before.held_micros += figures.held_micros;
        before.gaps += figures.gaps;
        before.longest_gap_micros = before.longest_gap_micros.max(figures.longest_gap_micros);
        before.after_hold += figures.after_hold;
        before.starvations += figures.starvations;
        before.starved_micros += figures.starved_micros;
        before.events += figures.events;
        before.fuel += figures.fuel;
        before.restarts += figures.restarts;
        before.opened += figures.opened;
        before.left_out += figures.left_out;
        before.endpoint_jobs += figures.endpoint_jobs;
        before.endpoint_failed += figures.endpoint_failed;
        before.endpoint_bytes += figures.endpoint_bytes;
    }
}

impl Link {
    pub(crate) fn lane_id(&self) -> LaneId {
        self.lane.id()
    }

    /// Its plug-in runs in a front-end unit.
    pub(crate) fn is_of_unit(&self) -> bool {
        matches!(self.config.port, crate::config::PortConfig::Unit(_))
    }

    /// Something is under way that a change would break off.
    pub(crate) fn is_busy(&self) -> bool {
        self.job.is_some() || !self.deliveries.is_empty() || self.status.read().job != 0
    }

    /// Whether a job may be begun.
    pub(crate) fn takes_jobs(&self) -> bool {
        let waits_for_idle = self
            .swap
            .as_ref()
            .is_some_and(|swap| matches!(swap.view.state, SwapState::Ordered | SwapState::Waiting));
        matches!(self.lane, Lane::Open(_))
            && self.port.is_up
            && self.job.is_none()
            && self.next.is_none()
            && !waits_for_idle
            && self.supervisor.state() == State::Running
            && self.status.condition() == Condition::Up
    }

    /// What its lane knows of the job under way, if it is this one. The one place where a lane's
    /// figures become a job's.
    pub(crate) fn lane_progress(&self, job: JobId, figures: &LaneFigures) -> Option<LaneProgress> {
        let running = self.job.as_ref().filter(|running| running.job.id == job)?;
        let from = running.job.spec.from;
        let is_known = figures.job == job.0 && !running.is_check;
        let (taken, surely) = if is_known {
            (from + figures.job_taken, from + figures.job_bytes_surely_left)
        } else {
            (from, from)
        };
        // All that the plug-in took may have left: never too low, also where figures lag behind.
        let extent = Extent { surely, maybe: taken.max(surely) };
        let is_held = self.is_held(figures);
        let awaits = self.awaits().filter(|_| !running.is_check);
        Some(LaneProgress {
            taken,
            extent,
            is_held,
            awaits,
            is_check: running.is_check,
            rate: running.rate.bytes_a_second(),
            block: running.block.clone(),
        })
    }

    /// Whether the machine holds the line. What has not been let go yet for the first time is
    /// awaited, not held.
    pub(crate) fn is_held(&self, figures: &LaneFigures) -> bool {
        let waits = self.condition.as_deref().is_some_and(|state| awaited(state).is_some());
        figures.is_held && figures.condition == Condition::Up && !waits
    }

    /// What is awaited from the machine, once it has been for a while.
    fn awaits(&self) -> Option<String> {
        let is_long = self.condition_since.elapsed() >= AWAITED;
        awaited(self.condition.as_deref()?).filter(|_| is_long)
    }

    /// What it is doing, in one word.
    pub(crate) fn state(&self, figures: &LaneFigures) -> LinkState {
        if matches!(self.lane, Lane::Closing(..)) {
            return LinkState::Closing;
        }
        match self.supervisor.state() {
            State::Quarantined { .. } => return LinkState::Quarantined,
            State::Waiting { .. } => return LinkState::Restarting,
            State::Running => {}
        }
        match figures.condition {
            Condition::Opening if self.port.down.is_none() => return LinkState::Opening,
            Condition::Opening | Condition::Down => return LinkState::Down,
            Condition::Faulted => return LinkState::Restarting,
            Condition::Closing | Condition::Removed => return LinkState::Closing,
            Condition::Up => {}
        }
        match &self.job {
            Some(running) if running.job.state == crate::jobs::State::Paused => LinkState::Paused,
            Some(_) => LinkState::Sending,
            None if figures.job != 0 => LinkState::Sending,
            None if self.deliveries.is_empty() => LinkState::Idle,
            None => LinkState::Receiving,
        }
    }

    /// The configuration asks for this plug-in, and the link goes on without it.
    pub(crate) fn did_not_take(&mut self, plugin: &str, why: &str) {
        let text =
            format!("gateway.toml asks for the plug-in {plugin}, which was not taken: {why}");
        if self.unapplied.as_ref().is_none_or(|unapplied| unapplied.text != text) {
            self.unapplied =
                Some(UnappliedView { plugin: plugin.to_owned(), text, since_ms: now_ms() });
        }
    }

    /// A swap that waits went with the lane: nothing more is heard of it.
    pub(crate) fn give_up_swap(&mut self, why: &str) {
        let Some(swap) = &mut self.swap else { return };
        if !matches!(swap.view.state, SwapState::Ordered | SwapState::Waiting) {
            return;
        }
        swap.view.state = SwapState::Refused;
        swap.view.message = Some(why.to_owned());
        swap.view.at_ms = now_ms();
        swap.former = None;
        if let Some(waits) = swap.waits.take() {
            // It may have become tired of waiting.
            let _ = waits.try_send(swap.view.clone());
        }
    }

    /// A change of the configuration waits until nothing is under way.
    pub(crate) fn has_change_waiting(&self) -> bool {
        let swap_waits = self.swap.as_ref().is_some_and(|swap| {
            swap.configured.is_some()
                && matches!(swap.view.state, SwapState::Ordered | SwapState::Waiting)
        });
        matches!(self.lane, Lane::Open(_)) && (self.next.is_some() || swap_waits)
    }

    /// Another plug-in takes the place of this one, which is known as one that runs well unless it
    /// has failed.
    pub(crate) fn remember_former(&mut self, former: &PluginRef) {
        let has_failed = self.faults.iter().any(|fault| fault.plugin.digest == former.digest);
        if !has_failed && self.plugin.which.digest != former.digest {
            self.ran_well = Some(former.clone());
        }
    }

    pub(crate) fn keep_fault(&mut self, fault: FaultView) {
        if self.faults.len() == FAULTS {
            self.faults.pop_front();
        }
        self.faults.push_back(fault);
    }

    /// A failure in the words of the protocol, where the manifest knows them.
    pub(crate) fn words(&self, failure: Failure, status: u16) -> String {
        if failure == Failure::Interrupted {
            return self.interrupted().to_owned();
        }
        reason(self.plugin.plugin.manifest(), failure, status)
    }

    /// What only a host reports, and no plug-in.
    pub(crate) fn interrupted(&self) -> &'static str {
        match self.config.port {
            PortConfig::Unit(_) => "the unit, or its plug-in, ended in the middle of it",
            _ => "the plug-in ended in the middle of it",
        }
    }
}
