//! A simulated device server of RFC 2217 with a simulated machine behind it, in
//! real time, on a thread of its own.

mod uart;
mod worker;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rfc2217::{PortSettings, Purge};
use rustix::net::sockopt;
use softplug_machines::{Partner, Signal};

use crate::clock::Clock;
use crate::error::PortError;
use crate::poll::{Poller, Waker};
use worker::{Command, Worker};

/// What the server's TCP takes in before anybody reads.
const RECEIVE_BUFFER: usize = 16_384;

/// What a device server has seen of its client.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Seen {
    /// A client has come.
    Connected,
    /// It is gone.
    Disconnected,
    /// A second one was sent away.
    Busy,
    /// The port was set.
    Settings(PortSettings),
    /// Data terminal ready was set.
    Dtr(bool),
    /// Request to send was set.
    Rts(bool),
    /// A break began or ended.
    Break(bool),
    /// Buffers were to be dropped.
    Purge(Purge),
}

/// A device server with one serial port and a machine on it. The machine is
/// driven as its port is set; the port has a buffer of 1,024 bytes each way and,
/// where it is told to, obeys XON/XOFF itself.
#[derive(Debug)]
pub struct DeviceServer<P> {
    address: SocketAddr,
    commands: Sender<Command>,
    waker: Waker,
    seen: Arc<Log>,
    thread: Option<JoinHandle<Result<P, PortError>>>,
}

impl<P: Partner + Send + 'static> DeviceServer<P> {
    /// Listens at `address`, whose port may be 0, with a machine on the port. A
    /// machine of an earlier server goes on with its own time from zero.
    pub fn start(address: SocketAddr, machine: P) -> Result<Self, PortError> {
        let failed = |error: io::Error| PortError::io("start the device server", error);
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        // The connections inherit it: such servers have little memory.
        sockopt::set_socket_recv_buffer_size(&listener, RECEIVE_BUFFER)
            .map_err(|error| failed(error.into()))?;
        let address = listener.local_addr().map_err(failed)?;
        let poller = Poller::new(Clock::start())?;
        let waker = poller.waker();
        let (commands, inbox) = channel();
        let seen = Arc::new(Log::default());
        let worker = Worker::new(listener, machine, poller, inbox, Arc::clone(&seen));
        let thread = std::thread::Builder::new()
            .name("device-server".to_owned())
            .spawn(move || worker.run())
            .map_err(failed)?;
        Ok(Self { address, commands, waker, seen, thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What it has seen so far.
    pub fn seen(&self) -> Vec<Seen> {
        self.seen.lock().clone()
    }

    /// Waits until `is_enough` of what it has seen; whether that came within
    /// `patience`.
    pub fn wait_until(&self, patience: Duration, is_enough: impl Fn(&[Seen]) -> bool) -> bool {
        let end = Instant::now() + patience;
        let mut seen = self.seen.lock();
        while !is_enough(&seen) {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            let waited = self.seen.news.wait_timeout(seen, left);
            seen = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    /// Lets the line bring this, as if from the machine.
    pub fn inject(&self, signal: Signal) {
        self.command(Command::Inject(signal));
    }

    /// Asks the client for a pause, or ends it.
    pub fn suspend(&self, on: bool) {
        self.command(Command::Suspend(on));
    }

    /// Stops serving the client without closing its connection, or goes on.
    pub fn hang(&self, on: bool) {
        self.command(Command::Hang(on));
    }

    /// Ends the client's connection as a crash would.
    pub fn drop_client(&self) {
        self.command(Command::DropClient);
    }

    /// Ends the server as a crash would and gives its machine, for the next.
    pub fn kill(mut self) -> Result<P, PortError> {
        self.command(Command::Kill);
        let ended = self.thread.take().map(JoinHandle::join);
        match ended {
            Some(Ok(ended)) => ended,
            _ => Err(PortError::io("run the device server", io::Error::other("it panicked"))),
        }
    }

    fn command(&self, command: Command) {
        // A server that has ended by itself takes no commands; `kill` tells why.
        let _ = self.commands.send(command);
        self.waker.wake();
    }
}

impl<P> Drop for DeviceServer<P> {
    fn drop(&mut self) {
        let _ = self.commands.send(Command::Kill);
        self.waker.wake();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What was seen, for whoever waits for it.
#[derive(Debug, Default)]
struct Log {
    seen: Mutex<Vec<Seen>>,
    news: Condvar,
}

impl Log {
    fn lock(&self) -> MutexGuard<'_, Vec<Seen>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, seen: Seen) {
        self.lock().push(seen);
        self.news.notify_all();
    }
}
