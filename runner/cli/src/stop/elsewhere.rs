//! Where a signal is only an interrupt of the console: Ctrl-C and Ctrl-Break.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::exit::Exit;
use crate::failure::Failure;

/// A flag that a signal sets.
pub(crate) fn on_signals() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let failed = |error| Failure::internal(format_args!("failed to listen for signals: {error}"));
    let code = i32::from(Exit::Incomplete.code());
    for signal in [SIGINT, SIGTERM] {
        // In this order: the second one finds what the first has set.
        flag::register_conditional_shutdown(signal, code, Arc::clone(&stop)).map_err(failed)?;
        flag::register(signal, Arc::clone(&stop)).map_err(failed)?;
    }
    Ok(stop)
}
