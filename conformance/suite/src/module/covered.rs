//! A plug-in that is judged while a copy of it says what it executes.

use super::executed::{Executed, WatchedSession, Watcher};
use crate::run::subject::{Fuel, Sandboxed, Subject, SubjectError};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, Instance, Micros, Output};
use softplug_host::{Session, SessionFault};

/// Each event goes to both. What counts is what the plug-in does; of its copy nothing is asked
/// but what it has executed. So whatever gives the events, a model and a link, works once.
pub(crate) struct Covered {
    judged: Sandboxed,
    watcher: Option<Watcher>,
}

impl Covered {
    /// Without a copy nothing is found out.
    pub(crate) fn new(judged: &Sandboxed, watcher: Option<Watcher>) -> Self {
        Self { judged: judged.clone(), watcher }
    }

    /// What was executed since it was asked last.
    pub(crate) fn take(&self) -> Executed {
        self.watcher.as_ref().map(Watcher::take).unwrap_or_default()
    }
}

impl Subject for Covered {
    type Instance = CoveredSession;

    fn instantiate(&self) -> Result<CoveredSession, SubjectError> {
        let copy = self.watcher.as_ref().map(Watcher::instantiate).transpose()?;
        Ok(CoveredSession { judged: self.judged.instantiate()?, copy })
    }

    fn manifest(&self) -> &Manifest {
        self.judged.manifest()
    }

    fn label(&self) -> &str {
        self.judged.label()
    }

    fn fuel(instance: &CoveredSession) -> Fuel {
        Sandboxed::fuel(&instance.judged)
    }
}

/// An instance and its copy.
pub(crate) struct CoveredSession {
    judged: Session,
    copy: Option<WatchedSession>,
}

impl Instance for CoveredSession {
    type Fault = SessionFault;

    fn input_capacity(&self) -> usize {
        self.judged.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, SessionFault> {
        // What the copy answers, or fails by, is nobody's business.
        let _ = self.copy.as_mut().map(|copy| copy.step(event, now));
        self.judged.step(event, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::executed::Places;
    use softplug_abi::{LineParameters, Parity};
    use softplug_host::{Host, HostOptions, lint};

    /// What an echo with room for one byte answers to two, and its fuel.
    fn run<S: Subject>(subject: &S) -> (Vec<Vec<u8>>, Fuel) {
        let mut instance = subject.instantiate().unwrap();
        let line =
            LineParameters { baud: 9_600, data_bits: 8, parity: Parity::None, stop_half_bits: 2 };
        let (transmit_room, delivery_room) = (1, 1);
        let open = Event::Open { resumed: false, line, transmit_room, delivery_room };
        let events = [open, Event::Received(b"a"), Event::Received(b"b")];
        let answers = events.iter().map(|event| {
            let Ok(output) = instance.step(event, Micros::ZERO) else { panic!("it takes all") };
            output.actions.to_vec()
        });
        let answers = answers.collect();
        (answers, S::fuel(&instance))
    }

    #[test]
    fn the_copy_executes_what_the_plug_in_does_and_changes_nothing_of_it() {
        let module = wat::parse_file("../../fixtures/abi/echo.wat").unwrap();
        let host = Host::new(HostOptions::default()).unwrap();
        let judged = Sandboxed::new(host.load_bytes(&module).unwrap());
        let places = Places::of(&module).unwrap();
        let watcher = places.watch(&host, &module, &lint(&module).unwrap()).unwrap();
        let covered = Covered::new(&judged, Some(watcher.another()));
        assert_eq!(run(&covered), run(&judged));
        assert_eq!(run(&watcher).0, run(&judged).0);
        let executed = watcher.take();
        assert_ne!(executed, Executed::default());
        assert_eq!(covered.take(), executed);
        let unwatched = Covered::new(&judged, None);
        assert_eq!(run(&unwatched), run(&judged));
        assert_eq!(unwatched.take(), Executed::default());
    }
}
