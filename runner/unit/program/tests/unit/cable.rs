//! The bus between gateway and unit: passes frames on, unless somebody pulls it out or it is a bad one.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_unit_protocol::{HEADER, length_of_frame};

/// It listens for the gateway and connects to the unit, wherever that is now.
pub(crate) struct Cable {
    address: SocketAddr,
    shared: Arc<Shared>,
}

/// What a bad bus does to frames.
struct Faults {
    random: ChaCha8Rng,
    /// Of 1,000 frames.
    rate: u32,
    count: u32,
}

/// What becomes of a frame.
enum Fate {
    Passes,
    Lost,
    Doubled,
    /// Until behind the next one.
    Late,
    Delayed,
    Damaged,
    /// The connection ends with it.
    Cut,
}

impl Faults {
    fn fate(&mut self) -> Fate {
        if self.random.next_u32() % 1_000 >= self.rate {
            return Fate::Passes;
        }
        self.count += 1;
        match self.random.next_u32() % 50 {
            0..20 => Fate::Lost,
            20..28 => Fate::Doubled,
            28..36 => Fate::Late,
            36..42 => Fate::Delayed,
            42..49 => Fate::Damaged,
            _ => Fate::Cut,
        }
    }
}

struct Shared {
    /// What passes is no frames that could be told apart: all of it, as it is on the wire.
    wire: Option<Mutex<Vec<u8>>>,
    faults: Mutex<Option<Faults>>,
    unit: Mutex<SocketAddr>,
    open: Mutex<Vec<TcpStream>>,
    is_held: AtomicBool,
    /// A byte of what passes next is altered.
    alters: AtomicBool,
    is_gone: AtomicBool,
}

impl Cable {
    pub(crate) fn new(unit: SocketAddr) -> Self {
        Self::with(unit, None)
    }

    /// Passes on whatever comes, and keeps it.
    pub(crate) fn tapped(unit: SocketAddr) -> Self {
        Self::with(unit, Some(Mutex::default()))
    }

    fn with(unit: SocketAddr, wire: Option<Mutex<Vec<u8>>>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Arc::new(Shared {
            wire,
            faults: Mutex::new(None),
            unit: Mutex::new(unit),
            open: Mutex::default(),
            is_held: AtomicBool::new(false),
            alters: AtomicBool::new(false),
            is_gone: AtomicBool::new(false),
        });
        let its = Arc::clone(&shared);
        thread::spawn(move || {
            for near in listener.incoming() {
                if its.is_gone.load(Ordering::SeqCst) {
                    return;
                }
                if its.is_held.load(Ordering::SeqCst) {
                    continue;
                }
                let (Ok(near), Ok(far)) = (near, TcpStream::connect(*its.unit.lock().unwrap()))
                else {
                    continue;
                };
                let both = [near.try_clone().unwrap(), far.try_clone().unwrap()];
                its.open.lock().unwrap().extend(both);
                pass(&its, near.try_clone().unwrap(), far.try_clone().unwrap());
                pass(&its, far, near);
            }
        });
        Self { address, shared }
    }

    /// Alters a byte of what passes next; once that has come about, `false`.
    pub(crate) fn alter(&self, alters: bool) -> bool {
        self.shared.alters.fetch_or(alters, Ordering::SeqCst)
    }

    /// What has passed both ways.
    pub(crate) fn wire(&self) -> Vec<u8> {
        self.shared.wire.as_ref().unwrap().lock().unwrap().clone()
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// From now on so many of 1,000 frames meet with a fault.
    pub(crate) fn is_bad(&self, seed: u64, rate: u32) {
        let random = ChaCha8Rng::seed_from_u64(seed);
        *self.shared.faults.lock().unwrap() = Some(Faults { random, rate, count: 0 });
    }

    /// How many faults there were.
    pub(crate) fn faults(&self) -> u32 {
        self.shared.faults.lock().unwrap().as_ref().map_or(0, |faults| faults.count)
    }

    /// It leads to another unit from now on.
    pub(crate) fn leads_to(&self, unit: SocketAddr) {
        *self.shared.unit.lock().unwrap() = unit;
        self.cut();
    }

    /// Out, and in again.
    pub(crate) fn cut(&self) {
        for stream in self.shared.open.lock().unwrap().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    /// Out, until it is in again.
    pub(crate) fn hold(&self, is_held: bool) {
        self.shared.is_held.store(is_held, Ordering::SeqCst);
        if is_held {
            self.cut();
        }
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.shared.is_gone.store(true, Ordering::SeqCst);
        self.cut();
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
    }
}

fn pass(shared: &Arc<Shared>, mut from: TcpStream, mut to: TcpStream) {
    let shared = Arc::clone(shared);
    thread::spawn(move || {
        if let Some(wire) = &shared.wire {
            pass_all(wire, &shared.alters, &mut from, &mut to);
        }
        let mut late = Vec::new();
        while let Some(mut frame) = next_frame(&mut from) {
            let fate = shared.faults.lock().unwrap().as_mut().map_or(Fate::Passes, Faults::fate);
            let mut times = 1;
            match fate {
                Fate::Passes => {}
                Fate::Lost => times = 0,
                Fate::Doubled => times = 2,
                Fate::Late => {
                    late.push(frame);
                    continue;
                }
                Fate::Delayed => thread::sleep(Duration::from_millis(80)),
                // Not in the head: there, a stream cannot go on.
                Fate::Damaged => *frame.last_mut().unwrap() ^= 0x10,
                Fate::Cut => break,
            }
            let sent = (0..times).try_for_each(|_| to.write_all(&frame));
            let sent =
                sent.and_then(|()| late.drain(..).try_for_each(|frame| to.write_all(&frame)));
            if sent.is_err() {
                break;
            }
        }
        let _ = from.shutdown(Shutdown::Both);
        let _ = to.shutdown(Shutdown::Both);
    });
}

fn pass_all(wire: &Mutex<Vec<u8>>, alters: &AtomicBool, from: &mut TcpStream, to: &mut TcpStream) {
    let mut bytes = [0; 4_096];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        wire.lock().unwrap().extend_from_slice(&bytes[..count]);
        if alters.swap(false, Ordering::SeqCst) {
            bytes[count - 1] ^= 1;
        }
        if to.write_all(&bytes[..count]).is_err() {
            return;
        }
    }
}

fn next_frame(from: &mut TcpStream) -> Option<Vec<u8>> {
    let mut frame = vec![0; HEADER];
    from.read_exact(&mut frame).ok()?;
    let length = length_of_frame(&frame).ok()??;
    frame.resize(length, 0);
    from.read_exact(&mut frame[HEADER..]).ok()?;
    Some(frame)
}
