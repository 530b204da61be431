//! A front-end unit on the board that QEMU emulates as `mps2-an386`: a Cortex-M4 with, as it is used here,
//! 1 MiB of flash and 128 KiB of RAM. `docs/unit/firmware.md` says how to build and run it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
extern crate alloc;

#[cfg(target_os = "none")]
mod chip;
#[cfg(target_os = "none")]
mod figures;
#[cfg(target_os = "none")]
mod flash;
#[cfg(target_os = "none")]
mod heap;
#[cfg(target_os = "none")]
mod ring;
#[cfg(target_os = "none")]
mod run;

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    eprintln!(
        "this is firmware: build it with --target thumbv7em-none-eabihf and run it on a board"
    );
    std::process::ExitCode::FAILURE
}
