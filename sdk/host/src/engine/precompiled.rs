//! The one place where machine code from a file is trusted.
#![allow(unsafe_code)]
// wasmtime runs what it deserializes as it is: code that was tampered with could
// do anything that this process can, so the call is unsafe. It is sound here
// because a `VerifiedCode` is only made in two ways. `cache::Cache::read` makes one from a file
// that (1) belongs to this user, in a directory of this user, neither being
// writable by others, (2) carries the key of this module, engine version and
// settings, and (3) matches its own SHA-256. Whoever can forge such a file can
// also replace the program itself. `compiler::compile` makes one from what the process that it has
// started, as a rule this same program, has written to a pipe that only the two have, with the
// same key and checksum; a compiler that a module leads astray would do the same harm in
// this process. wasmtime checks version and settings again.

use super::cache::VerifiedCode;
use wasmtime::{Engine, Module, Result};

pub(super) fn load(engine: &Engine, code: &VerifiedCode) -> Result<Module> {
    // SAFETY: `code` was written by this user's own host from `Module::serialize`
    // and is unchanged since, as the comment above says.
    unsafe { Module::deserialize(engine, code.as_bytes()) }
}
