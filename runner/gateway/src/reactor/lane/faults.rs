//! A lane's plug-in: at fault, replaced, swapped.

use softplug_abi::manifest::SettingValues;
use softplug_abi::{EventKind, Instance};
use softplug_link::LinkFault;
use std::error::Error;
use std::fmt::Write as _;

use super::{Lane, Phase};
use crate::channel::ChannelError;
use crate::reactor::report::{LaneFault, Report};
use crate::reactor::swap::{Swap, SwapReport};
use crate::reactor::thread::Thread;

impl<I: Instance + Send + 'static> Lane<I> {
    /// The channel could not go on.
    pub(super) fn failed(&mut self, thread: &Thread<I>, error: ChannelError<I::Fault>) {
        match error {
            ChannelError::Port(error) => self.port_failed(thread, &error),
            ChannelError::Plugin(fault) => self.plugin_failed(&fault),
        }
    }

    pub(super) fn plugin_failed(&mut self, fault: &LinkFault<I::Fault>) {
        let event = match fault {
            LinkFault::Instance { event, .. }
            | LinkFault::Malformed { event, .. }
            | LinkFault::Rule { event, .. } => Some(*event),
            LinkFault::Ended => None,
        };
        self.fault(event, sentence(fault));
    }

    fn fault(&mut self, event: Option<EventKind>, sentence: String) {
        if std::mem::replace(&mut self.is_faulted, true) {
            return;
        }
        let last_words = match &self.phase {
            Phase::Open(channel) => channel.link().instance().last_words().map(str::to_owned),
            Phase::New(_) => None,
        };
        let fault = LaneFault { event, sentence, last_words, recording: Vec::new() };
        self.floor.tell(Report::Fault(Box::new(fault)));
    }

    /// What the plug-in did in this turn that ends it or its job.
    pub(super) fn look_after_plugin(&mut self, thread: &Thread<I>) {
        if self.floor.has_flooded && !self.is_faulted {
            self.ask(thread, |link, now, outside| link.close(now, outside));
            self.fault(None, "the plug-in tells more than anybody can take in".to_owned());
        }
        self.abort_without_source(thread);
    }

    /// Another plug-in on the same port, after a fault.
    pub(super) fn replace(&mut self, thread: &Thread<I>, instance: I, settings: SettingValues) {
        let Phase::Open(channel) = &mut self.phase else {
            if let Phase::New(Some((made, options))) = &mut self.phase {
                *made = instance;
                options.settings = settings;
            }
            return;
        };
        self.is_faulted = false;
        self.floor.has_flooded = false;
        self.floor.own.restarts += 1;
        let replaced = channel.replace(self.clock.now(), instance, settings, &mut self.floor);
        match replaced {
            Ok(()) => self.floor.tell(Report::Up),
            Err(error) => self.failed(thread, error),
        }
    }

    pub(super) fn swap(&mut self, thread: &Thread<I>, swap: Swap<I>) {
        let Phase::Open(channel) = &mut self.phase else {
            let sentence = "the link's port has not been open yet".to_owned();
            return self.floor.tell(Report::Swapped(SwapReport::Refused { sentence }));
        };
        let now = self.clock.now();
        let swapped = channel.ask(now, &mut self.floor, |link, now, outside| {
            link.swap_to(now, swap.successor, outside)
        });
        match swapped {
            Ok(Ok(_old)) => {
                let pause = self.clock.now() - now;
                self.floor.tell(Report::Swapped(SwapReport::Done { pause }));
            }
            Ok(Err(error)) => {
                let sentence = sentence(&error);
                self.floor.tell(Report::Swapped(SwapReport::Refused { sentence }));
            }
            Err(error) => self.port_failed(thread, &error),
        }
    }
}

/// An error with all that caused it, which it does not say itself.
fn sentence(error: &dyn Error) -> String {
    let mut sentence = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        if !sentence.contains(&text) {
            let _ = write!(sentence, ": {text}");
        }
        cause = error.source();
    }
    sentence
}
