//! A plug-in that is asked for its state after every event.

use crate::run::erased::{Anything, Boxed, Erased};
use crate::run::subject::{Subject, SubjectError};
use softplug_abi::limits::OUTPUT_ROUNDS;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, EventKind, Instance, Micros, Output};

/// The subject whose instances are asked.
pub(super) struct Saving<'a>(pub(super) Anything<'a>);

/// One of them.
pub(super) struct Asked<'a> {
    inner: Erased<'a>,
    actions: Vec<u8>,
    is_open: bool,
}

impl<'a> Subject for Saving<'a> {
    type Instance = Asked<'a>;

    fn instantiate(&self) -> Result<Asked<'a>, SubjectError> {
        Ok(Asked { inner: self.0.instantiate()?, actions: Vec::new(), is_open: false })
    }

    fn manifest(&self) -> &Manifest {
        Subject::manifest(&self.0)
    }

    fn label(&self) -> &str {
        Subject::label(&self.0)
    }
}

impl Instance for Asked<'_> {
    type Fault = Boxed;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Boxed> {
        let output = self.inner.step(event, now)?;
        let more = output.more;
        self.actions.clear();
        self.actions.extend_from_slice(output.actions);
        match event.kind() {
            EventKind::Open => self.is_open = true,
            EventKind::Close => self.is_open = false,
            _ => {}
        }
        if self.is_open && !more {
            self.save(now)?;
        }
        Ok(Output { actions: &self.actions, more })
    }
}

impl Asked<'_> {
    /// What comes is thrown away.
    fn save(&mut self, now: Micros) -> Result<(), Boxed> {
        let mut more = self.inner.step(&Event::Save, now)?.more;
        for _ in 0..OUTPUT_ROUNDS {
            if !more {
                break;
            }
            more = self.inner.step(&Event::Continue, now)?.more;
        }
        Ok(())
    }
}
