//! Small modules that take a compiler long: refused before anything is built from them, or
//! compiled within what is promised.
//!
//! One test, so that the process's peak of memory is that of these modules.
#![cfg(target_os = "linux")]

mod corpus;
#[allow(dead_code, reason = "some of it is for the search alone")]
mod recipe;

use corpus::{HEAVIEST, REFUSED, recipes};
use rustix::time::{ClockId, clock_gettime};
use softplug_abi::limits::{EXPORTS, MODULE_BYTES, MODULE_WEIGHT, PARAMETERS};
use softplug_host::{Host, HostOptions, LintError, lint};
use wasm_encoder::{
    CodeSection, ExportKind, ExportSection, Function, FunctionSection, Instruction, Module,
    TypeSection, ValType,
};

/// Promised are 2 s; twice that for a computer that is busy or slow.
const SECONDS: f64 = 4.0;
/// Promised: of the whole process.
const MEGABYTES: u64 = 200;
/// Of a lint, in all cases together: it is measured in thousandths of that.
const LINT_SECONDS: f64 = 2.0;

/// Seconds of computing of this process so far.
fn computed() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// The most memory that this process has held, in megabytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap() / 1_024
}

/// A function of a type so wide, exports of it, and calls of it from another function, in code
/// that cannot be reached.
fn wide(parameters: usize, exports: usize, calls: usize) -> Vec<u8> {
    let mut types = TypeSection::new();
    types.ty().function(vec![ValType::I64; parameters], []);
    let mut functions = FunctionSection::new();
    functions.function(0).function(0);
    let mut section = ExportSection::new();
    for nth in 0..exports {
        section.export(&format!("{nth:x}"), ExportKind::Func, 0);
    }
    let mut code = CodeSection::new();
    for calls in [0, calls] {
        let mut function = Function::new([]);
        function.instruction(&Instruction::Unreachable);
        for _ in 0..calls {
            function.instruction(&Instruction::Call(0));
        }
        function.instruction(&Instruction::End);
        code.function(&function);
    }
    let mut module = Module::new();
    module.section(&types).section(&functions).section(&section).section(&code);
    module.finish()
}

#[test]
fn bombs_are_refused_or_compiled_in_time() {
    let begin = computed();
    for (wasm, what, most) in [
        // 9 GB, when each export had the text of its type.
        (wide(1_000, 36_000, 0), "parameters of a function", PARAMETERS),
        (wide(0, 36_000, 0), "exports", EXPORTS),
        // Each call of two bytes makes the validator take a thousand values off its stack.
        (wide(1_000, 0, 130_000), "parameters of a function", PARAMETERS),
    ] {
        assert!(wasm.len() <= MODULE_BYTES, "{what}: {} bytes", wasm.len());
        let before = computed();
        let error = lint(&wasm).unwrap_err();
        assert!(
            matches!(error, LintError::TooMany { what: of, most: at, .. } if of == what && at == most),
            "{error}"
        );
        println!("{what}: {:.4} s, peak {} MB", computed() - before, peak());
        assert!(computed() - before < LINT_SECONDS);
    }
    for recipe in recipes(&REFUSED) {
        let wasm = recipe.module();
        assert!(wasm.len() <= MODULE_BYTES, "{recipe}: {} bytes", wasm.len());
        let before = computed();
        let error = lint(&wasm).unwrap_err();
        let lints = computed() - before;
        println!("{recipe}: refused in {lints:.4} s: {error}");
        assert!(
            matches!(
                error,
                LintError::TooMany { .. }
                    | LintError::HeavyFunction { .. }
                    | LintError::HeavyModule
            ),
            "{error}"
        );
        assert!(lints < LINT_SECONDS, "{recipe}: {lints:.3} s");
    }
    // Nothing of this was compiled: it takes little more than the files themselves.
    let after_lints = peak();
    assert!(after_lints < MEGABYTES / 2, "{after_lints} MB after {:.3} s", computed() - begin);

    let host = Host::new(HostOptions { instances: 4, ..HostOptions::default() }).unwrap();
    for recipe in recipes(&HEAVIEST) {
        let wasm = recipe.module();
        let weight = lint(&wasm).unwrap_or_else(|error| panic!("{recipe}: {error}")).weight;
        assert!(weight > MODULE_WEIGHT / 5, "{recipe} is no bomb any more: {weight}");
        let before = computed();
        host.load_bytes(&wasm).unwrap();
        let seconds = computed() - before;
        println!("{recipe}: weight {weight}, {seconds:.3} s of computing, peak {} MB", peak());
        assert!(seconds < SECONDS, "{recipe}: {seconds:.3} s");
        assert!(peak() < MEGABYTES, "{recipe}: {} MB", peak());
    }
}

#[test]
fn recipes_are_read_as_they_are_written() {
    for recipe in recipes(&REFUSED) {
        assert_eq!(recipe.to_string().parse(), Ok(recipe));
    }
    assert!("1 2 3".parse::<recipe::Recipe>().is_err());
}
