//! The hello-world plug-in stays small, works natively and builds as a module.

#[path = "../examples/hello.rs"]
#[allow(unreachable_pub, reason = "it is a crate of its own as well")]
mod example;

use example::Hello;
use softplug_link::Observed;
use softplug_plugin::bench::Bench;
use std::path::Path;
use std::process::Command;

#[test]
fn it_is_under_40_lines() {
    assert!(include_str!("../examples/hello.rs").lines().count() < 40);
}

#[test]
fn it_greets_and_repeats() {
    let mut bench = Bench::<Hello>::new().open();
    bench.receive(b"G1");
    bench.run_for_millis(20);
    assert_eq!(bench.sent(), b"HELLO G1");

    let mut bench = Bench::<Hello>::new().set("greeting", "").room(4, 4).open();
    bench.receive(b"12345");
    bench.receive(b"1234");
    bench.run_for_millis(20);
    assert_eq!(bench.sent(), b"1234");
    let is_note =
        |seen: &Observed| matches!(seen, Observed::Note(_, _, text) if text == "no room to answer");
    assert!(bench.observed().iter().any(|(_, seen)| is_note(seen)));
}

#[test]
fn it_builds_as_a_plugin() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let built = Command::new(env!("CARGO"))
        .current_dir(&root)
        .args(["build", "--quiet", "-p", "softplug-plugin", "--example", "hello"])
        .args(["--profile", "plugin", "--target", "wasm32v1-none", "--message-format", "json"])
        .output()
        .expect("cargo runs these tests, so it can be started");
    let messages = String::from_utf8_lossy(&built.stdout);
    assert!(built.status.success(), "{}{messages}", String::from_utf8_lossy(&built.stderr));
    // Where the module is, as cargo tells it.
    let place = messages.split('"').find(|word| word.ends_with("hello.wasm"));
    let module = std::fs::read(place.expect("cargo names what it built")).expect("it was built");
    assert!(module.len() <= 32 * 1024, "{} bytes", module.len());
    assert_eq!(module[..8], *b"\0asm\x01\0\0\0");
    for part in ["softplug.manifest", "softplug_v1_step", "Repeats what it receives."] {
        let found = module.windows(part.len()).any(|window| window == part.as_bytes());
        assert!(found, "{part} is not in the module");
    }
}
