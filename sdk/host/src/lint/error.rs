//! Why a module is no plug-in.

use softplug_abi::MANIFEST_SECTION;
use softplug_abi::limits::{FUNCTION_WEIGHT, MEMORY_PAGES, MODULE_BYTES, MODULE_WEIGHT};
use softplug_abi::manifest::ManifestError;
use std::fmt;
use thiserror::Error;

/// The rule that a module breaks. The module's builder is to blame, or whoever
/// took another file for a plug-in.
///
/// ```
/// use softplug_host::{LintError, MemoryMaximum, lint};
///
/// // Without a maximum, the memory could grow.
/// let wasm = wat::parse_str("(module (memory 1))")?;
/// let grows = LintError::MemoryGrows { min: 1, max: MemoryMaximum(None) };
/// assert_eq!(lint(&wasm), Err(grows));
/// assert_eq!(lint(b"%\nO0001\n%\n"), Err(LintError::NotWasm));
/// # Ok::<(), wat::Error>(())
/// ```
#[derive(Clone, PartialEq, Debug, Error)]
pub enum LintError {
    /// Larger than [`MODULE_BYTES`].
    #[error("the module has {bytes} bytes, at most {MODULE_BYTES} are allowed: build it for size")]
    TooLarge {
        /// Its size in bytes.
        bytes: usize,
    },
    /// It does not begin as a WebAssembly module does.
    #[error("this is not a WebAssembly module: give the .wasm file that the build made")]
    NotWasm,
    /// It ends in the middle.
    #[error("the module ends in the middle, at byte {at}: copy or build it again")]
    Truncated {
        /// Where it should go on, in bytes.
        at: usize,
    },
    /// It is not valid WebAssembly of any kind.
    #[error("the module is damaged at byte {at} ({message}): copy or build it again")]
    Invalid {
        /// Where, in bytes.
        at: usize,
        /// The parser's text.
        message: String,
    },
    /// It uses what came after WebAssembly 1.0 with mutable globals.
    #[error(
        "the module uses a feature past WebAssembly 1.0 at byte {at} ({message}): build it for \
         wasm32v1-none"
    )]
    ForbiddenFeature {
        /// Where, in bytes.
        at: usize,
        /// The parser's text.
        message: String,
    },
    /// It imports something.
    #[error("the module imports {names} ({count} in all): a plug-in has no imports")]
    Imports {
        /// How many.
        count: usize,
        /// The first of them, as `module.name`.
        names: String,
    },
    /// It has a start function.
    #[error("the module has a start function: a plug-in computes only when it is called")]
    StartFunction,
    /// It has no memory.
    #[error("the module has no memory of its own: declare one and export it as \"memory\"")]
    MemoryMissing,
    /// Its memory is 64-bit.
    #[error("the memory is 64-bit: build the module for wasm32v1-none")]
    Memory64,
    /// Its memory is shared.
    #[error("the memory is shared: build the module without threads")]
    SharedMemory,
    /// Its memory has not the same minimum and maximum.
    #[error(
        "the memory has {min} pages at least and {max} at most: link with the same \
         --initial-memory and --max-memory"
    )]
    MemoryGrows {
        /// Declared minimum in pages.
        min: u64,
        /// Declared maximum in pages.
        max: MemoryMaximum,
    },
    /// It declares a memory of no pages.
    #[error("the memory has no pages: link with an --initial-memory of at least 65536")]
    EmptyMemory,
    /// It declares more than [`MEMORY_PAGES`].
    #[error(
        "the memory has {pages} pages, at most {MEMORY_PAGES} are allowed: link with a smaller \
         stack and --initial-memory"
    )]
    TooManyPages {
        /// Declared pages.
        pages: u64,
    },
    /// Its manifest says that it uses more memory than it declares.
    #[error("the manifest's memory_bytes is {bytes}, and the module declares {declared} bytes")]
    MoreThanDeclared {
        /// What the manifest says.
        bytes: u32,
        /// What the module declares, in bytes.
        declared: u64,
    },
    /// Its data lies above what its manifest says that it uses.
    #[error("the manifest's memory_bytes is {bytes}, and the module's data reaches to byte {end}")]
    DataAbove {
        /// What the manifest says.
        bytes: u32,
        /// Where the data ends.
        end: u64,
    },
    /// An export of the ABI is not there.
    #[error("the export \"{0}\" is missing: is this a plug-in of ABI version 1?")]
    MissingExport(&'static str),
    /// An export of the ABI is of another kind.
    #[error("the export \"{name}\" is not {expected} but of kind {found}")]
    WrongKind {
        /// The export.
        name: &'static str,
        /// What it must be.
        expected: &'static str,
        /// The kind it has.
        found: &'static str,
    },
    /// A function of the ABI has another signature.
    #[error("the export \"{name}\" has the signature {found}, it must be {expected}")]
    WrongSignature {
        /// The export.
        name: &'static str,
        /// As it must be.
        expected: &'static str,
        /// As it is.
        found: String,
    },
    /// It exports what the ABI does not know and what is no immutable global.
    #[error(
        "the module exports \"{name}\" ({kind}): beside its own three exports a plug-in may \
             have immutable globals only"
    )]
    UnexpectedExport {
        /// The export.
        name: String,
        /// Its kind.
        kind: &'static str,
    },
    /// It declares more of something than a host is willing to hold.
    #[error("the module declares {count} {what}, at most {most} are allowed")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many are allowed.
        most: u64,
    },
    /// One of its functions weighs more than [`FUNCTION_WEIGHT`].
    #[error(
        "function {function}, at byte {at}, takes too much compiling (its weight is over \
         {FUNCTION_WEIGHT}): divide it into smaller ones"
    )]
    HeavyFunction {
        /// Where it becomes too heavy, in bytes.
        at: usize,
        /// Its index.
        function: u32,
    },
    /// All of its functions together weigh more than [`MODULE_WEIGHT`].
    #[error(
        "the module takes too much compiling (its weight is over {MODULE_WEIGHT}): build it for \
         size"
    )]
    HeavyModule,
    /// It has no manifest.
    #[error("the custom section \"{MANIFEST_SECTION}\" is missing: is this a plug-in?")]
    ManifestMissing,
    /// It has more than one manifest.
    #[error(
        "the custom section \"{MANIFEST_SECTION}\" stands more than once: link one plug-in \
             into a module"
    )]
    ManifestTwice,
    /// Its manifest breaks a rule.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
}

