//! A simulated machine on a pty and a thread of its own.

use std::sync::mpsc::{Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use softplug_abi::{LineParameters, Micros};
use softplug_live::poll::Waker;
use softplug_live::simulator::Simulator;
use softplug_machines::Partner;
use softplug_machines::r3964::rk512::{self, Computer};
use softplug_machines::xon_xoff::{Control, ControlOptions};

use crate::shop::PATIENCE;

type Command<P> = Box<dyn FnOnce(Micros, &mut P) + Send>;

pub(crate) struct Machine<P = Control> {
    /// The path of its port.
    pub(crate) port: String,
    /// Of a control; 0: as fast as a pty is.
    pub(crate) baud: u32,
    commands: Option<Sender<Command<P>>>,
    waker: Waker,
    thread: Option<JoinHandle<()>>,
}

impl Machine {
    /// A control, as fast as a pty is.
    pub(crate) fn fast() -> Self {
        Self::at(0)
    }

    /// A control on a line of this rate.
    pub(crate) fn at(baud: u32) -> Self {
        let line = LineParameters::new(baud);
        let options = ControlOptions {
            line,
            buffer: 4_096,
            low: 1_024,
            high: 2_048,
            receive_fifo: 65_536,
            ..Default::default()
        };
        Self::start(Control::new(options).unwrap(), baud)
    }
}

impl Machine<Computer> {
    /// A computer that speaks RK512.
    pub(crate) fn rk512() -> Self {
        Self::start(Computer::new(rk512::Options::default()).unwrap(), 0)
    }
}

impl<P: Partner + Send + 'static> Machine<P> {
    fn start(partner: P, baud: u32) -> Self {
        let mut simulator = Simulator::new(partner).unwrap();
        let (port, waker) = (simulator.port().to_string(), simulator.waker());
        let (commands, taken) = channel::<Command<P>>();
        let thread = thread::spawn(move || {
            loop {
                let now = simulator.now();
                match taken.try_recv() {
                    Ok(command) => command(now, &mut simulator.partner),
                    Err(TryRecvError::Empty) => {
                        simulator.turn(now + Micros::from_secs(60)).unwrap();
                    }
                    Err(TryRecvError::Disconnected) => return,
                }
            }
        });
        Self { port, baud, commands: Some(commands), waker, thread: Some(thread) }
    }

    /// Does something with it, or looks at it.
    pub(crate) fn tell<T: Send + 'static>(
        &self,
        what: impl FnOnce(Micros, &mut P) -> T + Send + 'static,
    ) -> T {
        let (to, answer) = channel();
        let command: Command<P> =
            Box::new(move |now, partner| to.send(what(now, partner)).unwrap());
        self.commands.as_ref().unwrap().send(command).unwrap();
        self.waker.wake();
        answer.recv_timeout(PATIENCE).unwrap()
    }

    pub(crate) fn until(&self, is_so: impl Fn(&mut P) -> bool + Clone + Send + 'static) {
        let begin = Instant::now();
        loop {
            let is_so = is_so.clone();
            if self.tell(move |_, partner| is_so(partner)) {
                return;
            }
            assert!(begin.elapsed() < PATIENCE, "the machine never came to that");
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
