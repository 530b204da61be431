//! A simulated machine on a pty and a thread of its own, whose operator can be told what to do.

use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};

use softplug_abi::Micros;
use softplug_live::poll::Waker;
use softplug_live::simulator::Simulator;
use softplug_machines::Partner;
use softplug_machines::fanuc::{Control, Options, eight_none_two};
use softplug_machines::r3964::rk512::{self, Computer};

use crate::gateway::shop::HANG;

type Command<P> = Box<dyn FnOnce(Micros, &mut P) + Send>;

/// A simulated machine.
pub(crate) struct Machine<P> {
    /// The path of its port.
    pub(crate) port: String,
    commands: Option<Sender<Command<P>>>,
    waker: Waker,
    thread: Option<JoinHandle<()>>,
}

impl Machine<Control> {
    /// A FANUC control.
    pub(crate) fn fanuc() -> Self {
        let line = eight_none_two(9_600);
        let options = Options { line, receive_fifo: 65_536, ..Options::default() };
        Self::start(Control::new(options).unwrap())
    }
}

impl Machine<Computer> {
    /// A computer that speaks RK512.
    pub(crate) fn rk512() -> Self {
        Self::start(Computer::new(rk512::Options::default()).unwrap())
    }
}

impl<P: Partner + Send + 'static> Machine<P> {
    fn start(partner: P) -> Self {
        let mut simulator = Simulator::new(partner).unwrap();
        let (port, waker) = (simulator.port().to_string(), simulator.waker());
        let (commands, taken) = channel();
        let thread = thread::spawn(move || run(&mut simulator, &taken));
        Self { port, commands: Some(commands), waker, thread: Some(thread) }
    }

    /// Does something with it, or looks at it.
    pub(crate) fn tell<T: Send + 'static>(
        &self,
        what: impl FnOnce(Micros, &mut P) -> T + Send + 'static,
    ) -> T {
        let (to, answer) = channel();
        let order = move |now, partner: &mut P| to.send(what(now, partner)).unwrap();
        self.commands.as_ref().unwrap().send(Box::new(order)).unwrap();
        self.waker.wake();
        answer.recv_timeout(HANG).unwrap()
    }
}

fn run<P: Partner>(simulator: &mut Simulator<P>, commands: &Receiver<Command<P>>) {
    loop {
        let now = simulator.now();
        match commands.try_recv() {
            Ok(order) => order(now, &mut simulator.partner),
            Err(TryRecvError::Empty) => simulator.turn(now + Micros::from_secs(60)).unwrap(),
            Err(TryRecvError::Disconnected) => return,
        }
    }
}

impl<P> Drop for Machine<P> {
    fn drop(&mut self) {
        drop(self.commands.take());
        self.waker.wake();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
