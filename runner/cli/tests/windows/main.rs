//! The command built for Windows, run by wine: `cargo xtask test --windows` builds it and says
//! where it is.
#![cfg(target_os = "linux")]

mod wine;

/// The tests that need wine, and a command that was built for Windows.
mod needs_wine {
    mod com;
    mod files;
    mod tcp;
}
