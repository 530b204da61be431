//! Swaps of plug-ins: ordered, reported, taken back; and links that follow the
//! library.

use std::sync::Arc;

use softplug_link::{Spare, Successor};
use softplug_live::reactor::{Command, LaneFault, Probation, Swap, SwapReport, When};

use super::Control;
use super::faults::described;
use super::link::{Lane, Swapping, WantedSwap};
use super::loading::Prepared;
use crate::Refusal;
use crate::config::{self, SwapPolicy, micros};
use crate::jobs::{Note, Subject, Weight};
use crate::library::LibraryNews;
use crate::supervise::{State, Taking};
use crate::view::{Change, PluginRef, SwapState, SwapView, SwapWhen, now_ms};

impl Control {
    /// Orders a swap.
    pub(super) fn order_swap(
        &mut self,
        name: &str,
        wanted: WantedSwap,
    ) -> Result<SwapView, Refusal> {
        let link = self.link(name)?;
        let is_running = link.supervisor.state() == State::Running;
        if let Some(swap) = &mut link.swap
            && matches!(swap.view.state, SwapState::Ordered | SwapState::Waiting)
            && is_running
        {
            if wanted.when == SwapWhen::Now && swap.view.state == SwapState::Waiting {
                let view = ordered(name, Some(link.plugin.which.clone()), &wanted.successor);
                swap.then = Some(Box::new(wanted));
                let lane = link.lane_id();
                self.drivers.tell(lane, Command::CancelSwap);
                return Ok(view);
            }
            return Err(Refusal::Conflict(format!(
                "the link \"{name}\" is about to take {} {}; `now` does not wait for that",
                swap.view.to.name, swap.view.to.version
            )));
        }
        if !matches!(link.lane, Lane::Open(_)) || link.next.is_some() {
            return Err(Refusal::Conflict(format!(
                "the link \"{name}\" is being made anew with another configuration"
            )));
        }
        let WantedSwap { successor, when, probation, waits, configured } = wanted;
        let view = ordered(name, Some(link.plugin.which.clone()), &successor);
        link.follow.ordered(successor.digest());
        if !is_running {
            // What waited has nothing left to wait for.
            let lane = link.lane_id();
            self.drivers.tell(lane, Command::CancelSwap);
            return Ok(self.put_in_place(name, successor, view));
        }
        let probation = probation.unwrap_or(link.config.probation);
        let in_unit = link.is_of_unit().then(|| successor.for_unit());
        let swap = match in_unit {
            Some(_) => None,
            None => Some(
                swap(&link.plugin, &successor, when, probation)
                    .map_err(|error| Refusal::invalid("plugin", error))?,
            ),
        };
        let former = Some(link.plugin.clone());
        let then = None;
        link.swap =
            Some(Swapping { view: view.clone(), successor, former, waits, then, configured });
        let lane = link.lane_id();
        match (swap, in_unit) {
            (Some(swap), _) => self.drivers.tell(lane, Command::Swap(swap)),
            (None, Some(plugin)) => {
                self.drivers.swap_in_unit(lane, plugin, moment(when), on_trial(probation));
            }
            (None, None) => {}
        }
        Ok(view)
    }

    /// Nothing runs that a state could be taken of: the new plug-in is started.
    fn put_in_place(&mut self, name: &str, successor: Prepared, view: SwapView) -> SwapView {
        let view = SwapView { state: SwapState::Done, ..view };
        let text = format!("{} takes the place of one that had failed", described(&successor));
        if let Some(link) = self.links.get_mut(name) {
            link.follow.runs(successor.digest());
            link.supervisor.begin_anew();
            let waits = None;
            let former = None;
            link.plugin = successor.clone();
            link.unapplied = None;
            let (then, configured) = (None, None);
            link.swap =
                Some(Swapping { view: view.clone(), successor, former, waits, then, configured });
            let plugin = link.plugin.clone();
            self.note_use(name, &plugin, None);
        }
        self.shared.parts.journal_writer.link(Subject::Swap, Weight::Normal, name, text);
        self.start_plugin(name);
        view
    }

