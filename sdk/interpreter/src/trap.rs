//! Why a call did not return.

use thiserror::Error;

/// Why a call did not return. What the module did until then stays done.
///
/// ```
/// use softplug_interpreter::{Machine, Module, Room, Trap};
/// use std::sync::Arc;
///
/// let wasm = wat::parse_str("(module (func (export \"run\") (loop (br 0))))")?;
/// let module = Arc::new(Module::load(wasm)?);
/// let run = module.exported_function("run").expect("it is exported");
/// let mut machine = Machine::new(module, Room::default())?;
/// assert_eq!(machine.call(run, &[], &mut 1_000), Err(Trap::OutOfFuel));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum Trap {
    /// It came to where it must not come: a panic of a plug-in ends so.
    #[error("wasm `unreachable` instruction executed")]
    Unreachable,
    /// An address outside the memory, or above what of it is there.
    #[error("out of bounds memory access")]
    MemoryOutOfBounds,
    /// A call through the table, behind its end.
    #[error("undefined element: out of bounds table access")]
    TableOutOfBounds,
    /// A call through an element of the table that was never set.
    #[error("uninitialized element")]
    UninitializedElement,
    /// A call through the table of a function of another type.
    #[error("indirect call type mismatch")]
    IndirectCallType,
    /// A division by zero.
    #[error("integer divide by zero")]
    DivisionByZero,
    /// A result that its type does not hold.
    #[error("integer overflow")]
    IntegerOverflow,
    /// A float that is no number, to be made an integer.
    #[error("invalid conversion to integer")]
    InvalidConversion,
    /// Calls within calls, past the [`Room`](crate::Room).
    #[error("call stack exhausted")]
    StackExhausted,
    /// All its fuel is used.
    #[error("all fuel is used")]
    OutOfFuel,
}
