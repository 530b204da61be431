//! The lint: whether a module is a plug-in, found out without compiling it.

mod error;
mod outline;

pub use error::{LintError, MemoryMaximum};

use crate::Digest;
use outline::{Export, Outline, Signature};
use softplug_abi::limits::{MEMORY_PAGES, MODULE_BYTES};
use softplug_abi::manifest::Manifest;
use softplug_abi::{EXPORT_MAILBOX, EXPORT_MEMORY, EXPORT_STEP};
use wasmparser::{Validator, WasmFeatures};

/// Most elements of a table, and of all element segments together. More is
/// refused: an instance's resident size would grow with them.
///
/// ```
/// use softplug_host::{ELEMENTS, LintError, lint};
///
/// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
/// let one_too_many = format!("(table {} funcref)", ELEMENTS + 1);
/// # let wasm = wat::parse_str(echo.replace("(memory", &format!("{one_too_many} (memory")))?;
/// let error = lint(&wasm).unwrap_err();
/// assert!(matches!(error, LintError::TooMany { what: "table elements", most: ELEMENTS, .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const ELEMENTS: u64 = 1_024;

/// Most globals. More is refused, for the same reason.
///
/// ```
/// use softplug_host::{GLOBALS, LintError, lint};
///
/// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
/// // Beside the two that this plug-in has already.
/// let too_many = "(global i32 (i32.const 0))".repeat(GLOBALS as usize);
/// # let wasm = wat::parse_str(echo.replace("(memory", &format!("{too_many} (memory")))?;
/// let error = lint(&wasm).unwrap_err();
/// assert!(matches!(error, LintError::TooMany { what: "globals", most: GLOBALS, .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const GLOBALS: u64 = 1_024;

/// Most parameters and locals of all functions together. More is refused: a few
/// bytes can declare thousands, and each costs time and memory in compiling.
///
/// ```
/// use softplug_host::{LOCALS, LintError, lint};
///
/// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
/// // Empty functions of one type, which has 1,000 parameters.
/// let many = format!("(type $many (func (param {})))", "i32 ".repeat(1_000));
/// let functions = "(func (type $many))".repeat(LOCALS as usize / 1_000 + 1);
/// # let wasm = wat::parse_str(echo.replace("(memory", &format!("{many} {functions} (memory")))?;
/// let error = lint(&wasm).unwrap_err();
/// assert!(matches!(error, LintError::TooMany { most: LOCALS, .. }));
/// assert!(error.to_string().contains("parameters and locals"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const LOCALS: u64 = 256 * 1024;

/// Signature of `softplug_v1`.
///
/// ```
/// use softplug_host::{LintError, SIGNATURE_MAILBOX, lint};
///
/// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
/// # let mailbox = "(result i32) (i32.const 16)";
/// # let wasm = wat::parse_str(echo.replace(mailbox, "(result i64) (i64.const 16)"))?;
/// // A plug-in that gives its mailbox's address with 64 bits.
/// let error = lint(&wasm).unwrap_err();
/// assert!(matches!(error, LintError::WrongSignature { expected: SIGNATURE_MAILBOX, .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const SIGNATURE_MAILBOX: &str = "() -> i32";
/// Signature of `softplug_v1_step`.
///
/// ```
/// use softplug_host::{LintError, SIGNATURE_STEP, lint};
///
/// # let echo = std::fs::read_to_string("tests/guests/echo.wat")?;
/// # let wasm = wat::parse_str(echo.replace("(param $now i64)", "(param $now i32)"))?;
/// // A plug-in that takes the time with 32 bits.
/// let error = lint(&wasm).unwrap_err();
/// assert!(matches!(error, LintError::WrongSignature { expected: SIGNATURE_STEP, .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub const SIGNATURE_STEP: &str = "(i32, i32, i64) -> i32";

/// WebAssembly 1.0 and mutable globals, as `wasm32v1-none` emits.
pub(crate) const FEATURES: WasmFeatures = WasmFeatures::FLOATS.union(WasmFeatures::MUTABLE_GLOBAL);

/// What the lint found out about a plug-in.
///
/// Made by [`lint`], shown there.
#[derive(Clone, PartialEq, Debug)]
pub struct Inspection {
    /// What the plug-in says of itself.
    pub manifest: Manifest,
    /// SHA-256 of the module.
    pub digest: Digest,
    /// Size of the module in bytes.
    pub size: usize,
    /// Memory of an instance, in pages of 64 KiB.
    pub memory_pages: u64,
    /// Imports; a plug-in has none, so this is 0.
    pub imports: usize,
    /// Names of the exports, as they stand in the module.
    pub exports: Vec<String>,
}

