//! The other end of a serial line: always read, so that the guest never waits for it, and in the
//! test's hands.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;

use crate::HANG;

/// Who sits at the other end.
pub trait Partner: Send + 'static {
    /// Gives what it answers to these characters, at once.
    fn answer(&mut self, came: &[u8]) -> Vec<u8>;
}

impl<F: FnMut(&[u8]) -> Vec<u8> + Send + 'static> Partner for F {
    fn answer(&mut self, came: &[u8]) -> Vec<u8> {
        self(came)
    }
}

/// One line's other end.
pub struct Wire {
    shared: Arc<Shared>,
    say: Sender<Vec<u8>>,
}

#[derive(Default)]
struct Shared {
    line: Mutex<Line>,
    changed: Condvar,
}

#[derive(Default)]
struct Line {
    seen: Vec<u8>,
    partner: Option<Box<dyn Partner>>,
}

impl Wire {
    pub(crate) fn new(stream: UnixStream) -> Self {
        let shared = Arc::new(Shared::default());
        let (say, said) = channel::<Vec<u8>>();
        let mut out = stream.try_clone().unwrap();
        // Apart from the reading: a guest that takes nothing must not keep its own characters.
        thread::spawn(move || {
            for bytes in said {
                if out.write_all(&bytes).is_err() {
                    break;
                }
            }
        });
        let (reader, answers) = (Arc::clone(&shared), say.clone());
        thread::spawn(move || read(stream, &reader, &answers));
        Self { shared, say }
    }

    /// What has come of the guest so far.
    pub fn seen(&self) -> Vec<u8> {
        self.shared.line.lock().unwrap().seen.clone()
    }

    /// Forgets what has come, and gives it.
    pub fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.shared.line.lock().unwrap().seen)
    }

    /// Sends to the guest.
    pub fn say(&self, bytes: &[u8]) {
        // A machine that is gone hears nothing.
        let _ = self.say.send(bytes.to_vec());
    }

    /// From now on this partner answers; what came before, it does not hear.
    pub fn answer_with(&self, partner: impl Partner) {
        self.shared.line.lock().unwrap().partner = Some(Box::new(partner));
    }

    /// From now on nobody answers.
    pub fn fall_silent(&self) {
        self.shared.line.lock().unwrap().partner = None;
    }

    /// Waits until this holds of what has come, and gives that.
    #[track_caller]
    pub fn until(&self, what: &str, there: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        let line = self.shared.line.lock().unwrap();
        let waited = self.shared.changed.wait_timeout_while(line, HANG, |line| !there(&line.seen));
        let (line, timeout) = waited.unwrap();
        let tail = &line.seen[line.seen.len().saturating_sub(64)..];
        assert!(
            !timeout.timed_out(),
            "{what} did not come; {} characters came, the last of them {tail:02X?}",
            line.seen.len()
        );
        line.seen.clone()
    }

    /// Waits until so many characters have come.
    #[track_caller]
    pub fn until_count(&self, count: usize) -> Vec<u8> {
        self.until(&format!("character {count}"), |seen| seen.len() >= count)
    }
}

fn read(mut stream: UnixStream, shared: &Shared, answers: &Sender<Vec<u8>>) {
    let mut buffer = [0; 16_384];
    while let Ok(count) = stream.read(&mut buffer) {
        if count == 0 {
            return;
        }
        let came = &buffer[..count];
        let mut line = shared.line.lock().unwrap();
        line.seen.extend_from_slice(came);
        let answer = line.partner.as_mut().map(|partner| partner.answer(came));
        drop(line);
        shared.changed.notify_all();
        if let Some(answer) = answer.filter(|answer| !answer.is_empty()) {
            // A machine that is gone hears nothing.
            let _ = answers.send(answer);
        }
    }
}
