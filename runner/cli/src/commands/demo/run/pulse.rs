//! How late this computer is: what a simulated machine shows on one that is busy
//! elsewhere proves nothing.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use softplug_abi::Micros;

const BEAT: Duration = Duration::from_millis(1);

/// A thread that wants to wake up each millisecond.
pub(super) struct Pulse {
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Shared {
    /// The latest that it was, in µs.
    latest: AtomicU64,
    is_over: AtomicBool,
}

impl Pulse {
    pub(super) fn start() -> Self {
        let shared = Arc::new(Shared::default());
        let beating = Arc::clone(&shared);
        thread::spawn(move || {
            while !beating.is_over.load(Ordering::Relaxed) {
                let before = Instant::now();
                thread::sleep(BEAT);
                let late = before.elapsed().saturating_sub(BEAT).as_micros() as u64;
                beating.latest.fetch_max(late, Ordering::Relaxed);
            }
        });
        Self { shared }
    }

    /// A simulated machine was so late itself.
    pub(super) fn saw(&self, late: Micros) {
        self.shared.latest.fetch_max(late.0.max(0) as u64, Ordering::Relaxed);
    }

    /// The latest since this was asked before.
    pub(super) fn latest(&self) -> Duration {
        Duration::from_micros(self.shared.latest.swap(0, Ordering::Relaxed))
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        self.shared.is_over.store(true, Ordering::Relaxed);
    }
}
