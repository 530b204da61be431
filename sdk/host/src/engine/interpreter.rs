//! The interpreter of units without an operating system, behind the engines' interface.

use super::{
    Compiled, EngineError, EngineInfo, NotLoaded, Origin, Running, StartError, Stepped, Stop,
};
use crate::Digest;
use softplug_abi::manifest::Manifest;
use softplug_abi::wire::NoSpace;
use softplug_abi::{EXPORT_MAILBOX, EXPORT_STEP, Event, MANIFEST_SECTION, Micros};
use softplug_interpreter::{Function, Machine, Module, Room, Trap};
use std::ops::Range;
use std::sync::Arc;

/// As much as the other interpreter has: 1 MiB of values, 16,384 calls.
const ROOM: Room = Room { memory_bytes: u32::MAX, stack_slots: 128 * 1024, call_depth: 16 * 1024 };

pub(crate) struct Interpreter;

impl super::Engine for Interpreter {
    fn info(&self) -> EngineInfo {
        EngineInfo { name: "softplug-interpreter", version: env!("CARGO_PKG_VERSION") }
    }

    fn load(&self, wasm: &[u8], _: Digest) -> Result<(Box<dyn Compiled>, Origin), NotLoaded> {
        let module = Module::load(wasm.to_vec()).map_err(|error| EngineError(error.to_string()))?;
        // The lint has read it; a module that is instrumented has it, too.
        let manifest = module.custom_section(MANIFEST_SECTION).map(Manifest::parse);
        let used = manifest.and_then(|manifest| manifest.ok()?.memory_bytes);
        let room = Room { memory_bytes: used.unwrap_or(u32::MAX), ..ROOM };
        Ok((Box::new(Ready { module: Arc::new(module), room }), Origin::Compiled))
    }
}

struct Ready {
    module: Arc<Module<Vec<u8>>>,
    /// No more memory than the manifest says: what traps above it on a unit traps here.
    room: Room,
}

impl Compiled for Ready {
    fn instantiate(&self) -> Result<Box<dyn Running>, StartError> {
        let function = |name: &str| {
            let missing = || StartError::Other(format!("the export \"{name}\" is not there"));
            self.module.exported_function(name).ok_or_else(missing)
        };
        let (mailbox, step) = (function(EXPORT_MAILBOX)?, function(EXPORT_STEP)?);
        let machine = Machine::new(Arc::clone(&self.module), self.room)
            .map_err(|error| StartError::Other(error.to_string()))?;
        Ok(Box::new(Live { machine, mailbox, step }))
    }
}

struct Live {
    machine: Machine<Vec<u8>>,
    mailbox: Function,
    step: Function,
}

impl Live {
    /// The result and the fuel that was used. A budget over 4,294,967,295 units counts as that.
    fn call(
        &mut self,
        function: Function,
        arguments: &[u64],
        fuel: u64,
    ) -> (Result<i32, Stop>, u64) {
        let given = u32::try_from(fuel).unwrap_or(u32::MAX);
        let mut left = given;
        let result = match self.machine.call(function, arguments, &mut left) {
            // The lint has seen that both give an `i32`.
            Ok(bits) => Ok(bits.unwrap_or_default() as u32 as i32),
            Err(Trap::OutOfFuel) => return (Err(Stop::OutOfFuel), fuel),
            Err(trap) => Err(Stop::Trap { reason: trap.to_string(), frames: Vec::new() }),
        };
        (result, u64::from(given - left))
    }
}

impl Running for Live {
    fn mailbox(&mut self, fuel: u64) -> Result<u32, Stop> {
        self.call(self.mailbox, &[], fuel).0.map(|address| address as u32)
    }

    fn step(
        &mut self,
        event: &Event<'_>,
        input: Range<usize>,
        now: Micros,
        fuel: u64,
    ) -> Result<Stepped<'_>, NoSpace> {
        let length = event.encode(&mut self.machine.memory_mut()[input])?;
        let arguments = [u64::from(event.kind().code()), length as u64, now.0 as u64];
        let (result, fuel_used) = self.call(self.step, &arguments, fuel);
        let result = result.map_err(Box::new);
        Ok(Stepped { result, fuel_used, memory: self.machine.memory_mut() })
    }

    fn global(&mut self, name: &str) -> Option<i64> {
        self.machine.global(name)
    }

    fn set_global(&mut self, name: &str, value: i64) -> bool {
        self.machine.set_global(name, value)
    }

    fn memory(&self) -> &[u8] {
        self.machine.memory()
    }

    fn memory_mut(&mut self) -> &mut [u8] {
        self.machine.memory_mut()
    }
}
