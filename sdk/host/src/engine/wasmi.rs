//! The wasmi engine: an interpreter, with the limits and the costs of the compiler.

use super::{
    Compiled, EngineError, EngineInfo, NotLoaded, Origin, Running, StartError, Stepped, Stop,
    weights,
};
use crate::Digest;
use softplug_abi::wire::NoSpace;
use softplug_abi::{EXPORT_MAILBOX, EXPORT_MEMORY, EXPORT_STEP, Event, Micros};
use std::ops::Range;
use wasmi::{
    CompilationMode, Config, Engine, Error, Instance, Linker, Memory, Module, OperatorCost, Store,
    TrapCode, TypedFunc, Val, ValType,
};

/// A test holds this against the lock file.
const VERSION: &str = "2.0.0";

/// Calls within calls that a plug-in may make. Past it: a trap. The compiler's
/// stack of 256 KiB holds no more frames than this.
const CALL_DEPTH: usize = 16 * 1024;

/// Most bytes of all values of these calls. Past it: a trap. The interpreter takes more
/// for the same call than the compiler, which keeps values in registers.
const STACK_BYTES: usize = 1024 * 1024;

/// wasmi with all that an embedding of the ABI needs, and no more.
pub(crate) struct Wasmi {
    engine: Engine,
}

impl Wasmi {
    pub(crate) fn new() -> Self {
        let mut config = Config::default();
        // What the lint lets through: the first version of WebAssembly.
        config
            .wasm_multi_value(false)
            .wasm_multi_memory(false)
            .wasm_saturating_float_to_int(false)
            .wasm_sign_extension(false)
            .wasm_bulk_memory(false)
            .wasm_reference_types(false)
            .wasm_tail_call(false)
            .wasm_extended_const(false)
            .allow_start_fn(false)
            .ignore_custom_sections(true)
            // Translating at the first call would cost that call its fuel.
            .compilation_mode(CompilationMode::Eager)
            .consume_fuel(true)
            .operator_cost(costs())
            .set_max_recursion_depth(CALL_DEPTH)
            .set_max_stack_height(STACK_BYTES);
        Self { engine: Engine::new(&config) }
    }
}

fn costs() -> OperatorCost {
    use weights::{CALL_INDIRECT, DIVISION, MEMORY_GROW};
    OperatorCost {
        memory_grow: MEMORY_GROW,
        call_indirect: CALL_INDIRECT,
        i32_div_s: DIVISION,
        i32_div_u: DIVISION,
        i32_rem_s: DIVISION,
        i32_rem_u: DIVISION,
        i64_div_s: DIVISION,
        i64_div_u: DIVISION,
        i64_rem_s: DIVISION,
        i64_rem_u: DIVISION,
        f32_div: DIVISION,
        f64_div: DIVISION,
        f32_sqrt: DIVISION,
        f64_sqrt: DIVISION,
        ..OperatorCost::default()
    }
}

impl super::Engine for Wasmi {
    fn info(&self) -> EngineInfo {
        EngineInfo { name: "wasmi", version: VERSION }
    }

    fn load(&self, wasm: &[u8], _: Digest) -> Result<(Box<dyn Compiled>, Origin), NotLoaded> {
        let module = Module::new(&self.engine, wasm).map_err(engine_error)?;
        Ok((Box::new(Ready { module }), Origin::Compiled))
    }
}

struct Ready {
    module: Module,
}

impl Compiled for Ready {
    fn instantiate(&self) -> Result<Box<dyn Running>, StartError> {
        let engine = self.module.engine();
        let mut store = Store::new(engine, ());
        let instance = Linker::new(engine)
            .instantiate_and_start(&mut store, &self.module)
            .map_err(|error| StartError::Other(error.to_string()))?;
        let missing = |what: &str| StartError::Other(format!("the export \"{what}\" is not there"));
        let memory =
            instance.get_memory(&store, EXPORT_MEMORY).ok_or_else(|| missing(EXPORT_MEMORY))?;
        let mailbox =
            instance.get_typed_func(&store, EXPORT_MAILBOX).map_err(|_| missing(EXPORT_MAILBOX))?;
        let step =
            instance.get_typed_func(&store, EXPORT_STEP).map_err(|_| missing(EXPORT_STEP))?;
        Ok(Box::new(Live { store, instance, memory, mailbox, step }))
    }
}

struct Live {
    store: Store<()>,
    instance: Instance,
    memory: Memory,
    mailbox: TypedFunc<(), i32>,
    step: TypedFunc<(i32, i32, i64), i32>,
}

impl Live {
    fn refuel(&mut self, fuel: u64) {
        self.store.set_fuel(fuel).expect("the engine consumes fuel");
    }

    #[cold]
    fn stop(&mut self, error: &Error) -> Stop {
        let reason = match error.as_trap_code() {
            Some(TrapCode::OutOfFuel) => {
                // Fuel is taken for a stretch of code at once, so that some may be
                // left that was not enough: it is gone all the same.
                self.refuel(0);
                return Stop::OutOfFuel;
            }
            Some(TrapCode::IndirectCallToNull) => "uninitialized element".to_owned(),
            Some(code) => code.trap_message().to_owned(),
            None => error.to_string(),
        };
        Stop::Trap { reason, frames: Vec::new() }
    }
}

impl Running for Live {
    fn mailbox(&mut self, fuel: u64) -> Result<u32, Stop> {
        self.refuel(fuel);
        match self.mailbox.call(&mut self.store, ()) {
            Ok(address) => Ok(address as u32),
            Err(error) => Err(self.stop(&error)),
        }
    }

    fn step(
        &mut self,
        event: &Event<'_>,
        input: Range<usize>,
        now: Micros,
        fuel: u64,
    ) -> Result<Stepped<'_>, NoSpace> {
        let length = event.encode(&mut self.memory.data_mut(&mut self.store)[input])?;
        self.refuel(fuel);
        let arguments = (i32::from(event.kind().code()), length as i32, now.0);
        let result = self.step.call(&mut self.store, arguments);
        let result = result.map_err(|error| Box::new(self.stop(&error)));
        let left = self.store.get_fuel().expect("the engine consumes fuel");
        let fuel_used = fuel.saturating_sub(left);
        Ok(Stepped { result, fuel_used, memory: self.memory.data_mut(&mut self.store) })
    }

    fn global(&mut self, name: &str) -> Option<i64> {
        match self.instance.get_global(&self.store, name)?.get(&self.store) {
            Val::I64(value) => Some(value),
            Val::I32(value) => Some(i64::from(value)),
            _ => None,
        }
    }

    fn set_global(&mut self, name: &str, value: i64) -> bool {
        let Some(global) = self.instance.get_global(&self.store, name) else { return false };
        let value = match global.ty(&self.store).content() {
            ValType::I64 => Val::I64(value),
            ValType::I32 => Val::I32(value as i32),
            _ => return false,
        };
        global.set(&mut self.store, value).is_ok()
    }

    fn memory(&self) -> &[u8] {
        self.memory.data(&self.store)
    }

    fn memory_mut(&mut self) -> &mut [u8] {
        self.memory.data_mut(&mut self.store)
    }
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn engine_error(error: Error) -> EngineError {
    EngineError(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_the_one_in_the_lock_file() {
        let lock = include_str!("../../../../Cargo.lock").replace("\r\n", "\n");
        assert!(lock.contains(&format!("name = \"wasmi\"\nversion = \"{VERSION}\"\n")));
    }
}
