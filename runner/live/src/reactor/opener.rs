//! Opens and closes ports off the threads that serve lanes: a name look-up, a
//! connection or a driver may take its time.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use crate::error::PortError;
use crate::port::{Port, PortOptions, PortSpec};

/// Stack of a thread that makes one connection; a name look-up needs most of it.
const STACK: usize = 256 * 1024;

/// Called with the outcome, on the opener's thread.
type Opened = Box<dyn FnOnce(Result<Port, PortError>) + Send>;

enum Task {
    Open { spec: PortSpec, options: PortOptions, opened: Opened },
    Close(Port),
    Bury(Box<dyn Send>),
}

/// Devices are opened one after the other; what may wait for somebody else has a
/// thread of its own meanwhile.
#[derive(Clone, Debug)]
pub(super) struct Opener {
    devices: Sender<Task>,
}

impl Opener {
    pub(super) fn start() -> Result<Self, PortError> {
        let (devices, tasks) = channel();
        thread::Builder::new()
            .name("softplug-open".to_owned())
            .spawn(move || serve(&tasks))
            .map_err(|error| PortError::io("start a thread", error))?;
        Ok(Self { devices })
    }

    pub(super) fn open(&self, spec: &PortSpec, options: &PortOptions, opened: Opened) {
        let task = Task::Open { spec: spec.clone(), options: options.clone(), opened };
        // The thread ends only with its last opener.
        let _ = self.devices.send(task);
    }

    /// Closes a port: a driver may still wait for something.
    pub(super) fn close(&self, port: Port) {
        let _ = self.devices.send(Task::Close(port));
    }

    /// Drops a plug-in: its memory is given back to the system.
    pub(super) fn bury(&self, instance: Box<dyn Send>) {
        let _ = self.devices.send(Task::Bury(instance));
    }
}

fn serve(tasks: &Receiver<Task>) {
    for task in tasks {
        match task {
            Task::Close(port) => drop(port),
            Task::Bury(instance) => drop(instance),
            Task::Open { spec, options, opened } if spec.waits_for_others() => {
                connect(spec, options, opened);
            }
            Task::Open { spec, options, opened } => opened(Port::open(&spec, &options)),
        }
    }
}

fn connect(spec: PortSpec, options: PortOptions, opened: Opened) {
    let (give, take) = channel::<Opened>();
    let work = move || {
        if let Ok(opened) = take.recv() {
            opened(Port::open(&spec, &options));
        }
    };
    let thread = thread::Builder::new().name("softplug-connect".to_owned()).stack_size(STACK);
    match thread.spawn(work) {
        Ok(_) => {
            let _ = give.send(opened);
        }
        Err(error) => opened(Err(PortError::io("start a thread", error))),
    }
}
