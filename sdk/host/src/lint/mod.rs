//! The lint: whether a module is a plug-in, found out without compiling it.

mod bounds;
mod error;
mod outline;
mod weight;

pub use error::{LintError, MemoryMaximum};

use crate::Digest;
use outline::{Export, Outline, Signature};
use softplug_abi::limits::{MEMORY_PAGES, MODULE_BYTES};
use softplug_abi::manifest::Manifest;
use softplug_abi::{EXPORT_MAILBOX, EXPORT_MEMORY, EXPORT_STEP};
use wasmparser::{FuncValidatorAllocations, Parser, ValidPayload, Validator, WasmFeatures};
use weight::{Scales, Unfit};

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
    /// What compiling it costs, in the units of the specification: at most
    /// [`MODULE_WEIGHT`](softplug_abi::limits::MODULE_WEIGHT).
    pub weight: u64,
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
    bounds::check(wasm)?;
    let weight = validate(wasm)?;
    let outline = Outline::read(wasm).map_err(|error| LintError::from_parser(wasm, &error))?;
    check_imports(&outline)?;
    if outline.has_start {
        return Err(LintError::StartFunction);
    }
    let memory_pages = check_memory(&outline)?;
    check_exports(&outline)?;
    let manifest = check_manifest(&outline)?;
    check_memory_used(&outline, memory_pages, &manifest)?;
    Ok(Inspection {
        manifest,
        digest: Digest::of(wasm),
        size: wasm.len(),
        memory_pages,
        weight,
        imports: outline.import_count,
        exports: outline.exports.into_iter().map(|(name, _)| name).collect(),
    })
}

/// Validates the module, function by function, and weighs what compiling it costs.
fn validate(wasm: &[u8]) -> Result<u64, LintError> {
    let mut scales = Scales::default();
    match weigh(wasm, &mut scales) {
        Ok(()) => Ok(scales.module()),
        Err(Unfit::Lint(error)) => Err(error),
        Err(Unfit::Invalid(error)) => Err(why_invalid(wasm, &error)),
    }
}

fn weigh(wasm: &[u8], scales: &mut Scales) -> Result<(), Unfit> {
    let mut validator = Validator::new_with_features(FEATURES);
    let mut parser = Parser::new(0);
    parser.set_features(FEATURES);
    let mut functions = Vec::new();
    for payload in parser.parse_all(wasm) {
        if let ValidPayload::Func(function, body) = validator.payload(&payload?)? {
            functions.push((function, body));
        }
    }
    let mut allocations = FuncValidatorAllocations::default();
    for (function, body) in functions {
        let mut validator = function.into_validator(allocations);
        scales.take(&mut validator, &body, FEATURES)?;
        allocations = validator.into_allocations();
    }
    Ok(())
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
    // A component may hold other modules: it is not looked into.
    let is_component = wasm.get(4..8) == Some(&[0x0d, 0, 1, 0]);
    let is_valid = || Validator::new_with_features(WasmFeatures::all()).validate_all(wasm).is_ok();
    if !is_component && !is_valid() {
        return LintError::from_parser(wasm, error);
    }
    LintError::ForbiddenFeature {
        at: error.offset(),
        message: crate::words::printable(error.message().as_bytes()),
    }
}

fn check_imports(outline: &Outline<'_>) -> Result<(), LintError> {
    if outline.import_count == 0 {
        return Ok(());
    }
    let mut names = outline.imports.join(", ");
    if outline.import_count > outline.imports.len() {
        names.push_str(", …");
    }
    Err(LintError::Imports { count: outline.import_count, names })
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

/// What the manifest says of it.
fn check_memory_used(
    outline: &Outline<'_>,
    pages: u64,
    manifest: &Manifest,
) -> Result<(), LintError> {
    let Some(bytes) = manifest.memory_bytes else { return Ok(()) };
    let declared = pages * 65_536;
    if u64::from(bytes) > declared {
        return Err(LintError::MoreThanDeclared { bytes, declared });
    }
    if outline.data_end > u64::from(bytes) {
        return Err(LintError::DataAbove { bytes, end: outline.data_end });
    }
    Ok(())
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
