//! The reference plug-ins, native and as modules, and where the files are.

pub(crate) mod fanuc;
pub(crate) mod pair;
pub(crate) mod small;

use softplug_abi::manifest::Manifest;
use softplug_conformance::{Case, Corpus, FromFn, Judge, Sandboxed};
use softplug_host::{EngineKind, Host, HostOptions};
use softplug_native::{NativeInstance, NativePlugin};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The top of the repository.
pub(crate) fn root() -> PathBuf {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    top.canonicalize().expect("the repository is there")
}

/// A reference plug-in as native code.
pub(crate) fn native(name: &str) -> FromFn<impl Fn() -> NativeInstance> {
    let plugin = NativePlugin::from_name(name).expect("a reference plug-in has this name");
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).expect("its manifest is valid");
    FromFn::new(manifest, move || plugin.instantiate())
}

/// A reference plug-in in the sandbox: from the folder `SOFTPLUG_PLUGINS`, else built now.
#[cfg(feature = "wasmtime")]
pub(crate) fn sandboxed(name: &str) -> Sandboxed {
    sandboxed_under(EngineKind::Wasmtime, name)
}

/// A reference plug-in in the sandbox, under this engine.
pub(crate) fn sandboxed_under(engine: EngineKind, name: &str) -> Sandboxed {
    let options = HostOptions { engine, ..HostOptions::default() };
    let host = Host::new(options).expect("the engine can be set up");
    let plugin = host.load_bytes(&module(name)).unwrap_or_else(|error| panic!("{error}"));
    Sandboxed::new(plugin)
}

/// The module itself.
pub(crate) fn module(name: &str) -> Vec<u8> {
    let path = match std::env::var_os("SOFTPLUG_PLUGINS") {
        Some(folder) => PathBuf::from(folder).join(format!("{name}.wasm")),
        None => build(name),
    };
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Cargo builds only what has changed, so that never an old module is judged.
fn build(name: &str) -> PathBuf {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    // Flags from the environment would replace those that bound the memory.
    let built = Command::new(env!("CARGO"))
        .current_dir(root())
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .args(["build", "--quiet", "--profile", "plugin", "--target", "wasm32v1-none", "--lib"])
        .args(["-p", &format!("softplug-{name}"), "--target-dir"])
        .arg(&target)
        .status()
        .expect("cargo can be run");
    assert!(built.success(), "the plug-in {name} cannot be built; is wasm32v1-none installed?");
    target.join("wasm32v1-none/plugin").join(format!("{}.wasm", name.replace('-', "_")))
}

/// The traces of a profile.
pub(crate) fn cases(profile: &str) -> Vec<Case> {
    let cases = Corpus::embedded().cases.into_iter();
    cases.filter(|case| case.trace.front.profile == profile).collect()
}

/// Fails with the first failure of some traces in full if any case does.
pub(crate) fn assert_all_pass(subject: &dyn Judge, summary: &softplug_conformance::Summary) {
    let failed: Vec<_> = summary.cases.iter().filter(|case| !case.is_passed()).collect();
    let mut traces = std::collections::BTreeSet::new();
    let first_of_trace = failed.iter().filter(|case| traces.insert(case.case.split('/').next()));
    let shown: Vec<_> = first_of_trace.take(30).map(ToString::to_string).collect();
    assert!(
        failed.is_empty(),
        "{}: {} of {} cases fail\n{}",
        subject.label(),
        failed.len(),
        summary.total,
        shown.join("\n")
    );
}
