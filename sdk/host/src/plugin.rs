//! A plug-in that was checked and compiled: the mould for sessions.

use crate::engine::{Compiled, Running, StartError, Stop};
use crate::session::Session;
use crate::{Digest, HostOptions, Inspection, LoadError};
use softplug_abi::Mailbox;
use softplug_abi::manifest::Manifest;
use std::sync::Arc;

/// Where a plug-in's code came from.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Origin {
    /// It was compiled at this load.
    Compiled,
    /// It was in the cache.
    Cache,
}

/// A compiled plug-in. Clones share the code.
#[derive(Clone)]
pub struct Plugin {
    inner: Arc<Inner>,
}

struct Inner {
    compiled: Box<dyn Compiled>,
    inspection: Inspection,
    origin: Origin,
    fuel_per_event: u64,
}

impl Plugin {
    pub(crate) fn new(
        compiled: Box<dyn Compiled>,
        inspection: Inspection,
        origin: Origin,
        options: &HostOptions,
    ) -> Self {
        let fuel_per_event = options.fuel_per_event;
        Self { inner: Arc::new(Inner { compiled, inspection, origin, fuel_per_event }) }
    }

    /// What the plug-in says of itself.
    pub fn manifest(&self) -> &Manifest {
        &self.inner.inspection.manifest
    }

    /// SHA-256 of the module.
    pub fn digest(&self) -> Digest {
        self.inner.inspection.digest
    }

    /// What the lint found out.
    pub fn inspection(&self) -> &Inspection {
        &self.inner.inspection
    }

    /// Where the code came from.
    pub fn origin(&self) -> Origin {
        self.inner.origin
    }

    /// A new instance with its own memory. Takes microseconds.
    ///
    /// # Errors
    /// The plug-in cannot be instantiated, or its mailbox is not as the ABI says.
    pub fn instantiate(&self) -> Result<Session, LoadError> {
        let mut running = self.inner.compiled.instantiate().map_err(|error| match error {
            #[cfg(feature = "wasmtime")]
            StartError::PoolExhausted { limit } => LoadError::TooManyInstances { limit },
            StartError::Other(reason) => LoadError::Instantiate { reason },
        })?;
        let mailbox = self.mailbox(running.as_mut())?;
        Ok(Session::new(self.clone(), running, mailbox, self.inner.fuel_per_event))
    }

    fn mailbox(&self, running: &mut dyn Running) -> Result<Mailbox, LoadError> {
        let fuel = self.inner.fuel_per_event;
        let address = running.mailbox(fuel).map_err(|stop| match stop {
            Stop::OutOfFuel => LoadError::BudgetExhausted { fuel },
            Stop::Trap { reason, .. } => LoadError::Trapped { reason },
        })?;
        let memory = running.memory();
        let descriptor = memory
            .get(address as usize..)
            .and_then(<[u8]>::first_chunk)
            .ok_or(LoadError::Descriptor { address })?;
        Ok(Mailbox::decode(*descriptor, memory.len() as u64)?)
    }
}

impl std::fmt::Debug for Plugin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Plugin")
            .field("name", &self.manifest().name)
            .field("digest", &self.digest())
            .finish_non_exhaustive()
    }
}
