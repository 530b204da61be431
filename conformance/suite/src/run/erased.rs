//! Any plug-in's instances as one type, so that scenarios are plain functions.

use super::subject::{Fuel, Subject, SubjectError};
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, Instance, Micros, Output};
use std::error::Error;

/// A subject whatever its instances are.
pub(crate) trait Starts {
    fn start(&self) -> Result<Erased<'_>, SubjectError>;

    fn manifest(&self) -> &Manifest;

    fn label(&self) -> &str;
}

impl<S: Subject> Starts for S {
    fn start(&self) -> Result<Erased<'_>, SubjectError> {
        Ok(Erased(Box::new(Kept { instance: self.instantiate()?, fuel: S::fuel })))
    }

    fn manifest(&self) -> &Manifest {
        Subject::manifest(self)
    }

    fn label(&self) -> &str {
        Subject::label(self)
    }
}

/// The subject of a script.
#[derive(Copy, Clone)]
pub(crate) struct Anything<'a>(pub(crate) &'a dyn Starts);

impl<'a> Subject for Anything<'a> {
    type Instance = Erased<'a>;

    fn instantiate(&self) -> Result<Erased<'a>, SubjectError> {
        self.0.start()
    }

    fn manifest(&self) -> &Manifest {
        self.0.manifest()
    }

    fn label(&self) -> &str {
        self.0.label()
    }

    fn fuel(instance: &Erased<'a>) -> Fuel {
        instance.0.fuel()
    }
}

/// What an instance says when it does not take an event.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub(crate) struct Boxed(pub(crate) Box<dyn Error>);

/// An instance of any plug-in.
pub(crate) struct Erased<'a>(Box<dyn Steps + 'a>);

trait Steps {
    fn capacity(&self) -> usize;

    fn take(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Boxed>;

    fn fuel(&self) -> Fuel;
}

struct Kept<I> {
    instance: I,
    fuel: fn(&I) -> Fuel,
}

impl<I: Instance> Steps for Kept<I> {
    fn capacity(&self) -> usize {
        self.instance.input_capacity()
    }

    fn take(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Boxed> {
        self.instance.step(event, now).map_err(|fault| Boxed(Box::new(fault)))
    }

    fn fuel(&self) -> Fuel {
        (self.fuel)(&self.instance)
    }
}

impl Instance for Erased<'_> {
    type Fault = Boxed;

    fn input_capacity(&self) -> usize {
        self.0.capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Boxed> {
        self.0.take(event, now)
    }
}

impl std::fmt::Debug for Erased<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Erased")
    }
}
