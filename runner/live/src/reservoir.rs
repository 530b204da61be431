//! A bounded store of bytes between two threads, with a low and a high mark:
//! one side fills it, the other takes from it, and neither ever waits.
//!
//! It is the buffer between a source and a machine, and the way of what a
//! machine sent to where it is put away. Who finds no room, or nothing, goes on
//! with something else and is woken: the reader as soon as there is something,
//! the writer at the level that it named.

use std::convert::Infallible;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, AtomicUsize, Ordering, fence};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::task::Waker;

use rtrb::{Consumer, Producer, RingBuffer};

/// A store for `size` bytes. The writer of a paced source keeps the level
/// between `low` and `high`; nothing here enforces it.
///
/// ```
/// use softplug_live::reservoir::{Drawn, reservoir};
///
/// let (mut writer, mut reader) = reservoir(16, 4, 12);
/// assert_eq!(writer.write(b"N10 G1 X1 Y1 Z1 F100"), 16);
/// let mut buffer = [0; 10];
/// assert_eq!(reader.read(&mut buffer), Drawn::Bytes(10));
/// assert_eq!((writer.level(), writer.room_to_high()), (6, 6));
/// writer.finish();
/// assert_eq!(reader.read(&mut buffer), Drawn::Bytes(6));
/// assert_eq!(reader.read(&mut buffer), Drawn::End);
/// ```
pub fn reservoir(size: usize, low: usize, high: usize) -> (ReservoirWriter, ReservoirReader) {
    let size = size.max(1);
    let high = high.clamp(1, size);
    let (producer, consumer) = RingBuffer::new(size);
    let shared = Arc::new(Shared {
        size,
        low: low.min(high),
        high,
        written: AtomicU64::new(0),
        read: AtomicU64::new(0),
        ending: AtomicU8::new(OPEN),
        failure: OnceLock::new(),
        reader_waits: AtomicBool::new(false),
        reader_is_gone: AtomicBool::new(false),
        is_stopped: AtomicBool::new(false),
        wake_writer_at: AtomicUsize::new(NEVER),
        reader_waker: Mutex::new(None),
        writer_waker: Mutex::new(None),
        highest: AtomicUsize::new(0),
        lowest: AtomicUsize::new(usize::MAX),
        below_low: AtomicU64::new(0),
        found_empty: AtomicU64::new(0),
    });
    let writer = ReservoirWriter { ring: producer, shared: Arc::clone(&shared) };
    (writer, ReservoirReader { ring: consumer, shared, was_above_low: false })
}

/// Values of `Shared::ending`.
const OPEN: u8 = 0;
const FINISHED: u8 = 1;
const FAILED: u8 = 2;
/// No level at which to wake the writer.
const NEVER: usize = usize::MAX;

#[derive(Debug)]
struct Shared {
    size: usize,
    low: usize,
    high: usize,
    written: AtomicU64,
    read: AtomicU64,
    ending: AtomicU8,
    failure: OnceLock<String>,
    /// The reader found it empty and wants to be woken.
    reader_waits: AtomicBool,
    reader_is_gone: AtomicBool,
    /// Nothing comes for now, and that is meant.
    is_stopped: AtomicBool,
    /// The writer wants to be woken once no more than this is left.
    wake_writer_at: AtomicUsize,
    // Locked when a side is set up and when it is woken, never for each byte.
    reader_waker: Mutex<Option<Waker>>,
    writer_waker: Mutex<Option<Waker>>,
    highest: AtomicUsize,
    /// Lowest level after a read while the source had not ended.
    lowest: AtomicUsize,
    below_low: AtomicU64,
    found_empty: AtomicU64,
}

impl Shared {
    fn level(&self) -> usize {
        let read = self.read.load(Ordering::Relaxed);
        self.written.load(Ordering::Relaxed).saturating_sub(read) as usize
    }

    fn wake_reader(&self) {
        // What was written or ended is seen by a reader that asks to be woken
        // from here on.
        fence(Ordering::SeqCst);
        if self.reader_waits.swap(false, Ordering::SeqCst) {
            wake(&self.reader_waker);
        }
    }

    fn wake_writer(&self, level: usize) {
        fence(Ordering::SeqCst);
        let at = self.wake_writer_at.load(Ordering::SeqCst);
        if at == NEVER || level > at {
            return;
        }
        if self.wake_writer_at.swap(NEVER, Ordering::SeqCst) != NEVER {
            wake(&self.writer_waker);
        }
    }
}

fn wake(waker: &Mutex<Option<Waker>>) {
    if let Some(waker) = waker.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
        waker.wake_by_ref();
    }
}

fn set(place: &Mutex<Option<Waker>>, waker: Waker) {
    *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(waker);
}

