//! A plug-in that was checked and compiled: the mould for sessions.

use crate::engine::{Compiled, Running, StartError, Stop};
use crate::{Digest, Inspection, LoadError, Origin};
use softplug_abi::Mailbox;
use softplug_abi::manifest::Manifest;
use std::sync::Arc;

/// A compiled plug-in. Clones share the code.
///
/// ```
/// use softplug_host::{Digest, Host, HostOptions};
///
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// let plugin = Host::new(HostOptions::default())?.load_bytes(&wasm)?;
/// assert_eq!(plugin.manifest().name, "echo");
/// assert_eq!(plugin.digest(), Digest::of(&wasm));
/// assert_eq!(plugin.inspection().memory_pages, 1);
/// // Two links, each with a plug-in of its own.
/// let (left, right) = (plugin.instantiate()?, plugin.instantiate()?);
/// assert_eq!(left.plugin().digest(), right.plugin().digest());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
        fuel_per_event: u64,
    ) -> Self {
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

    /// Units of fuel for one event.
    pub(crate) fn fuel_per_event(&self) -> u64 {
        self.inner.fuel_per_event
    }

    /// A new instance, and where its mailbox is.
    pub(crate) fn start(&self) -> Result<(Box<dyn Running>, Mailbox), LoadError> {
        let mut running = self.inner.compiled.instantiate().map_err(|error| match error {
            #[cfg(feature = "wasmtime")]
            StartError::PoolExhausted { limit } => LoadError::TooManyInstances { limit },
            StartError::Other(reason) => LoadError::Instantiate { reason },
        })?;
        let mailbox = self.mailbox(running.as_mut())?;
        Ok((running, mailbox))
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
