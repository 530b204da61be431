//! How wasmtime is set up, and the code that it makes of a module.

use super::cache::{CacheKey, VerifiedCode};
use super::{EngineError, EngineInfo, weights};
use crate::Digest;
use crate::lint::FEATURES;
use softplug_abi::limits::{ELEMENTS, MEMORY_PAGES};
use std::hash::{DefaultHasher, Hash, Hasher};
use wasmtime::{
    Config, Engine, InstanceAllocationStrategy, OperatorCost, PoolingAllocationConfig, WasmFeatures,
};

/// A test holds this against the lock file.
const VERSION: &str = "48.0.8";

pub(super) const INFO: EngineInfo = EngineInfo { name: "wasmtime", version: VERSION };

/// Stack that a plug-in may use beside its own memory. Past it: a trap.
const STACK_BYTES: usize = 256 * 1024;

/// Most bytes of the engine's own bookkeeping for one instance: functions in
/// tables and globals.
const INSTANCE_BYTES: usize = 128 * 1024;

const MEMORY_BYTES: u64 = MEMORY_PAGES * 64 * 1024;

/// The code of a module as a cache file, for an engine with or without a pool. Made on
/// this thread alone.
pub(super) fn code_for(wasm: &[u8], is_pooled: bool) -> Result<Vec<u8>, EngineError> {
    let mut config = if is_pooled { pooled(1) } else { on_demand() };
    let engine = Engine::new(config.parallel_compilation(false)).map_err(engine_error)?;
    let code = engine.precompile_module(wasm).map_err(engine_error)?;
    Ok(VerifiedCode::file_for(key(&engine, Digest::of(wasm)), &code))
}

pub(super) fn key(engine: &Engine, digest: Digest) -> CacheKey {
    CacheKey::new(digest, INFO, settings_hash(engine))
}

/// Two engines whose code can be exchanged give the same number.
fn settings_hash(engine: &Engine) -> u64 {
    let mut hasher = DefaultHasher::new();
    engine.precompile_compatibility_hash().hash(&mut hasher);
    hasher.finish()
}

pub(super) fn pooled(instances: u32) -> Config {
    let mut pool = PoolingAllocationConfig::new();
    pool.total_core_instances(instances)
        .total_memories(instances)
        .total_tables(instances)
        .max_core_instance_size(INSTANCE_BYTES)
        .max_tables_per_module(1)
        .table_elements(ELEMENTS as usize)
        .max_memories_per_module(1)
        .max_memory_size(MEMORY_BYTES as usize)
        // What an instance leaves is overwritten: to unmap it, and to map it for the next one,
        // took a quarter of a certification's time.
        .linear_memory_keep_resident(64 * 1024)
        .table_keep_resident(64 * 1024);
    let mut config = common();
    config.memory_init_cow(false).allocation_strategy(InstanceAllocationStrategy::Pooling(pool));
    config
}

/// With small reservations: each access is checked in code instead of by the
/// processor's page tables.
pub(super) fn on_demand() -> Config {
    let mut config = common();
    config
        .allocation_strategy(InstanceAllocationStrategy::OnDemand)
        .memory_reservation(MEMORY_BYTES)
        .memory_reservation_for_growth(0)
        .memory_guard_size(64 * 1024);
    config
}

fn common() -> Config {
    let mut config = Config::new();
    config
        .consume_fuel(true)
        .operator_cost(costs())
        .cranelift_nan_canonicalization(true)
        .max_wasm_stack(STACK_BYTES)
        .memory_may_move(false)
        .concurrency_support(false)
        .wasm_features(WasmFeatures::all().difference(FEATURES), false)
        .wasm_features(FEATURES, true);
    config
}

fn costs() -> OperatorCost {
    use weights::{CALL_INDIRECT, DIVISION, MEMORY_GROW};
    OperatorCost {
        MemoryGrow: MEMORY_GROW,
        CallIndirect: CALL_INDIRECT,
        I32DivS: DIVISION,
        I32DivU: DIVISION,
        I32RemS: DIVISION,
        I32RemU: DIVISION,
        I64DivS: DIVISION,
        I64DivU: DIVISION,
        I64RemS: DIVISION,
        I64RemU: DIVISION,
        F32Div: DIVISION,
        F64Div: DIVISION,
        F32Sqrt: DIVISION,
        F64Sqrt: DIVISION,
        ..OperatorCost::new()
    }
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
pub(super) fn engine_error(error: wasmtime::Error) -> EngineError {
    EngineError(format!("{error:#}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_the_one_in_the_lock_file() {
        let lock = include_str!("../../../../Cargo.lock").replace("\r\n", "\n");
        assert!(lock.contains(&format!("name = \"wasmtime\"\nversion = \"{VERSION}\"\n")));
    }

    #[test]
    fn both_configurations_make_an_engine() {
        Engine::new(&pooled(4)).unwrap();
        Engine::new(&on_demand()).unwrap();
    }
}
