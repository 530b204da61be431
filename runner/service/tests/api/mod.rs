//! The HTTP API from outside: who is let in, what can be done, and what cannot be done to it.
#![cfg(target_os = "linux")]

mod checks;
mod exchange;
mod fuzzed;
mod hostile;
mod looking_back;
mod many;
mod streams;
mod tls;
mod tokens;
