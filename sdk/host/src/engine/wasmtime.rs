//! The wasmtime engine: pool and calls.

use super::cache::{Cache, CacheKey};
use super::code::{INFO, engine_error, key, on_demand, pooled};
use super::compiler::{self, CompilerProcess};
use super::{
    Compiled, EngineError, EngineInfo, NotLoaded, Origin, Running, StartError, Stepped, Stop,
    precompiled,
};
use crate::{Digest, words};
use softplug_abi::wire::NoSpace;
use softplug_abi::{EXPORT_MAILBOX, EXPORT_MEMORY, EXPORT_STEP, Event, Micros};
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use wasmtime::{
    Engine, Instance, InstancePre, Linker, Memory, Module, PoolConcurrencyLimitError, Store, Trap,
    TypedFunc, Val, ValType, WasmBacktrace,
};

/// Innermost frames that a fault names.
const FRAMES: usize = 8;

/// wasmtime with all that an embedding of the ABI needs, and no more.
pub(crate) struct Wasmtime {
    engine: Engine,
    /// Instances come from a pool, which the code has to fit.
    is_pooled: bool,
    cache: Option<Cache>,
    compiler: Option<CompilerProcess>,
    has_stopped_compiling: AtomicBool,
    instances: u32,
}

impl Wasmtime {
    /// An engine with a pool for `instances`; without one where the address
    /// space is too small for it. Compiled code is kept in the folder `cache`.
    pub(crate) fn new(
        instances: u32,
        cache: Option<&Path>,
        compiler: Option<CompilerProcess>,
    ) -> Result<Self, EngineError> {
        let (engine, is_pooled) = match Engine::new(&pooled(instances)) {
            Ok(engine) => (engine, true),
            Err(error) => {
                tracing::info!(%error, "no address space for a pool of instances, going on without");
                (Engine::new(&on_demand()).map_err(engine_error)?, false)
            }
        };
        let cache = cache.and_then(Cache::open);
        let has_stopped_compiling = AtomicBool::new(false);
        Ok(Self { engine, is_pooled, cache, compiler, has_stopped_compiling, instances })
    }

    /// The module, from the cache if it is there.
    fn module(&self, wasm: &[u8], digest: Digest) -> Result<(Module, Origin), NotLoaded> {
        let key = key(&self.engine, digest);
        if let Some(code) = self.cache.as_ref().and_then(|cache| cache.read(key)) {
            match precompiled::load(&self.engine, &code) {
                Ok(module) => return Ok((module, Origin::Cache)),
                Err(error) => {
                    tracing::warn!(%error, "the engine does not take its own code, compiling anew");
                }
            }
        }
        let module = match &self.compiler {
            Some(compiler) => self.compiled_by(compiler, wasm, key)?,
            None => self.compiled_here(wasm, key)?,
        };
        Ok((module, Origin::Compiled))
    }

    fn compiled_here(&self, wasm: &[u8], key: CacheKey) -> Result<Module, NotLoaded> {
        let module = Module::from_binary(&self.engine, wasm).map_err(engine_error)?;
        if let Some(cache) = &self.cache {
            match module.serialize() {
                Ok(code) => cache.write(key, &code),
                Err(error) => tracing::warn!(%error, "the code cannot be kept"),
            }
        }
        Ok(module)
    }

    fn compiled_by(
        &self,
        compiler: &CompilerProcess,
        wasm: &[u8],
        key: CacheKey,
    ) -> Result<Module, NotLoaded> {
        let broken_off = &self.has_stopped_compiling;
        let code = compiler::compile(compiler, wasm, self.is_pooled, key, broken_off)
            .map_err(NotLoaded::Apart)?;
        let module = precompiled::load(&self.engine, &code).map_err(engine_error)?;
        if let Some(cache) = &self.cache {
            cache.keep(key, &code);
        }
        Ok(module)
    }
}

impl super::Engine for Wasmtime {
    fn info(&self) -> EngineInfo {
        INFO
    }

    fn load(&self, wasm: &[u8], digest: Digest) -> Result<(Box<dyn Compiled>, Origin), NotLoaded> {
        let (module, origin) = self.module(wasm, digest)?;
        let pre = Linker::new(&self.engine).instantiate_pre(&module).map_err(engine_error)?;
        Ok((Box::new(Ready { pre, instances: self.instances }), origin))
    }

    fn stop_compiling(&self) {
        self.has_stopped_compiling.store(true, Ordering::Relaxed);
    }
}

struct Ready {
    pre: InstancePre<()>,
    /// The most of them at one time.
    instances: u32,
}

