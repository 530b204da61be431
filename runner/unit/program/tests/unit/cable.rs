//! The bus between gateway and unit: passes bytes on, unless somebody pulls it out.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

/// It listens for the gateway and connects to the unit, wherever that is now.
pub(crate) struct Cable {
    address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    unit: Mutex<SocketAddr>,
    open: Mutex<Vec<TcpStream>>,
    is_held: AtomicBool,
    is_gone: AtomicBool,
}

impl Cable {
    pub(crate) fn new(unit: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Arc::new(Shared {
            unit: Mutex::new(unit),
            open: Mutex::default(),
            is_held: AtomicBool::new(false),
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
                pass(near.try_clone().unwrap(), far.try_clone().unwrap());
                pass(far, near);
            }
        });
        Self { address, shared }
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
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

fn pass(mut from: TcpStream, mut to: TcpStream) {
    thread::spawn(move || {
        let mut buffer = [0; 4_096];
        while let Ok(count @ 1..) = from.read(&mut buffer) {
            if to.write_all(&buffer[..count]).is_err() {
                break;
            }
        }
        let _ = from.shutdown(Shutdown::Both);
        let _ = to.shutdown(Shutdown::Both);
    });
}
