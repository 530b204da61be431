//! Modules that take a compiler long, at the built command: refused, or compiled, within what is
//! promised.

#[path = "../../../../sdk/host/tests/bombs/corpus.rs"]
mod corpus;
#[path = "../../../../sdk/host/tests/bombs/recipe.rs"]
#[allow(dead_code, reason = "some of it is for the search alone")]
mod recipe;

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use softplug_host::compiler::{CompileLimits, CompilerProcess};
use softplug_host::{Host, HostOptions, LoadError, Origin};

use crate::bench::{Bench, Ran, plugins};

pub(crate) use corpus::{HEAVIEST, REFUSED, recipes};
pub(crate) use recipe::Recipe;

/// Promised: seconds of computing and kilobytes. A process that wants more of either is ended by
/// the system, and so does not end with a code.
const CAGE: &str = "ulimit -t 2; ulimit -d 200000; exec \"$@\"";

fn in_a_cage(bench: &Bench, arguments: &[&str]) -> Ran {
    let mut command = Command::new("sh");
    command.arg("-c").arg(CAGE).arg("sh").arg(env!("CARGO_BIN_EXE_softplug")).args(arguments);
    command.current_dir(bench.path("")).output().unwrap().into()
}

#[test]
fn every_bomb_is_refused_or_loaded_within_what_is_promised() {
    let bench = Bench::new();
    for recipe in recipes(&REFUSED) {
        bench.write("bomb.wasm", recipe.module());
        let ran = in_a_cage(&bench, &["inspect", "bomb.wasm"]).with_code(3);
        let is_said = ["is allowed", "are allowed", "takes too much compiling"];
        assert!(is_said.iter().any(|text| ran.err.contains(text)), "{recipe}: {ran}");
    }
    for recipe in recipes(&HEAVIEST) {
        bench.write("bomb.wasm", recipe.module());
        let ran = in_a_cage(&bench, &["inspect", "bomb.wasm"]);
        let is_refused = ran.code == 3 && ran.err.contains("compiling the module takes more than");
        // The bomb has no mailbox; it was compiled, then.
        let is_compiled = ran.code == 3 && ran.err.contains("mailbox");
        println!("{recipe}: {}", ran.err.trim());
        assert!(is_refused || is_compiled, "{recipe}: {ran}");
    }
}

#[test]
fn a_file_of_any_size_is_refused_unread() {
    let bench = Bench::new();
    let huge = std::fs::File::create(bench.path("huge.wasm")).unwrap();
    huge.set_len(64 << 30).unwrap();
    for words in [&["inspect", "huge.wasm"][..], &["certify", "huge.wasm", "--profile", "r3964"]] {
        let ran = in_a_cage(&bench, words).with_code(3);
        assert!(ran.err.contains("68719476736 bytes"), "{words:?}: {ran}");
    }
}

fn compiling(by: CompilerProcess) -> Host {
    let options = HostOptions { compiler: Some(by), instances: 4, ..HostOptions::default() };
    Host::new(options).unwrap()
}

fn this_command() -> CompilerProcess {
    CompilerProcess::new(Path::new(env!("CARGO_BIN_EXE_softplug")), ["__compile"])
}

#[test]
fn the_compilers_process_makes_the_same_plug_in() {
    let module = std::fs::read(plugins().join("xon-xoff.wasm")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let options = HostOptions {
        compiler: Some(this_command()),
        cache: Some(folder.path().join("cache")),
        ..HostOptions::default()
    };
    let host = Host::new(options.clone()).unwrap();
    let plugin = host.load_bytes(&module).unwrap();
    assert_eq!(plugin.origin(), Origin::Compiled);
    plugin.instantiate().unwrap();
    // What it has made is kept, for a host that compiles here too.
    let here = Host::new(HostOptions { compiler: None, ..options }).unwrap();
    assert_eq!(here.load_bytes(&module).unwrap().origin(), Origin::Cache);
}

#[test]
fn the_compilers_process_keeps_its_limits() {
    // The last one takes most memory.
    let bomb = recipes(&HEAVIEST[HEAVIEST.len() - 1..])[0].module();
    let limited = |limits| compiling(this_command().limited(limits)).load_bytes(&bomb).unwrap_err();
    let most = Duration::from_millis(50);
    let error = limited(CompileLimits { computing: most, ..CompileLimits::default() });
    assert!(matches!(error, LoadError::CompileTime { most: at } if at == most), "{error}");
    let most = 24 << 20;
    let error = limited(CompileLimits { memory: most, ..CompileLimits::default() });
    assert!(matches!(error, LoadError::CompileMemory { most: at } if at == most), "{error}");
    let patience = Duration::from_millis(1);
    let error = limited(CompileLimits { patience, ..CompileLimits::default() });
    assert!(matches!(error, LoadError::CompilerProcess(_)), "{error}");
}

#[test]
fn a_compilers_process_that_is_none_is_our_fault() {
    let module = std::fs::read(plugins().join("xon-xoff.wasm")).unwrap();
    // Not there; says nothing; says what it hears; fails.
    for program in ["/nowhere/softplug", "/bin/true", "/bin/cat", "/bin/false"] {
        let by = CompilerProcess::new(Path::new(program), Vec::<String>::new());
        let error = compiling(by).load_bytes(&module).unwrap_err();
        assert!(matches!(error, LoadError::CompilerProcess(_)), "{program}: {error}");
    }
    let never_ends = CompilerProcess::new(Path::new("/bin/sleep"), ["1000"]);
    let host = compiling(never_ends);
    let stops = host.clone();
    let stopping = std::thread::spawn(move || stops.stop_compiling());
    let error = host.load_bytes(&module).unwrap_err();
    assert!(error.to_string().contains("broken off"), "{error}");
    stopping.join().unwrap();
    // The word alone is no request.
    let bench = Bench::new();
    assert!(bench.run(&["__compile"]).with_code(70).err.contains("fill whole buffer"));
}