impl Compiled for Ready {
    fn instantiate(&self) -> Result<Box<dyn Running>, StartError> {
        let mut store = Store::new(self.pre.module().engine(), ());
        // A plug-in has no start function. Where memory cannot be mapped as an image, its data is
        // put there by code that the engine makes, which takes fuel; its length bounds it.
        store.set_fuel(u64::MAX).expect("the engine consumes fuel");
        let instance = self.pre.instantiate(&mut store).map_err(|error| {
            if error.is::<PoolConcurrencyLimitError>() {
                return StartError::PoolExhausted { limit: self.instances };
            }
            StartError::Other(text_of(&error))
        })?;
        let missing = |what: &str| StartError::Other(format!("the export \"{what}\" is not there"));
        let memory =
            instance.get_memory(&mut store, EXPORT_MEMORY).ok_or_else(|| missing(EXPORT_MEMORY))?;
        let mailbox = instance
            .get_typed_func(&mut store, EXPORT_MAILBOX)
            .map_err(|_| missing(EXPORT_MAILBOX))?;
        let step =
            instance.get_typed_func(&mut store, EXPORT_STEP).map_err(|_| missing(EXPORT_STEP))?;
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
}

impl Running for Live {
    fn mailbox(&mut self, fuel: u64) -> Result<u32, Stop> {
        self.refuel(fuel);
        let address = self.mailbox.call(&mut self.store, ()).map_err(|error| stop(&error))?;
        Ok(address as u32)
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
        let result = result.map_err(|error| Box::new(stop(&error)));
        let left = self.store.get_fuel().expect("the engine consumes fuel");
        let fuel_used = fuel.saturating_sub(left);
        Ok(Stepped { result, fuel_used, memory: self.memory.data_mut(&mut self.store) })
    }

    fn global(&mut self, name: &str) -> Option<i64> {
        match self.instance.get_global(&mut self.store, name)?.get(&mut self.store) {
            Val::I64(value) => Some(value),
            Val::I32(value) => Some(i64::from(value)),
            _ => None,
        }
    }

    fn set_global(&mut self, name: &str, value: i64) -> bool {
        let Some(global) = self.instance.get_global(&mut self.store, name) else { return false };
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

#[cold]
fn stop(error: &wasmtime::Error) -> Stop {
    if error.downcast_ref::<Trap>() == Some(&Trap::OutOfFuel) {
        return Stop::OutOfFuel;
    }
    Stop::Trap { reason: text_of(error), frames: frames_of(error) }
}

/// The engine's text, of the trap alone where it is one.
fn text_of(error: &wasmtime::Error) -> String {
    let text = match error.downcast_ref::<Trap>() {
        Some(trap) => trap.to_string(),
        None => format!("{error:#}"),
    };
    text.strip_prefix("wasm trap: ").unwrap_or(&text).to_owned()
}

/// The module's own names: it may have put anything into them.
fn frames_of(error: &wasmtime::Error) -> Vec<String> {
    let Some(backtrace) = error.downcast_ref::<WasmBacktrace>() else { return Vec::new() };
    let name = |frame: &wasmtime::FrameInfo| match frame.func_name() {
        Some(name) => words::printable(name.as_bytes()),
        None => format!("function {}", frame.func_index()),
    };
    backtrace.frames().iter().take(FRAMES).map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::super::cache::VerifiedCode;
    use super::super::code::code_for;
    use super::*;

    #[test]
    fn code_made_apart_has_the_key_of_the_engine_that_runs_it() {
        let wasm = wat::parse_str("(module (func (export \"f\") (result i32) i32.const 1))");
        let wasm = wasm.unwrap();
        for instances in [64, 100_000] {
            let engine = Wasmtime::new(instances, None, None).unwrap();
            let key = key(&engine.engine, Digest::of(&wasm));
            let file = code_for(&wasm, engine.is_pooled).unwrap();
            let code = VerifiedCode::received(file, key).unwrap();
            assert!(precompiled::load(&engine.engine, &code).is_ok());
            let other = code_for(&wasm, !engine.is_pooled).unwrap();
            assert!(VerifiedCode::received(other, key).is_err());
        }
    }

    #[test]
    fn a_pool_that_does_not_fit_falls_back_to_none() {
        // 100,000 reservations of 4 GiB are more than 47 bits can address.
        assert!(Engine::new(&pooled(100_000)).is_err());
        let engine = Wasmtime::new(100_000, None, None).unwrap();
        assert!(Module::new(&engine.engine, b"\0asm\x01\0\0\0").is_ok());
    }
}
