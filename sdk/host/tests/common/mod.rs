//! Guests made for one test each, from a template that keeps every rule.

use softplug_host::{EngineKind, Host, HostOptions, LoadError, Plugin, Session};
use std::fmt::Write;
use std::sync::LazyLock;

/// One engine for all tests of a file.
pub(crate) static HOST: LazyLock<Host> =
    LazyLock::new(|| Host::new(HostOptions::default()).unwrap());

/// A host for each engine that there is, for what must be the same under all.
pub(crate) static HOSTS: LazyLock<Vec<Host>> = LazyLock::new(|| {
    let mut hosts = vec![HOST.clone()];
    #[cfg(feature = "wasmi")]
    hosts.push(host(HostOptions { engine: EngineKind::Wasmi, ..HostOptions::default() }));
    #[cfg(feature = "interpreter")]
    hosts.push(host(HostOptions { engine: EngineKind::Interpreter, ..HostOptions::default() }));
    hosts
});

/// Every engine.
pub(crate) const ENGINES: &[EngineKind] = &[
    EngineKind::Wasmtime,
    #[cfg(feature = "wasmi")]
    EngineKind::Wasmi,
    #[cfg(feature = "interpreter")]
    EngineKind::Interpreter,
];

pub(crate) fn host(options: HostOptions) -> Host {
    Host::new(options).unwrap()
}

pub(crate) const MANIFEST: &str = r#"{"abi": "1.0", "name": "guest", "version": "1.0.0",
    "licence": "MIT", "protocol": "none", "description": "Does what a test needs.",
    "state": {"saves": 1, "accepts": [1, 2]}}"#;

/// Where the template's regions lie.
pub(crate) const INPUT: u32 = 0x1000;
pub(crate) const OUTPUT: u32 = 0x2000;
pub(crate) const WORDS: u32 = 0x3000;
pub(crate) const CAPACITY: u32 = 0x1000;

/// A module in WAT; every field keeps the rules until a test changes it.
pub(crate) struct Guest {
    pub(crate) manifests: Vec<String>,
    pub(crate) memory: String,
    pub(crate) descriptor: [u32; 6],
    /// Body of `softplug_v1`.
    pub(crate) mailbox: String,
    /// Body of `softplug_v1_step`; parameters 0 kind, 1 length, 2 now.
    pub(crate) step: String,
    /// Further fields of the module.
    pub(crate) extra: String,
}

impl Default for Guest {
    fn default() -> Self {
        Self {
            manifests: vec![MANIFEST.to_owned()],
            memory: "(memory (export \"memory\") 1 1)".to_owned(),
            descriptor: [INPUT, CAPACITY, OUTPUT, CAPACITY, WORDS, 256],
            mailbox: "(i32.const 16)".to_owned(),
            step: "(i32.const 0)".to_owned(),
            extra: String::new(),
        }
    }
}

impl Guest {
    /// A guest with this body of `softplug_v1_step`.
    pub(crate) fn stepping(step: &str) -> Self {
        Self { step: step.to_owned(), ..Self::default() }
    }

    pub(crate) fn extra(self, extra: &str) -> Self {
        Self { extra: extra.to_owned(), ..self }
    }

    pub(crate) fn wasm(&self) -> Vec<u8> {
        let mut text = String::from("(module\n");
        for manifest in &self.manifests {
            let bytes = wat_string(manifest.as_bytes());
            writeln!(text, "(@custom \"softplug.manifest\" \"{bytes}\")").unwrap();
        }
        let descriptor: Vec<u8> =
            self.descriptor.iter().flat_map(|word| word.to_le_bytes()).collect();
        writeln!(
            text,
            "{}
            (data (i32.const 16) \"{}\")
            {}
            (func (export \"softplug_v1\") (result i32) {})
            (func (export \"softplug_v1_step\") (param i32 i32 i64) (result i32) {}))",
            self.memory,
            wat_string(&descriptor),
            self.extra,
            self.mailbox,
            self.step,
        )
        .unwrap();
        wat(&text)
    }

    /// A session under each engine.
    pub(crate) fn sessions(&self) -> impl Iterator<Item = Session> {
        let wasm = self.wasm();
        HOSTS.iter().map(move |host| host.load_bytes(&wasm).unwrap().instantiate().unwrap())
    }

    /// Why there is no session, under each engine.
    pub(crate) fn start_errors(&self) -> impl Iterator<Item = LoadError> {
        let wasm = self.wasm();
        let start = move |host: &Host| host.load_bytes(&wasm).and_then(|found| found.instantiate());
        HOSTS.iter().map(move |host| start(host).unwrap_err())
    }

    pub(crate) fn load(&self) -> Result<Plugin, LoadError> {
        HOST.load_bytes(&self.wasm())
    }

    pub(crate) fn start(&self) -> Result<Session, LoadError> {
        self.load()?.instantiate()
    }

    pub(crate) fn session(&self) -> Session {
        self.start().unwrap()
    }
}

pub(crate) fn wat(text: &str) -> Vec<u8> {
    wat::parse_str(text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

pub(crate) fn echo() -> Vec<u8> {
    wat(include_str!("../guests/echo.wat"))
}

pub(crate) fn wat_string(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in bytes {
        write!(text, "\\{byte:02x}").unwrap();
    }
    text
}