    /// What came of a swap.
    pub(super) fn swapped(&mut self, name: &str, report: SwapReport) {
        let Some(link) = self.links.get_mut(name) else { return };
        let Some(swap) = &mut link.swap else { return };
        if matches!(report, SwapReport::Refused { .. })
            && !matches!(swap.view.state, SwapState::Ordered | SwapState::Waiting)
        {
            // Of one that waited until another took its place.
            return;
        }
        let (new, old) = (described(&swap.successor), swap.former.as_ref().map(described));
        let old = old.unwrap_or_default();
        let not_taken = match (&report, &swap.configured) {
            (SwapReport::Refused { sentence }, Some(plugin)) => {
                Some((plugin.clone(), sentence.clone()))
            }
            (SwapReport::Reverted(fault), Some(plugin)) => {
                Some((plugin.clone(), fault.sentence.clone()))
            }
            (SwapReport::Done { .. }, Some(_)) => {
                link.unapplied = None;
                None
            }
            _ => None,
        };
        swap.view.at_ms = now_ms();
        let (mut used, mut former) = (None, None);
        let (weight, text) = match report {
            SwapReport::Waiting => {
                swap.view.state = SwapState::Waiting;
                (Weight::Normal, format!("{new} waits until the link is idle"))
            }
            SwapReport::Done { pause, with_state, on_probation } => {
                swap.view.state = if on_probation { SwapState::Probation } else { SwapState::Done };
                swap.view.pause_us = Some(pause.0.max(0) as u64);
                link.plugin = swap.successor.clone();
                link.follow.runs(link.plugin.digest());
                link.supervisor.begin_anew();
                used = Some((link.plugin.clone(), swap.former.clone().filter(|_| on_probation)));
                former = swap.former.as_ref().map(|former| former.which.clone());
                if !on_probation {
                    swap.former = None;
                }
                let how = if with_state { "with its state" } else { "as new" };
                let how_long = if on_probation { ", on probation" } else { "" };
                let pause = pause.0;
                (
                    Weight::Normal,
                    format!(
                        "{new} runs in place of {old}, {how}{how_long}; the link stood still for {pause} µs"
                    ),
                )
            }
            SwapReport::Refused { sentence } => {
                swap.view.state = SwapState::Refused;
                let (failed, running) = (swap.successor.digest(), link.plugin.digest());
                link.follow.rejected(failed, running);
                let text = format!("{new} was not taken, {old} goes on: {sentence}");
                swap.view.message = Some(sentence);
                (Weight::Warning, text)
            }
            SwapReport::Kept => {
                swap.view.state = SwapState::Done;
                swap.former = None;
                used = Some((link.plugin.clone(), None));
                (Weight::Normal, format!("{new} has passed its probation"))
            }
            SwapReport::Reverted(fault) => {
                swap.view.state = SwapState::Reverted;
                swap.view.message = Some(fault.sentence.clone());
                let failed = swap.successor.clone();
                if let Some(former) = swap.former.take() {
                    link.follow.rejected(failed.digest(), former.digest());
                    used = Some((former.clone(), None));
                    link.plugin = former;
                }
                let text = format!("{new} failed on probation, {old} goes on: {}", fault.sentence);
                self.keep_fault(name, &failed, *fault);
                (Weight::Alarm, text)
            }
        };
        if let Some((former, link)) = former.zip(self.links.get_mut(name)) {
            link.remember_former(&former);
        }
        if let Some(((plugin, why), link)) = not_taken.zip(self.links.get_mut(name)) {
            link.did_not_take(&plugin, &why);
        }
        self.shared.parts.journal_writer.link(Subject::Swap, weight, name, text);
        if let Some((running, former)) = used {
            self.note_use(name, &running, former.as_ref());
        }
        if let Some(swap) = self.links.get_mut(name).and_then(|link| link.swap.as_mut())
            && let Some(waits) = swap.waits.take()
        {
            // It may have become tired of waiting.
            let _ = waits.try_send(swap.view.clone());
        }
        self.swap_instead(name);
        self.begin_next(name);
    }

    /// Goes on with what was wanted at once while another swap waited.
    fn swap_instead(&mut self, name: &str) {
        let Some(swap) = self.links.get_mut(name).and_then(|link| link.swap.as_mut()) else {
            return;
        };
        if matches!(swap.view.state, SwapState::Ordered | SwapState::Waiting) {
            return;
        }
        let Some(wanted) = swap.then.take() else { return };
        if let Err(refusal) = self.order_swap(name, *wanted) {
            let text = format!("the swap that was wanted at once is not done: {refusal}");
            self.shared.parts.journal_writer.link(Subject::Swap, Weight::Warning, name, text);
        }
    }

