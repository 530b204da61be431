//! Runs a plug-in where it lies: an interpreter for WebAssembly 1.0 that works on the module's own bytes.
//!
//! Nothing is translated. [`Module::load`] validates the module and notes for each branch where it
//! goes, eight bytes each; the code stays where it is, in flash if need be. [`Machine`] runs it, with a
//! stack of fixed size, a bound on what it computes, and as many bytes of memory as it is given.
//! [`Session`] makes a plug-in of it that takes events.
//!
//! There are no imports and no start function, and a memory never grows: the ABI knows neither.
//!
//! ```
//! use softplug_interpreter::{Machine, Module, Room};
//! use std::sync::Arc;
//!
//! let wasm = wat::parse_str(
//!     "(module (memory 1 1) (func (export \"add\") (param i32 i32) (result i32)
//!         (i32.add (local.get 0) (local.get 1))))",
//! )?;
//! let module = Arc::new(Module::load(wasm)?);
//! let add = module.exported_function("add").expect("it is exported");
//! let mut machine = Machine::new(module, Room::default())?;
//! let mut fuel = 1_000;
//! assert_eq!(machine.call(add, &[40, 2], &mut fuel), Ok(Some(42)));
//! // Two reads, the addition, the end.
//! assert_eq!(fuel, 996);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod float;
mod invalid;
mod load;
mod machine;
mod module;
mod opcode;
mod reader;
mod run;
mod session;
mod tables;
mod trap;
mod validate;

pub use invalid::{Invalid, InvalidReason};
pub use machine::{Machine, Room, StartError};
pub use module::{Function, Module, custom_section};
pub use session::{Session, SessionFault};
pub use tables::ValueType;
pub use trap::Trap;
