//! The terminals that this process has open, for an end that waits for nothing.

use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use rustix::termios::{QueueSelector, tcflush};

static OPEN: Mutex<Vec<Weak<OwnedFd>>> = Mutex::new(Vec::new());

/// Notes one that is open now.
pub(super) fn note(terminal: &Arc<OwnedFd>) {
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    open.retain(|terminal| terminal.strong_count() > 0);
    open.push(Arc::downgrade(terminal));
}

/// Drops what every serial port of this process has taken and not sent.
///
/// A process that ends without closing its ports leaves that to the kernel, which waits up to
/// 30 s for a UART that the machine holds: whoever ends at once calls this before.
///
/// ```
/// softplug_live::port::discard_all();
/// ```
pub fn discard_all() {
    let open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    for terminal in open.iter().filter_map(Weak::upgrade) {
        // One that is gone holds nothing.
        let _ = tcflush(&*terminal, QueueSelector::OFlush);
    }
}
