//! The side that asks: starts the process, gives it the module, and waits no longer than it may.

use std::io::{self, Read, Write};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use super::{CompilerProcess, Head, NO_MEMORY, REFUSED, TIME_IS_UP};
use crate::engine::cache::{CODE_BYTES, CacheKey, VerifiedCode};

/// How often it is looked whether compiling is to be broken off.
const LOOK: Duration = Duration::from_millis(20);
/// How long a process that has said all may take to end.
const ENDING: Duration = Duration::from_secs(2);
/// Most bytes of what the process says when it fails.
const WORDS_BYTES: u64 = 4_096;

/// Why there is no code.
#[derive(Debug)]
pub(crate) enum Failed {
    /// The module took more computing than it may.
    Time(Duration),
    /// It took more memory than it may.
    Memory(u64),
    /// The compiler refuses it.
    Refused(String),
    /// The process itself.
    Process(String),
}

/// Has the module compiled, unless `broken_off` is set meanwhile.
pub(crate) fn compile(
    by: &CompilerProcess,
    wasm: &[u8],
    is_pooled: bool,
    key: CacheKey,
    broken_off: &AtomicBool,
) -> Result<VerifiedCode, Failed> {
    let module_bytes = wasm.len() as u32;
    let in_background = by.in_background;
    let head = Head { is_pooled, in_background, limits: by.limits, module_bytes };
    let mut child = start(by).map_err(|error| Failed::Process(error.to_string()))?;
    let talked = talk(&mut child, [head.encode(), wasm.to_vec()].concat(), by, broken_off);
    if talked.is_ok() {
        await_end(&mut child);
    }
    // What cannot be killed has ended.
    let _ = child.kill();
    let status = child.wait().map_err(|error| Failed::Process(error.to_string()))?;
    let (output, words) = talked?;
    if let Some(reason) = output.strip_prefix(REFUSED) {
        return Err(Failed::Refused(crate::words::printable(reason)));
    }
    match VerifiedCode::received(output, key) {
        Ok(code) => Ok(code),
        Err(reason) => Err(why(status, &words, reason, by)),
    }
}

/// Who has closed its output is about to end, and how it ends says why there is no code: it is
/// not killed before.
fn await_end(child: &mut Child) {
    let until = Instant::now() + ENDING;
    while matches!(child.try_wait(), Ok(None)) && Instant::now() < until {
        thread::sleep(Duration::from_millis(1));
    }
}

fn start(by: &CompilerProcess) -> io::Result<Child> {
    let mut command = Command::new(&by.program);
    command.args(&by.arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // An interrupt at the terminal is for the host, which then breaks it off.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command.spawn()
}

type Talked = (Vec<u8>, String);

/// Gives it what it asks for and takes what it says, on a thread: the process may do neither.
fn talk(
    child: &mut Child,
    request: Vec<u8>,
    by: &CompilerProcess,
    broken_off: &AtomicBool,
) -> Result<Talked, Failed> {
    let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let (Some(mut stdin), Some(stdout), Some(stderr)) = pipes else {
        return Err(Failed::Process("it has no pipes".to_owned()));
    };
    let (to, talked) = sync_channel(1);
    let spawned = thread::Builder::new().name("softplug-compile".to_owned()).spawn(move || {
        // One that ends before it has read all says why.
        let _ = stdin.write_all(&request);
        drop(stdin);
        let (mut output, mut words) = (Vec::new(), Vec::new());
        // What came until an error is looked at all the same: it has a checksum.
        let _ = stdout.take(CODE_BYTES).read_to_end(&mut output);
        let _ = stderr.take(WORDS_BYTES).read_to_end(&mut words);
        // Nobody waits any more: it was broken off.
        let _ = to.send((output, crate::words::printable(words.trim_ascii())));
    });
    spawned.map_err(|error| Failed::Process(error.to_string()))?;
    let until = Instant::now() + by.limits.patience;
    loop {
        match talked.recv_timeout(LOOK) {
            Ok(talked) => return Ok(talked),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Failed::Process("nothing was heard of it".to_owned()));
            }
            Err(RecvTimeoutError::Timeout) if broken_off.load(Ordering::Relaxed) => {
                return Err(Failed::Process("it was broken off, the host stops".to_owned()));
            }
            Err(RecvTimeoutError::Timeout) if Instant::now() >= until => {
                let seconds = by.limits.patience.as_secs();
                return Err(Failed::Process(format!("it has not ended within {seconds} s")));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Why the process left no code.
fn why(status: ExitStatus, words: &str, reason: &str, by: &CompilerProcess) -> Failed {
    #[cfg(unix)]
    let signal = std::os::unix::process::ExitStatusExt::signal(&status);
    #[cfg(not(unix))]
    let signal: Option<i32> = None;
    #[cfg(unix)]
    let is_out_of_time = signal == Some(rustix::process::Signal::XCPU.as_raw());
    #[cfg(not(unix))]
    let is_out_of_time = false;
    if is_out_of_time || status.code() == Some(TIME_IS_UP) {
        return Failed::Time(by.limits.computing);
    }
    if words.contains(NO_MEMORY) {
        return Failed::Memory(by.limits.memory);
    }
    if status.success() {
        return Failed::Process(format!("its code cannot be used: {reason}"));
    }
    let words = words.trim();
    let said = if words.is_empty() { String::new() } else { format!("; it said: {words}") };
    match signal {
        // The compiler has failed on this module, and on none that it knew before.
        Some(signal) => Failed::Refused(format!("the compiler ended with signal {signal}{said}")),
        None => Failed::Process(format!("it ended with {status}{said}")),
    }
}
