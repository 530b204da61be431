//! Signals of Unix: nothing is waited for at the second.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;
use signal_hook::iterator::Signals;
use signal_hook::low_level::exit;

use crate::exit::Exit;
use crate::failure::Failure;

/// A flag that a signal sets.
pub(crate) fn on_signals() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let failed = |error| Failure::internal(format_args!("failed to listen for signals: {error}"));
    // A terminal that is closed sends SIGHUP from the shell and from the kernel: a second one says
    // nothing new. Who started this with nohup wants it to go on.
    let asks = [SIGINT, SIGTERM, SIGHUP].into_iter();
    let asks: Vec<_> = asks.filter(|signal| *signal != SIGHUP || !is_ignored(SIGHUP)).collect();
    for signal in &asks {
        flag::register(*signal, Arc::clone(&stop)).map_err(failed)?;
    }
    let signals = Signals::new(&asks).map_err(failed)?;
    std::thread::spawn(move || end_at_the_second(signals));
    Ok(stop)
}

/// Waits for nothing: neither for whatever else goes on, nor for a port that the machine holds.
fn end_at_the_second(mut signals: Signals) {
    if signals.forever().skip(1).any(|signal| signal != SIGHUP) {
        #[cfg(target_os = "linux")]
        softplug_live::port::discard_all();
        exit(i32::from(Exit::Incomplete.code()));
    }
}

/// Whether the signal is ignored, as nohup has it; where the system does not tell, not.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    is_in_mask(&status, signal)
}

/// Whether the signal is in the mask of ignored ones that a process's status shows.
fn is_in_mask(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read_from_the_mask() {
        let status = "Name:\tsoftplug\nSigBlk:\tffffffffffffffff\nSigIgn:\t0000000000001001\n";
        assert!(is_in_mask(status, SIGHUP));
        assert!(!is_in_mask(status, SIGINT));
        assert!(!is_in_mask("", SIGHUP));
    }
}
