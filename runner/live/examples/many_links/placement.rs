//! What the measured process has of the machine: a priority, a processor.

use std::ops::Range;
use std::process::{Child, Command};
use std::{fs, thread};

use rustix::thread::{CpuSet, sched_setaffinity};

use super::Outcome;

const REAL_TIME: &str = "--real-time";
const APART: &str = "--apart";
/// Where the kernel's own threads may run that work for any processor: those that pass
/// on what is written to a pty are among them.
const WORKERS: &str = "/sys/devices/virtual/workqueue/cpumask";

#[derive(Copy, Clone)]
pub struct Placement {
    pub is_real_time: bool,
    is_apart: bool,
}

impl Placement {
    pub fn new(options: &[String]) -> Outcome<Self> {
        let is_known = |option: &&String| [REAL_TIME, APART].contains(&option.as_str());
        if let Some(unknown) = options.iter().find(|option| !is_known(option)) {
            return Err(format!("there is no option {unknown}").into());
        }
        let has = |name| options.iter().any(|option| option == name);
        Ok(Self { is_real_time: has(REAL_TIME), is_apart: has(APART) })
    }

    /// The options for the gateway's own process.
    pub fn options(self) -> &'static [&'static str] {
        if self.is_real_time { &[REAL_TIME] } else { &[] }
    }

    /// Begins what is measured. If that is to be apart, this process has the other
    /// processors from here on, until `Apart` is dropped.
    pub fn begin(self, command: &mut Command) -> Outcome<(Child, Option<Apart>)> {
        if !self.is_apart {
            return Ok((command.spawn()?, None));
        }
        let processors = thread::available_parallelism()?.get();
        if processors < 2 {
            return Err("with one processor nothing can be apart".into());
        }
        let apart = Apart::new(processors)?;
        // A process inherits where it may run.
        run_on(0..1)?;
        let process = command.spawn()?;
        run_on(1..processors)?;
        Ok((process, Some(apart)))
    }
}

/// The first processor is for the measured process and the kernel's workers. When this
/// is dropped, workers and this process run where they did before.
pub struct Apart {
    workers: String,
    processors: usize,
}

impl Apart {
    fn new(processors: usize) -> Outcome<Self> {
        let failed = |error| format!("{WORKERS}: {error}; run as root, or without {APART}");
        let workers = fs::read_to_string(WORKERS).map_err(failed)?;
        fs::write(WORKERS, "1").map_err(failed)?;
        Ok(Self { workers, processors })
    }
}

impl Drop for Apart {
    fn drop(&mut self) {
        if let Err(error) = fs::write(WORKERS, &self.workers) {
            eprintln!("{WORKERS} was {}and is 1 now: {error}", self.workers);
        }
        let _ = run_on(0..self.processors);
    }
}

fn run_on(processors: Range<usize>) -> Outcome {
    let mut set = CpuSet::new();
    processors.for_each(|processor| set.set(processor));
    Ok(sched_setaffinity(None, &set)?)
}
