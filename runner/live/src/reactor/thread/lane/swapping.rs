//! A lane's plug-in is swapped: at once, when nothing is under way, on probation.

use softplug_abi::{Instance, Micros};
use softplug_link::{Spare, Successor, SwapError};

use super::faults::{fault_of, sentence};
use super::{Lane, Phase};
use crate::reactor::LaneInstance;
use crate::reactor::report::Report;
use crate::reactor::swap::{Probation, Swap, SwapReport, When};
use crate::reactor::thread::Thread;
use crate::recorder::{Recorded, recording_of};

/// A plug-in with a timer running may be in the middle of a frame; if nothing has
/// come for so long, it is not.
const QUIET: Micros = Micros::from_millis(1_000);
/// Why a swap at once is refused.
const STRANGER: &str = "the new plug-in takes over no state of the running one, and something is \
                        under way; swap it when the link is idle";

pub(super) struct Swapping<I> {
    /// Waits until nothing is under way.
    waiting: Option<Box<Swap<I>>>,
    /// Bytes that had come, and since when no more have.
    quiet: (u64, Micros),
    /// A probation under way: what it needs, and the earliest end.
    trial: Option<(u64, Micros)>,
}

impl<I> Swapping<I> {
    pub(super) fn new() -> Self {
        Self { waiting: None, quiet: (0, Micros::ZERO), trial: None }
    }

    /// The plug-in has ended for good; whether it was on probation.
    pub(super) fn ends(&mut self) -> bool {
        self.trial.take().is_some()
    }
}

impl<I: LaneInstance> Lane<I> {
    pub(super) fn swap(&mut self, thread: &Thread<I>, swap: Swap<I>) {
        if self.swapping.waiting.take().is_some() {
            self.refuse_swap("another swap was asked for before the link was idle".to_owned());
        }
        let Phase::Open(_) = &self.phase else { return self.swap_before_open(swap) };
        if self.is_faulted {
            return self.swap_as_new(thread, swap);
        }
        // A plug-in that takes no state of the one that runs begins as new, and so when idle.
        let is_stranger = swap.successor.accepts.is_empty();
        let is_possible = match swap.when {
            When::Now => !is_stranger,
            When::NowOrIdle => self.can_carry_over(&swap.successor.accepts),
            When::Idle => false,
        };
        if is_possible {
            return self.swap_with_state(thread, swap.successor, swap.probation);
        }
        let may_wait = swap.when != When::Now;
        self.swapping.waiting = Some(Box::new(swap));
        self.begin_quiet();
        if self.swap_if_idle(thread) {
            return;
        }
        if may_wait {
            self.host.tell(Report::Swapped(SwapReport::Waiting));
        } else {
            self.swapping.waiting = None;
            self.refuse_swap(STRANGER.to_owned());
        }
    }

    /// The swap that waits is no longer wanted.
    pub(super) fn cancel_swap(&mut self) {
        if self.swapping.waiting.take().is_some() {
            self.refuse_swap("another one was asked for at once".to_owned());
        }
    }

    /// Once a turn: whoever waits or is on trial.
    pub(super) fn look_after_swap(&mut self, thread: &Thread<I>) {
        self.tell_reverted(thread);
        if let Some((events, until)) = self.swapping.trial
            && let Phase::Open(channel) = &mut self.phase
        {
            let link = channel.link_mut();
            let mastered = link.on_probation();
            if self.clock.now() >= until && mastered.is_some_and(|mastered| mastered >= events) {
                link.keep();
                self.swapping.trial = None;
                self.host.tell(Report::Swapped(SwapReport::Kept));
            }
        }
        if self.swapping.waiting.is_some() {
            self.begin_quiet();
            self.swap_if_idle(thread);
        }
    }

    /// When to look again, if nothing comes.
    pub(super) fn swap_deadline(&self, now: Micros) -> Option<Micros> {
        let trial = self.swapping.trial.map(|(_, until)| until).filter(|until| *until > now);
        let idle = || {
            let Phase::Open(channel) = &self.phase else { return None };
            let quiet = Some(self.swapping.quiet.1 + QUIET).filter(|at| *at > now);
            // What is still on the line ends without a word.
            let line = channel.next_look_at_the_line(now);
            [quiet, line].into_iter().flatten().min().filter(|_| channel.link().is_idle())
        };
        let idle = self.swapping.waiting.as_ref().and_then(|_| idle());
        [trial, idle].into_iter().flatten().min()
    }

    fn refuse_swap(&mut self, sentence: String) {
        self.host.tell(Report::Swapped(SwapReport::Refused { sentence }));
    }