impl LintError {
    pub(super) fn from_parser(wasm: &[u8], error: &wasmparser::Error) -> Self {
        let message = crate::words::printable(error.message().as_bytes());
        let at = error.offset();
        // The parser's word for an end that comes too early; inside the file the
        // same word means a length that lies.
        if message.contains("unexpected end") && ends_inside_a_section(wasm) {
            return Self::Truncated { at: wasm.len() };
        }
        Self::Invalid { at, message }
    }
}

/// Whether the last section is longer than what is left of the file.
fn ends_inside_a_section(wasm: &[u8]) -> bool {
    let mut at = 8;
    while at < wasm.len() {
        let mut reader = wasmparser::BinaryReader::new(&wasm[at + 1..], at + 1);
        let Ok(length) = reader.read_var_u32() else { return true };
        at = reader.original_position().saturating_add(length as usize);
    }
    at > wasm.len()
}

/// Declared maximum of a memory in pages, or none.
///
/// ```
/// use softplug_host::MemoryMaximum;
///
/// assert_eq!(MemoryMaximum(Some(4)).to_string(), "4");
/// assert_eq!(MemoryMaximum(None).to_string(), "any number");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct MemoryMaximum(pub Option<u64>);

impl fmt::Display for MemoryMaximum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(pages) => pages.fmt(f),
            None => f.write_str("any number"),
        }
    }
}