/// The side that fills. Dropping it before [`finish`](Self::finish) is a failure of
/// the source: what came is not all.
#[derive(Debug)]
pub struct ReservoirWriter {
    ring: Producer<u8>,
    shared: Arc<Shared>,
}

impl ReservoirWriter {
    /// Nothing more comes for now, and that is meant; or it goes on.
    pub fn stop(&self, is_stopped: bool) {
        self.shared.is_stopped.store(is_stopped, Ordering::Relaxed);
    }

    /// Writes what there is room for and gives how much that was.
    pub fn write(&mut self, bytes: &[u8]) -> usize {
        if bytes.is_empty() {
            return 0;
        }
        let (taken, _) = self.ring.push_partial_slice(bytes);
        let count = taken.len();
        if count > 0 {
            let shared = &self.shared;
            shared.written.fetch_add(count as u64, Ordering::Release);
            shared.highest.fetch_max(shared.level(), Ordering::Relaxed);
            shared.wake_reader();
        }
        count
    }

    /// That was all.
    pub fn finish(&mut self) {
        self.end(FINISHED);
    }

    /// The source failed: what came is not all, and no more will come. `why` is
    /// one sentence for whoever reads.
    pub fn fail(&mut self, why: impl Into<String>) {
        if self.shared.ending.load(Ordering::Relaxed) == OPEN {
            let _ = self.shared.failure.set(why.into());
            self.end(FAILED);
        }
    }

    fn end(&self, how: u8) {
        let ending = &self.shared.ending;
        if ending.compare_exchange(OPEN, how, Ordering::SeqCst, Ordering::SeqCst).is_ok() {
            self.shared.wake_reader();
        }
    }

    /// Bytes that wait to be read.
    pub fn level(&self) -> usize {
        self.shared.level()
    }

    /// Bytes that have been read, of all.
    pub fn consumed(&self) -> u64 {
        self.shared.read.load(Ordering::Acquire)
    }

    /// Bytes that may be written without the level passing the high mark.
    pub fn room_to_high(&self) -> usize {
        self.shared.high.saturating_sub(self.level())
    }

    /// Whether nobody will read any more.
    pub fn is_abandoned(&self) -> bool {
        self.shared.reader_is_gone.load(Ordering::Acquire)
    }

    /// Whom to wake; before [`wake_at`](Self::wake_at).
    pub fn wake_with(&self, waker: Waker) {
        set(&self.shared.writer_waker, waker);
    }

    /// Wakes the writer once, as soon as no more than `level` bytes wait or the
    /// reader is gone. If that is so already, it is woken at once.
    pub fn wake_at(&self, level: usize) {
        self.shared.wake_writer_at.store(level.min(NEVER - 1), Ordering::SeqCst);
        fence(Ordering::SeqCst);
        let now = if self.is_abandoned() { 0 } else { self.level() };
        self.shared.wake_writer(now);
    }

    /// Whether a wake that was asked for is still to come.
    pub fn is_armed(&self) -> bool {
        self.shared.wake_writer_at.load(Ordering::Relaxed) != NEVER
    }

    /// What was counted.
    pub fn figures(&self) -> Gauge {
        Gauge(Arc::clone(&self.shared))
    }
}

impl Drop for ReservoirWriter {
    fn drop(&mut self) {
        self.fail("what fills the buffer has ended before its end");
    }
}

/// What a read found.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Drawn {
    /// So many bytes are in the buffer.
    Bytes(usize),
    /// Nothing now; the reader's waker is called when there is.
    Later,
    /// There is no more.
    End,
    /// There is no more, although that was not all; see
    /// [`failure`](ReservoirReader::failure).
    Failed,
}

/// The side that takes.
#[derive(Debug)]
pub struct ReservoirReader {
    ring: Consumer<u8>,
    shared: Arc<Shared>,
    was_above_low: bool,
}

impl ReservoirReader {
    /// Whether nothing comes for now because the writer means it.
    pub fn is_stopped(&self) -> bool {
        self.shared.is_stopped.load(Ordering::Relaxed)
    }

    /// Reads what is there into `buffer`, which must not be empty.
    pub fn read(&mut self, buffer: &mut [u8]) -> Drawn {
        let Ok(drawn) = self.look_twice(|reader| {
            let count = reader.ring.pop_partial_slice(buffer).0.len();
            reader.took(count);
            Ok::<_, Infallible>(count)
        });
        drawn
    }

    /// Hands what is there to `put`, at most `most` bytes, which is not 0. They count as read, and leave the
    /// buffer, when it has succeeded.
    ///
    /// # Errors
    /// That of `put`.
    pub fn read_into<E>(
        &mut self,
        most: usize,
        mut put: impl FnMut(&[u8]) -> Result<(), E>,
    ) -> Result<Drawn, E> {
        self.look_twice(|reader| {
            let there = reader.ring.slots().min(most);
            let Ok(chunk) = reader.ring.read_chunk(there) else { return Ok(0) };
            let bytes = chunk.as_slices().0;
            let count = bytes.len();
            if count > 0 {
                put(bytes)?;
                chunk.commit(count);
                reader.took(count);
            }
            Ok(count)
        })
    }