    fn swap_before_open(&mut self, swap: Swap<I>) {
        if let Phase::New(Some(made)) = &mut self.phase {
            let (made, options) = &mut **made;
            *made = Recorded::new(swap.successor.instance, self.recorder_bytes);
            options.settings = swap.successor.settings;
            self.tell_done(Micros::ZERO, false);
        }
    }

    /// Whether the plug-in saves a state in one of these formats.
    fn can_carry_over(&mut self, accepts: &[u16]) -> bool {
        if accepts.is_empty() {
            return false;
        }
        let Phase::Open(channel) = &mut self.phase else { return false };
        let saved =
            channel.ask(self.clock.now(), &mut self.host, |link, now, host| link.save(now, host));
        // A fault shows again where it is dealt with.
        match saved {
            Ok(Ok(Some(state))) => accepts.contains(&state.format),
            Ok(Ok(None)) => false,
            Ok(Err(_)) | Err(_) => true,
        }
    }

    fn swap_with_state(
        &mut self,
        thread: &Thread<I>,
        successor: Successor<I>,
        probation: Probation,
    ) {
        let bytes = self.recorder_bytes;
        let Phase::Open(channel) = &mut self.phase else { return };
        let recorded = |instance| Recorded::new(instance, bytes);
        let spare = successor
            .spare
            .map(|Spare { instance, accepts }| Spare { instance: recorded(instance), accepts });
        let on_probation = spare.is_some();
        let successor = Successor {
            instance: recorded(successor.instance),
            settings: successor.settings,
            accepts: successor.accepts,
            spare,
        };
        let before = self.clock.now();
        let swapped = channel
            .ask(before, &mut self.host, |link, now, host| link.swap_to(now, successor, host));
        let pause = self.clock.now() - before;
        match swapped {
            Ok(Ok(old)) => {
                thread.opener.bury(Box::new(old));
                self.swapping.trial =
                    on_probation.then_some((probation.events, self.clock.now() + probation.span));
                self.tell_done(pause, true);
                self.tell_reverted(thread);
            }
            Ok(Err(error)) => {
                self.refuse_swap(sentence(&error));
                if let SwapError::Save(fault) | SwapError::Failed(fault) = error {
                    self.plugin_failed(&fault);
                }
            }
            Err(error) => self.port_failed(thread, &error),
        }
    }

    fn tell_done(&mut self, pause: Micros, with_state: bool) {
        let on_probation = self.swapping.trial.is_some();
        let done = SwapReport::Done { pause, with_state, on_probation };
        self.host.tell(Report::Swapped(done));
    }

    fn begin_quiet(&mut self) {
        let Phase::Open(channel) = &self.phase else { return };
        let now = self.clock.now();
        let bytes_in = channel.counters(now).bytes_in;
        if bytes_in != self.swapping.quiet.0 {
            self.swapping.quiet = (bytes_in, now);
        }
    }

    /// Swaps if nothing is under way; `false`: not yet.
    fn swap_if_idle(&mut self, thread: &Thread<I>) -> bool {
        let now = self.clock.now();
        let Phase::Open(channel) = &self.phase else { return false };
        let link = channel.link();
        let is_quiet = link.poll_timeout().is_none() || now >= self.swapping.quiet.1 + QUIET;
        if self.is_faulted || !link.is_idle() || channel.is_sending(now) || !is_quiet {
            return false;
        }
        let Some(swap) = self.swapping.waiting.take() else { return false };
        if self.can_carry_over(&swap.successor.accepts) {
            self.swap_with_state(thread, swap.successor, swap.probation);
        } else {
            self.swap_as_new(thread, *swap);
        }
        true
    }

    /// The successor begins as new. There is no probation: nothing that the plug-in
    /// before could go on with.
    fn swap_as_new(&mut self, thread: &Thread<I>, swap: Swap<I>) {
        let before = self.clock.now();
        let Successor { instance, settings, .. } = swap.successor;
        let put = self.put(thread, instance, settings);
        let pause = self.clock.now() - before;
        match put {
            Ok(()) => self.tell_done(pause, false),
            Err(error) => {
                self.refuse_swap(error.to_string());
                self.failed(thread, error);
            }
        }
    }

    fn tell_reverted(&mut self, thread: &Thread<I>) {
        let Phase::Open(channel) = &mut self.phase else { return };
        let Some(reverted) = channel.link_mut().take_reverted() else { return };
        self.swapping.trial = None;
        let recording = recording_of(&reverted.failed, &reverted.taken_over_with);
        let words = reverted.failed.last_words().map(str::to_owned);
        let mut fault = fault_of(&reverted.fault, words, recording);
        // A save that fails is told as what it is; the event came before it.
        fault.event = Some(reverted.event);
        fault.on_probation = true;
        thread.opener.bury(Box::new(reverted.failed));
        self.host.tell(Report::Swapped(SwapReport::Reverted(Box::new(fault))));
    }
}