/// Checks that a module is a plug-in.
///
/// Nothing is compiled and nothing of the module runs: it is quick and safe on
/// any bytes.
///
/// ```
/// use softplug_host::{Inspection, lint};
///
/// # let wasm = wat::parse_file("tests/guests/echo.wat")?;
/// let inspection: Inspection = lint(&wasm)?;
/// assert_eq!(inspection.manifest.name, "echo");
/// assert_eq!((inspection.size, inspection.memory_pages), (wasm.len(), 1));
/// assert!(inspection.exports.iter().any(|name| name == "softplug_v1_step"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first rule that the module breaks.
pub fn lint(wasm: &[u8]) -> Result<Inspection, LintError> {
    if wasm.len() > MODULE_BYTES {
        return Err(LintError::TooLarge { bytes: wasm.len() });
    }
    if !wasm.starts_with(b"\0asm") {
        return Err(LintError::NotWasm);
    }
    if let Err(error) = Validator::new_with_features(FEATURES).validate_all(wasm) {
        return Err(why_invalid(wasm, &error));
    }
    let outline = Outline::read(wasm).map_err(|error| LintError::from_parser(wasm, &error))?;
    check_imports(&outline)?;
    if outline.has_start {
        return Err(LintError::StartFunction);
    }
    let memory_pages = check_memory(&outline)?;
    check_exports(&outline)?;
    check_amount("table elements", outline.elements, ELEMENTS)?;
    check_amount("globals", outline.globals, GLOBALS)?;
    check_amount("parameters and locals", outline.locals, LOCALS)?;
    Ok(Inspection {
        manifest: check_manifest(&outline)?,
        digest: Digest::of(wasm),
        size: wasm.len(),
        memory_pages,
        imports: outline.imports.len(),
        exports: outline.exports.into_iter().map(|(name, _)| name).collect(),
    })
}

/// A module that is invalid here may be valid elsewhere: then it was built for
/// the wrong target, which is another message.
fn why_invalid(wasm: &[u8], error: &wasmparser::Error) -> LintError {
    let memories = Outline::read(wasm).map(|outline| outline.memories).unwrap_or_default();
    if memories.iter().any(|memory| memory.memory64) {
        return LintError::Memory64;
    }
    if memories.iter().any(|memory| memory.shared) {
        return LintError::SharedMemory;
    }
    if Validator::new_with_features(WasmFeatures::all()).validate_all(wasm).is_err() {
        return LintError::from_parser(wasm, error);
    }
    LintError::ForbiddenFeature {
        at: error.offset(),
        message: crate::words::printable(error.message().as_bytes()),
    }
}

fn check_imports(outline: &Outline<'_>) -> Result<(), LintError> {
    if outline.imports.is_empty() {
        return Ok(());
    }
    let shown = 8;
    let mut names = outline.imports[..outline.imports.len().min(shown)].join(", ");
    if outline.imports.len() > shown {
        names.push_str(", …");
    }
    Err(LintError::Imports { count: outline.imports.len(), names })
}

fn check_memory(outline: &Outline<'_>) -> Result<u64, LintError> {
    let [memory] = outline.memories[..] else { return Err(LintError::MemoryMissing) };
    let pages = memory.initial;
    if memory.maximum != Some(pages) {
        let max = MemoryMaximum(memory.maximum);
        return Err(LintError::MemoryGrows { min: pages, max });
    }
    if pages == 0 {
        return Err(LintError::EmptyMemory);
    }
    if pages > MEMORY_PAGES {
        return Err(LintError::TooManyPages { pages });
    }
    Ok(pages)
}

fn check_exports(outline: &Outline<'_>) -> Result<(), LintError> {
    let kind_of = |wanted: &'static str| {
        let export = outline.exports.iter().find(|(name, _)| name == wanted);
        export.map(|(_, kind)| kind).ok_or(LintError::MissingExport(wanted))
    };
    match kind_of(EXPORT_MEMORY)? {
        Export::Memory => {}
        other => return Err(wrong_kind(EXPORT_MEMORY, "a memory", other)),
    }
    for (name, expected) in [(EXPORT_MAILBOX, SIGNATURE_MAILBOX), (EXPORT_STEP, SIGNATURE_STEP)] {
        match kind_of(name)? {
            Export::Function(signature) if signature.to_string() == expected => {}
            Export::Function(signature) => {
                let found = signature.to_string();
                return Err(LintError::WrongSignature { name, expected, found });
            }
            other => return Err(wrong_kind(name, "a function", other)),
        }
    }
    for (name, kind) in &outline.exports {
        let known = [EXPORT_MEMORY, EXPORT_MAILBOX, EXPORT_STEP].contains(&name.as_str());
        if !known && *kind != Export::ImmutableGlobal {
            let name = crate::words::printable(name.as_bytes());
            return Err(LintError::UnexpectedExport { name, kind: kind.name() });
        }
    }
    Ok(())
}

fn wrong_kind(name: &'static str, expected: &'static str, found: &Export) -> LintError {
    LintError::WrongKind { name, expected, found: found.name() }
}

fn check_amount(what: &'static str, count: u64, most: u64) -> Result<(), LintError> {
    if count > most { Err(LintError::TooMany { what, count, most }) } else { Ok(()) }
}

fn check_manifest(outline: &Outline<'_>) -> Result<Manifest, LintError> {
    match outline.manifests[..] {
        [] => Err(LintError::ManifestMissing),
        [json] => Ok(Manifest::parse(json)?),
        [..] => Err(LintError::ManifestTwice),
    }
}

impl Export {
    fn name(&self) -> &'static str {
        match self {
            Self::Function(_) => "function",
            Self::Table => "table",
            Self::Memory => "memory",
            Self::ImmutableGlobal => "immutable global",
            Self::MutableGlobal => "mutable global",
            Self::Tag => "tag",
        }
    }
}

impl std::fmt::Display for Signature {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "({})", self.parameters.join(", "))?;
        match &self.results[..] {
            [] => Ok(()),
            [result] => write!(f, " -> {result}"),
            results => write!(f, " -> ({})", results.join(", ")),
        }
    }
}
