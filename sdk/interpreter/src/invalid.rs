//! Why a module is not loaded, and where.

use thiserror::Error;

/// Why a module is not loaded, and where.
///
/// ```
/// use softplug_interpreter::{InvalidReason, Module};
///
/// let error = Module::load(&b"\0asm\x01\0\0\0\x01"[..]).unwrap_err();
/// assert_eq!((error.at, error.reason), (9, InvalidReason::CutOff));
/// assert_eq!(error.to_string(), "at byte 9: it is cut off");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("at byte {at}: {reason}")]
pub struct Invalid {
    /// Bytes from the start of the module.
    pub at: usize,
    /// What is wrong there.
    pub reason: InvalidReason,
}

/// What is wrong with a module.
///
/// [`Invalid`] has an example.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum InvalidReason {
    /// It does not begin as a module of version 1 does.
    #[error("it is no WebAssembly module")]
    NotAModule,
    /// It, or a part of it, ends too early.
    #[error("it is cut off")]
    CutOff,
    /// A part does not end where it should.
    #[error("a part is longer than what is in it")]
    Surplus,
    /// A number that its type does not hold.
    #[error("a number is too large")]
    Number,
    /// A name that is not UTF-8.
    #[error("a name is not UTF-8")]
    Name,
    /// A section that there is not, twice, or out of order.
    #[error("a section is unknown, out of order or twice there")]
    Section,
    /// Imports, which a plug-in has none of.
    #[error("it has imports")]
    Imports,
    /// A start function, which a plug-in has none of.
    #[error("it has a start function")]
    StartFunction,
    /// A type that version 1.0 does not have.
    #[error("a type is unknown")]
    Type,
    /// More of something than the ABI allows, or than the tables hold.
    #[error("there is more of it than the limits allow")]
    TooMany,
    /// A memory or a table whose limits are not in order.
    #[error("the limits are not in order")]
    Limits,
    /// An index of something that there is not.
    #[error("an index leads nowhere")]
    Index,
    /// Two exports have one name.
    #[error("a name is exported twice")]
    ExportedTwice,
    /// An initial value that is no constant of its type.
    #[error("an initial value is no constant of its type")]
    Constant,
    /// An operator that version 1.0 does not have.
    #[error("an operator is unknown")]
    Operator,
    /// An operand is missing, or has another type.
    #[error("an operand is missing or has another type")]
    Operand,
    /// Values are left at the end of a block.
    #[error("a block leaves more than its result")]
    Height,
    /// An alignment over an access' size.
    #[error("an alignment is larger than what is accessed")]
    Alignment,
    /// `else` without `if`, or an `if` with a result and no `else`.
    #[error("an if and its else do not fit together")]
    Else,
    /// A global that cannot be written.
    #[error("a global cannot be written")]
    Immutable,
}
