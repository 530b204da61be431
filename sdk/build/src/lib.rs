//! Between a compiler and a plug-in: what is done with a module before anyone loads it.
//!
//! [`shrink`] makes a module smaller without changing what it does, [`pack`](fn@pack) puts a manifest into
//! it, [`Size`] tells what its bytes are spent on. Nothing here runs a module, and whether it is
//! a plug-in is for a host to say.
//!
//! ```
//! use softplug_build::{Kind, Size, Strip, pack, sections};
//!
//! let module = b"\0asm\x01\0\0\0";
//! let packed = pack(module, br#"{"abi":"1.0"}"#, Strip::Nothing).unwrap();
//! let sections = sections(&packed).unwrap();
//! assert_eq!(sections[0].kind, Kind::Custom("softplug.manifest"));
//! assert_eq!(Size::of("x", &packed).total, packed.len());
//! ```

mod exports;
mod memory;
mod names;
mod optimize;
mod pack;
mod sections;
mod size;

pub use optimize::{OptimizeError, Optimizer};
pub use pack::{Strip, pack, without_spaces};
pub use sections::{Kind, Pages, Section, memory, sections};
pub use size::Size;

/// The custom section that holds a plug-in's manifest.
const MANIFEST: &str = "softplug.manifest";

/// A module could not be made smaller.
///
/// The example of [`shrink`] shows one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShrinkError {
    /// It is no module, or only a part of one.
    #[error("it is not a whole module: delete it and build again")]
    Damaged,
    /// The optimiser failed.
    #[error(transparent)]
    Optimize(#[from] OptimizeError),
}

/// The module, smaller: functions of the compiler that have a small substitute, exports that the
/// ABI does not know, long names, and sections that only tools look at. The optimiser, where there is one, does
/// the rest.
///
/// ```
/// use softplug_build::{Optimizer, ShrinkError, shrink};
///
/// let module = wat::parse_str(
///     r#"(module (memory (export "memory") 1 1) (global (export "__heap_base") i32 i32.const 64)
///         (func $_ZN4echo7receive17h0cb7f5948bc9dfb4E (export "softplug_v1") unreachable))"#,
/// )?;
/// // Without wasm-opt, which is not on every machine.
/// let small = shrink(&module, None)?;
/// assert!(small.len() < module.len());
/// // With it, where it is.
/// let smaller = shrink(&module, Optimizer::find().as_ref())?;
/// assert!(smaller.len() <= small.len());
/// assert!(matches!(shrink(b"\0asm", None), Err(ShrinkError::Damaged)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// It is not a whole module, or the optimiser does not take it.
pub fn shrink(module: &[u8], optimizer: Option<&Optimizer>) -> Result<Vec<u8>, ShrinkError> {
    let small = memory::make_small(module).and_then(|module| exports::strip(&module));
    let mut module = small.ok_or(ShrinkError::Damaged)?;
    if let Some(optimizer) = optimizer {
        module = optimizer.optimize(&module)?;
    }
    names::shorten(&module).ok_or(ShrinkError::Damaged)
}