    fn keep_fault(&mut self, name: &str, plugin: &Prepared, fault: LaneFault) {
        let view = self.shared.fault_view(name, plugin, fault);
        if let Some(link) = self.links.get_mut(name) {
            link.keep_fault(view);
        }
    }

    /// A plug-in came into the library, or went.
    pub(super) fn library_news(&mut self, news: LibraryNews) {
        let text = match news {
            LibraryNews::Available(entry) => {
                self.follow();
                format!("{} {} is available", entry.name, entry.version)
            }
            LibraryNews::Gone { name, version } => format!("{name} {version} is gone"),
            LibraryNews::Refused { file, error } => {
                format!("{} was not taken: {error}", file.display())
            }
        };
        self.shared.parts.journal_writer.note(Note::new(Subject::Library, text));
        self.shared.changed(Change::Plugins);
    }

    /// Swaps the links that follow the library and have something new there.
    fn follow(&mut self) {
        for (name, link) in &self.links {
            let when = match link.config.swap {
                SwapPolicy::Manual => continue,
                SwapPolicy::Follow => SwapWhen::NowOrIdle,
                SwapPolicy::FollowWhenIdle => SwapWhen::Idle,
            };
            let (shared, name) = (Arc::clone(&self.shared), name.clone());
            let (plugin, settings) = (link.config.plugin.clone(), link.plugin.settings.clone());
            self.shared.parts.loading.give(move || {
                let prepared = shared.parts.loader.prepare(&plugin, &settings);
                let control = Arc::clone(&shared);
                control.tell(move |control| match prepared {
                    Ok(successor) => control.follow_one(&name, successor, when),
                    Err(error) => {
                        let text = format!("what is new in the library is not taken: {error}");
                        control.shared.parts.journal_writer.link(
                            Subject::Swap,
                            Weight::Warning,
                            &name,
                            text,
                        );
                    }
                });
            });
        }
    }

    fn follow_one(&mut self, name: &str, successor: Prepared, when: SwapWhen) {
        let Some(link) = self.links.get(name) else { return };
        if link.follow.asks(&successor.digest()) != Taking::Take {
            return;
        }
        let wanted = WantedSwap { successor, when, probation: None, waits: None, configured: None };
        if let Err(refusal) = self.order_swap(name, wanted) {
            tracing::warn!(link = name, %refusal, "a new version is not taken now");
        }
    }
}

/// A swap as it is shown when it is ordered.
fn ordered(name: &str, from: Option<PluginRef>, successor: &Prepared) -> SwapView {
    SwapView {
        link: name.to_owned(),
        from,
        to: successor.which.clone(),
        state: SwapState::Ordered,
        at_ms: now_ms(),
        pause_us: None,
        message: None,
    }
}

/// What the reactor needs for it.
fn swap(
    running: &Prepared,
    successor: &Prepared,
    when: SwapWhen,
    probation: config::Probation,
) -> Result<Swap<softplug_host::Session>, super::loading::Unloadable> {
    let (new, old) = (successor.plugin.manifest(), running.plugin.manifest());
    // There is a way back in the middle only with a state that the one before takes.
    let accepts_back = old.accepts_of(new);
    let goes_back = new.state.saves.is_some_and(|format| accepts_back.contains(&format));
    let has_probation = probation != config::Probation::default() && goes_back;
    let spare = if has_probation {
        Some(Spare { instance: running.instance()?, accepts: accepts_back.to_vec() })
    } else {
        None
    };
    Ok(Swap {
        successor: Successor {
            instance: successor.instance()?,
            settings: successor.values.clone(),
            accepts: new.accepts_of(old).to_vec(),
            spare,
        },
        when: moment(when),
        probation: on_trial(probation),
    })
}

fn moment(when: SwapWhen) -> When {
    match when {
        SwapWhen::Now => When::Now,
        SwapWhen::Idle => When::Idle,
        SwapWhen::NowOrIdle => When::NowOrIdle,
    }
}

fn on_trial(probation: config::Probation) -> Probation {
    Probation { events: probation.events, span: micros(probation.span) }
}