    fn took(&mut self, count: usize) {
        if count == 0 {
            return;
        }
        let shared = &self.shared;
        shared.read.fetch_add(count as u64, Ordering::Release);
        let level = shared.level();
        if shared.ending.load(Ordering::Relaxed) == OPEN {
            shared.lowest.fetch_min(level, Ordering::Relaxed);
            if self.was_above_low && level < shared.low {
                shared.below_low.fetch_add(1, Ordering::Relaxed);
            }
        }
        self.was_above_low = level >= shared.low;
        shared.wake_writer(level);
    }

    /// Draws. Where nothing was there: asks to be woken, looks again, and tells why.
    fn look_twice<E>(
        &mut self,
        mut draw: impl FnMut(&mut Self) -> Result<usize, E>,
    ) -> Result<Drawn, E> {
        let count = draw(self)?;
        if count > 0 {
            return Ok(Drawn::Bytes(count));
        }
        self.shared.reader_waits.store(true, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        // First how it ended, then the rest: the other way round bytes that
        // were written in between would be left behind.
        let ending = self.shared.ending.load(Ordering::SeqCst);
        let count = draw(self)?;
        if count > 0 {
            self.shared.reader_waits.store(false, Ordering::SeqCst);
            return Ok(Drawn::Bytes(count));
        }
        Ok(match ending {
            FINISHED => Drawn::End,
            FAILED => Drawn::Failed,
            _ => {
                self.shared.found_empty.fetch_add(1, Ordering::Relaxed);
                Drawn::Later
            }
        })
    }

    /// Why the source failed, if it did.
    pub fn failure(&self) -> Option<&str> {
        self.shared.failure.get().map(String::as_str)
    }

    /// Bytes that wait to be read.
    pub fn level(&self) -> usize {
        self.shared.level()
    }

    /// Whether [`read`](Self::read) would find something else than
    /// [`Drawn::Later`].
    pub fn is_ready(&self) -> bool {
        self.level() > 0 || self.shared.ending.load(Ordering::Acquire) != OPEN
    }

    /// Whom to wake when there is something after [`Drawn::Later`]. Woken at once
    /// if there is already.
    pub fn wake_with(&self, waker: Waker) {
        set(&self.shared.reader_waker, waker);
        self.shared.reader_waits.store(true, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        if self.is_ready() {
            self.shared.wake_reader();
        }
    }

    /// What was counted.
    pub fn figures(&self) -> Gauge {
        Gauge(Arc::clone(&self.shared))
    }
}

impl Drop for ReservoirReader {
    fn drop(&mut self) {
        self.shared.reader_is_gone.store(true, Ordering::SeqCst);
        // Also where the writer did not ask: what it wrote may be put away only now.
        self.shared.wake_writer_at.store(NEVER, Ordering::SeqCst);
        wake(&self.shared.writer_waker);
    }
}

/// Looks at a reservoir from outside, also after both sides have ended.
#[derive(Clone, Debug)]
pub struct Gauge(Arc<Shared>);

impl Gauge {
    /// Bytes that it can hold, its low and its high mark.
    pub fn marks(&self) -> (usize, usize, usize) {
        (self.0.size, self.0.low, self.0.high)
    }

    /// Bytes that wait to be read.
    pub fn level(&self) -> usize {
        self.0.level()
    }

    /// Bytes written so far.
    pub fn written(&self) -> u64 {
        self.0.written.load(Ordering::Relaxed)
    }

    /// Bytes read so far.
    pub fn read(&self) -> u64 {
        self.0.read.load(Ordering::Relaxed)
    }

    /// The highest level so far.
    pub fn highest(&self) -> usize {
        self.0.highest.load(Ordering::Relaxed)
    }

    /// The lowest level that a read left while more was to come.
    pub fn lowest(&self) -> Option<usize> {
        Some(self.0.lowest.load(Ordering::Relaxed)).filter(|level| *level != usize::MAX)
    }

    /// How often the level fell under the low mark while more was to come.
    pub fn below_low(&self) -> u64 {
        self.0.below_low.load(Ordering::Relaxed)
    }

    /// How often a read found nothing while more was to come.
    pub fn found_empty(&self) -> u64 {
        self.0.found_empty.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU32;
    use std::task::Wake;
    use std::thread;

    use super::*;

    #[derive(Default)]
    struct Count(AtomicU32);

    impl Wake for Count {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Ordering::SeqCst);
        }
    }

    impl Count {
        fn of(&self) -> u32 {
            self.0.load(Ordering::SeqCst)
        }
    }

    #[test]
    fn a_reader_that_found_nothing_is_woken_once_and_the_writer_at_its_level() {
        let (mut writer, mut reader) = reservoir(8, 2, 6);
        let (reads, writes) = (Arc::new(Count::default()), Arc::new(Count::default()));
        reader.wake_with(Arc::clone(&reads).into());
        writer.wake_with(Arc::clone(&writes).into());
        let mut buffer = [0; 3];
        assert_eq!(reader.read(&mut buffer), Drawn::Later);
        assert_eq!((writer.write(b"abcd"), writer.write(b"ef")), (4, 2));
        assert_eq!(reads.of(), 1);
        writer.wake_at(2);
        assert_eq!(reader.read(&mut buffer), Drawn::Bytes(3));
        assert_eq!(writes.of(), 0);
        assert_eq!(reader.read(&mut buffer[..1]), Drawn::Bytes(1));
        assert_eq!(writes.of(), 1);
        assert_eq!(reader.read(&mut buffer), Drawn::Bytes(2));
        assert_eq!(writes.of(), 1, "asked for once");
        writer.wake_at(0);
        assert_eq!(writes.of(), 2, "it is so already");
        let figures = writer.figures();
        assert_eq!((figures.highest(), figures.lowest(), figures.below_low()), (6, Some(0), 1));
        assert_eq!((figures.found_empty(), figures.read()), (1, 6));
    }

    #[test]
    fn what_was_written_before_the_end_is_read_before_the_end() {
        let (mut writer, mut reader) = reservoir(8, 0, 8);
        writer.write(b"ab");
        writer.fail("the disk is gone");
        writer.finish();
        let mut buffer = [0; 8];
        assert_eq!(reader.read(&mut buffer), Drawn::Bytes(2));
        assert_eq!(reader.read(&mut buffer), Drawn::Failed);
        assert_eq!(reader.failure(), Some("the disk is gone"));
        drop(reader);
        assert!(writer.is_abandoned());

        let (mut writer, mut reader) = reservoir(8, 0, 8);
        writer.write(b"a");
        drop(writer);
        assert_eq!(reader.read(&mut buffer), Drawn::Bytes(1));
        assert_eq!(reader.read(&mut buffer), Drawn::Failed);
    }

    #[test]
    fn what_could_not_be_put_anywhere_is_not_read() {
        let (mut writer, mut reader) = reservoir(8, 0, 8);
        writer.write(b"abc");
        assert_eq!(reader.read_into(8, |_| Err("full")), Err("full"));
        assert_eq!((reader.level(), writer.consumed()), (3, 0));
        let mut got = Vec::new();
        let mut put = |bytes: &[u8]| {
            got.extend_from_slice(bytes);
            Ok::<_, &str>(())
        };
        assert_eq!(reader.read_into(2, &mut put), Ok(Drawn::Bytes(2)));
        assert_eq!(writer.consumed(), 2);
        writer.write(b"defgh");
        writer.finish();
        while let Ok(Drawn::Bytes(_)) = reader.read_into(8, &mut put) {}
        assert_eq!(got, b"abcdefgh");
    }

    #[test]
    fn two_threads_that_sleep_until_woken_pass_every_byte() {
        struct Unpark(thread::Thread);
        impl Wake for Unpark {
            fn wake(self: Arc<Self>) {
                self.0.unpark();
            }
        }
        const BYTES: usize = 1_000_000;
        let (mut writer, mut reader) = reservoir(64, 16, 48);
        let filler = thread::spawn(move || {
            writer.wake_with(Arc::new(Unpark(thread::current())).into());
            let mut sent = 0;
            while sent < BYTES {
                let chunk: Vec<u8> = (sent..BYTES.min(sent + 23)).map(|n| n as u8).collect();
                let count = writer.write(&chunk[..chunk.len().min(writer.room_to_high())]);
                sent += count;
                if count == 0 {
                    writer.wake_at(40);
                    thread::park();
                }
            }
            writer.finish();
            writer.figures().highest()
        });
        reader.wake_with(Arc::new(Unpark(thread::current())).into());
        let mut buffer = [0; 17];
        let mut received = 0;
        loop {
            match reader.read(&mut buffer) {
                Drawn::Bytes(count) => {
                    for byte in &buffer[..count] {
                        assert_eq!(*byte, received as u8);
                        received += 1;
                    }
                }
                Drawn::Later => thread::park(),
                end => {
                    assert_eq!(end, Drawn::End);
                    break;
                }
            }
        }
        assert_eq!(received, BYTES);
        assert!(filler.join().unwrap() <= 48, "over the high mark");
    }
}
