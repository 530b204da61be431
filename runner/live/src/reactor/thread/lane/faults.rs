//! A lane's plug-in: at fault, and replaced.

use softplug_abi::manifest::SettingValues;
use softplug_abi::{EventKind, Instance};
use softplug_link::LinkFault;
use std::error::Error;
use std::fmt::Write as _;

use super::{Lane, Phase};
use crate::channel::ChannelError;
use crate::reactor::LaneInstance;
use crate::reactor::fault::LaneFault;
use crate::reactor::report::Report;
use crate::reactor::thread::Thread;
use crate::recorder::{Recorded, Recording, checkpoint, recording};

impl<I: LaneInstance> Lane<I> {
    /// The channel could not go on.
    pub(super) fn failed(&mut self, thread: &Thread<I>, error: ChannelError<I::Fault>) {
        match error {
            ChannelError::Port(error) => self.port_failed(thread, &error),
            ChannelError::Plugin(fault) => self.plugin_failed(&fault),
        }
    }

    pub(super) fn plugin_failed(&mut self, fault: &LinkFault<I::Fault>) {
        self.fault(event_of(fault), sentence(fault));
    }

    /// Somebody ends the plug-in. It is not asked: it may be what cannot be stopped otherwise.
    pub(super) fn halt(&mut self, why: String) {
        self.fault(None, why);
    }

    fn fault(&mut self, event: Option<EventKind>, sentence: String) {
        if std::mem::replace(&mut self.is_faulted, true) {
            return;
        }
        let (last_words, recording) = match &self.phase {
            Phase::Open(channel) => {
                let link = channel.link();
                (link.instance().last_words().map(str::to_owned), recording(link))
            }
            Phase::New(_) => (None, Recording::default()),
        };
        let on_probation = self.swapping.ends();
        let fault = LaneFault { event, sentence, last_words, recording, on_probation };
        self.host.tell(Report::Fault(Box::new(fault)));
    }

    /// What the plug-in did in this turn that ends it or its job.
    pub(super) fn look_after_plugin(&mut self, thread: &Thread<I>) {
        if self.host.has_flooded && !self.is_faulted {
            self.ask(thread, |link, now, host| link.close(now, host));
            self.fault(None, "the plug-in tells more than anybody can take in".to_owned());
        }
        self.abort_without_source(thread);
        if let Phase::Open(channel) = &self.phase
            && channel.link().instance().wants_checkpoint()
        {
            self.ask(thread, checkpoint);
        }
    }

    /// Another plug-in on the same port, after a fault.
    pub(super) fn replace(&mut self, thread: &Thread<I>, instance: I, settings: SettingValues) {
        if let Phase::New(Some(made)) = &mut self.phase {
            let (made, options) = &mut **made;
            *made = Recorded::new(instance, self.recorder_bytes);
            options.settings = settings;
            self.is_faulted = false;
            return;
        }
        self.host.own.restarts += 1;
        match self.put(thread, instance, settings) {
            Ok(()) => self.host.tell(Report::Up),
            Err(error) => self.failed(thread, error),
        }
    }

    /// Puts a plug-in in place, as new.
    pub(super) fn put(
        &mut self,
        thread: &Thread<I>,
        instance: I,
        settings: SettingValues,
    ) -> Result<(), ChannelError<I::Fault>> {
        let Phase::Open(channel) = &mut self.phase else { return Ok(()) };
        self.is_faulted = false;
        self.swapping.ends();
        self.host.has_flooded = false;
        let instance = Recorded::new(instance, self.recorder_bytes);
        let old = channel.replace(self.clock.now(), instance, settings, &mut self.host)?;
        thread.opener.bury(Box::new(old));
        Ok(())
    }
}

/// What is told of a plug-in's fault.
pub(super) fn fault_of<F: Error + 'static>(
    fault: &LinkFault<F>,
    last_words: Option<String>,
    recording: Recording,
) -> LaneFault {
    let (event, sentence) = (event_of(fault), sentence(fault));
    LaneFault { event, sentence, last_words, recording, on_probation: false }
}

/// The event of a fault.
fn event_of<F: Error>(fault: &LinkFault<F>) -> Option<EventKind> {
    match fault {
        LinkFault::Instance { event, .. }
        | LinkFault::Malformed { event, .. }
        | LinkFault::Rule { event, .. } => Some(*event),
        LinkFault::Ended => None,
    }
}

/// An error with all that caused it, which it does not say itself.
pub(super) fn sentence(error: &dyn Error) -> String {
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
