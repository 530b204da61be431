//! `softplug plugin`: a library from outside.

use std::fs;

use crate::bench::{Bench, plugins, snapshot};

#[test]
fn a_plug_in_is_added_found_used_and_removed() {
    let bench = Bench::new();
    let module = plugins().join("xon-xoff.wasm");
    let module = module.to_str().unwrap();
    let json = bench.run(&["plugin", "add", module, "--json"]).with_code(0).json();
    let (version, digest) = (json["version"].as_str().unwrap(), json["sha256"].as_str().unwrap());
    assert_eq!((&json["was_there"], json["name"].as_str()), (&false.into(), Some("xon-xoff")));
    let again = bench.run(&["plugin", "add", module]).with_code(0);
    assert_eq!(again.out, format!("xon-xoff@{version} was there already\n"));

    let listed = bench.run(&["plugin", "list", "--json"]).with_code(0).json();
    assert_eq!(listed.as_array().unwrap().len(), 1);
    assert_eq!(listed[0]["sha256"], digest);
    for asked in ["xon-xoff", &format!("xon-xoff@{version}"), &format!("xon-xoff@sha256:{digest}")]
    {
        let shown = bench.run(&["plugin", "show", asked, "--json"]).with_code(0).json();
        assert_eq!(shown["sha256"], digest, "{asked}");
    }

    bench.write("plugins/used/lathe", format!("running {digest}\n"));
    let refused = bench.run(&["plugin", "remove", "xon-xoff"]).with_code(1);
    assert!(refused.err.contains("is used by lathe"), "{}", refused.err);
    bench.run(&["plugin", "remove", "xon-xoff", "--force"]).with_code(0);
    bench.run(&["plugin", "list"]).with_code(4);
    let kept = bench.run(&["plugin", "gc", "--json"]).with_code(0).json();
    assert_eq!(kept["sha256"].as_array().unwrap().len(), 0);
    fs::remove_file(bench.path("plugins/used/lathe")).unwrap();
    let pretended = bench.run(&["plugin", "gc", "--dry-run", "--json"]).with_code(0).json();
    assert_eq!((&pretended["sha256"][0], &pretended["removed"]), (&digest.into(), &false.into()));
    bench.run(&["plugin", "gc"]).with_code(0);
    bench.run(&["plugin", "show", &format!("xon-xoff@sha256:{digest}")]).with_code(2);
}

#[test]
fn refusals_of_the_library_say_what_to_do() {
    let bench = Bench::new();
    bench.write("text.wasm", "G1X1");
    let mut text = bench.run(&["plugin", "list"]).with_code(2).err;
    text += &bench.run(&["plugin", "add", "text.wasm"]).with_code(3).err;
    text += &bench.run(&["plugin", "add", "none.wasm"]).with_code(2).err;
    text += &bench.run(&["plugin", "show", "xon-xoff"]).with_code(2).err;
    let module = plugins().join("xon-xoff.wasm");
    bench.run(&["plugin", "add", module.to_str().unwrap()]).with_code(0);
    text += &bench.run(&["plugin", "show", "xon-xof"]).with_code(2).err;
    text += &bench.run(&["plugin", "show", "XON"]).with_code(2).err;
    text += &bench.run(&["plugin", "remove", "xon-xoff@99"]).with_code(2).err;
    snapshot("library-refusals", text);
}
