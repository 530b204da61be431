//! Plug-ins in the sandbox: one that echoes, and some that do harm.

use softplug_host::{Host, HostOptions, Plugin, Session};

/// What each does with what it receives, its place among the hostile, and what is
/// said of it then.
pub(crate) const HOSTILE: [(&str, &str); 4] = [
    (
        r"(i32.store (i32.const 64) (i32.const 4)) (i32.store (i32.const 68) (i32.const 0x65696c20))
        unreachable",
        "trapped",
    ),
    ("(loop (br 0)) unreachable", "used up its budget"),
    ("(loop (drop (memory.grow (i32.const 1))) (br 0)) unreachable", "used up its budget"),
    ("(return (i32.const 0x3fffffff))", "broke the ABI"),
];

/// The plug-ins, loaded.
pub(crate) struct Guests {
    echo: Plugin,
    hostile: Vec<Plugin>,
}

impl Guests {
    pub(crate) fn load(instances: u32) -> Self {
        let host = Host::new(HostOptions { instances, ..HostOptions::default() }).unwrap();
        let load = |text: &str| host.load_bytes(&wat::parse_str(text).unwrap()).unwrap();
        let echo = load(include_str!("../../../../fixtures/abi/echo.wat"));
        let hostile = HOSTILE.iter().map(|(step, _)| load(&module(step))).collect();
        Self { echo, hostile }
    }

    pub(crate) fn echo(&self) -> Session {
        self.echo.instantiate().unwrap()
    }

    pub(crate) fn hostile(&self, kind: usize) -> Session {
        self.hostile[kind % HOSTILE.len()].instantiate().unwrap()
    }
}

fn module(received: &str) -> String {
    format!(
        r#"(module
      (@custom "softplug.manifest"
        "{{\"abi\":\"1.0\",\"name\":\"hostile\",\"version\":\"1.0.0\",\"licence\":\"MIT\","
        "\"protocol\":\"none\",\"description\":\"Does harm.\"}}")
      (memory (export "memory") 1 1)
      (data (i32.const 16) "\00\04\00\00\00\02\00\00" "\00\08\00\00\00\04\00\00" "\40\00\00\00\40\00\00\00")
      (func (export "softplug_v1") (result i32) (i32.const 16))
      (func (export "softplug_v1_step") (param i32 i32 i64) (result i32)
        (if (i32.eq (local.get 0) (i32.const 4)) (then {received}))
        (i32.const 0)))"#
    )
}
