//! A machine at the other end of a pty that counts what it gets, and says stop and go.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// Longer than anything here takes; only a hang gets there.
const HANG: Duration = Duration::from_mins(1);

/// A machine that takes all that comes.
pub(crate) struct Machine {
    pub(crate) port: String,
    pty: Arc<PtyPair>,
    received: Arc<Mutex<Vec<u8>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Machine {
    pub(crate) fn start() -> Self {
        let pty = Arc::new(PtyPair::open().unwrap());
        let port = pty.slave_path().display().to_string();
        let (received, stop) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let thread = thread::spawn({
            let (pty, received, stop) =
                (Arc::clone(&pty), Arc::clone(&received), Arc::clone(&stop));
            move || {
                let mut buffer = [0; 4_096];
                while !stop.load(Ordering::Relaxed) {
                    if let ReadOutcome::Read(count) = pty.read(&mut buffer).unwrap() {
                        let is_data = |byte: &&u8| !matches!(**byte, XON | XOFF);
                        lock(&received).extend(buffer[..count].iter().filter(is_data));
                    }
                    thread::sleep(Duration::from_millis(2));
                }
            }
        });
        Self { port, pty, received, stop, thread: Some(thread) }
    }

    /// Bytes of the program that it has.
    pub(crate) fn count(&self) -> u64 {
        lock(&self.received).len() as u64
    }

    pub(crate) fn received(&self) -> Vec<u8> {
        lock(&self.received).clone()
    }

    /// Waits until it has so many.
    #[track_caller]
    pub(crate) fn has(&self, count: u64) {
        let began = Instant::now();
        while self.count() < count {
            assert!(began.elapsed() < HANG, "it has {} bytes, not {count}", self.count());
            thread::sleep(Duration::from_millis(2));
        }
    }

    pub(crate) fn hold(&self) {
        assert_eq!(self.pty.write(&[XOFF]).unwrap(), 1);
    }

    /// It sends of its own accord.
    pub(crate) fn send(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            bytes = &bytes[self.pty.write(bytes).unwrap()..];
            thread::sleep(Duration::from_millis(2));
        }
    }

    pub(crate) fn release(&self) {
        assert_eq!(self.pty.write(&[XON]).unwrap(), 1);
    }
}

fn lock(received: &Mutex<Vec<u8>>) -> MutexGuard<'_, Vec<u8>> {
    received.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Machine {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
