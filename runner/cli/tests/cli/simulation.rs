//! A simulated machine in a process of its own, as the partner of a transfer.

use std::io::{BufRead as _, BufReader, Read as _};
use std::process::{Child, ChildStdout};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::bench::{Bench, Ran};

/// Longer than anything here takes; only a hang gets there.
pub(crate) const HANG: Duration = Duration::from_mins(2);

/// Real time has two cores: one transfer at a time.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// `softplug simulate`, started.
pub(crate) struct Simulation {
    pub(crate) child: Child,
    out: BufReader<ChildStdout>,
    pub(crate) port: String,
}

impl Simulation {
    pub(crate) fn start(bench: &Bench, options: &[&str]) -> Self {
        Self::of("xon-xoff", bench, options)
    }

    pub(crate) fn of(machine: &str, bench: &Bench, options: &[&str]) -> Self {
        let words = [&["simulate", machine, "--json"], options].concat();
        let mut child = bench.command(&words).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        out.read_line(&mut line).unwrap();
        let ready: Value = serde_json::from_str(&line).unwrap();
        Self { child, out, port: ready["port"].as_str().unwrap().to_owned() }
    }

    /// Its exit code and its report.
    pub(crate) fn end(mut self) -> (i32, Value) {
        let mut text = String::new();
        self.out.read_to_string(&mut text).unwrap();
        let code = self.child.wait().unwrap().code().unwrap();
        (code, serde_json::from_str(&text).unwrap())
    }
}

pub(crate) fn interrupt(child: &Child) {
    let pid = Pid::from_child(child);
    kill_process(pid, Signal::INT).unwrap();
}

/// Waits for something that comes about in another process.
pub(crate) fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !there() {
        assert!(begin.elapsed() < HANG, "{what} did not come about");
        sleep(Duration::from_millis(5));
    }
}

pub(crate) fn ended(child: Child) -> Ran {
    child.wait_with_output().unwrap().into()
}

pub(crate) const LINE: [&str; 2] = ["--line", "921600 8N1"];
