//! An emulated computer with Debian's kernel and its own serial drivers, in which tests run the
//! built command: a 16550A (`/dev/ttyS1`) and, once it is plugged in, an FTDI adapter
//! (`/dev/ttyUSB0`). The other end of each wire is in the test's hands.
//!
//! `cargo xtask test --emulated` makes what the computer boots from and names the folder in
//! `SOFTPLUG_EMULATED`. The first test boots, which takes 5 to 40 s; what it then is in memory is
//! kept in that folder, and every [`Machine`] goes on from there, in under a second and with
//! nothing of another test in it.
//!
//! The emulated UART has no rate: characters pass as fast as they are taken. It shows no parity
//! or framing errors and no changes of modem lines; the adapter knows no breaks and ignores XOFF.
//!
//! Everything here panics when it goes wrong: it is for tests.

mod console;
mod machine;
mod qemu;
mod qmp;
mod wire;

pub use self::console::Ran;
pub use self::machine::{Machine, Process};
pub use self::wire::{Partner, Wire};

use std::time::Duration;

/// Longer than anything takes on a loaded computer; only a hang gets there.
pub const HANG: Duration = Duration::from_mins(3);
