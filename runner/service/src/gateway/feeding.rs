//! A job whose data comes from outside while it runs.

use std::io;

/// Takes the data of a job, as fast as the machine does.
///
/// [`write`](io::Write::write) blocks while the link's buffer is full, and fails
/// when the job has ended. Without [`finish`](Self::finish) the job fails: data that
/// ended in the middle is no whole program.
#[derive(Debug)]
pub struct Feeding {
    _private: (),
}

impl Feeding {
    /// All of the data was written.
    pub fn finish(self) {}
}

impl io::Write for Feeding {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = bytes;
        Err(io::ErrorKind::BrokenPipe.into())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
