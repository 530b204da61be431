//! The side that compiles: it limits itself, reads a module, writes its code, and ends.

use std::io::{self, Read, Write};
#[cfg(unix)]
use std::time::Duration;

use softplug_abi::limits::MODULE_BYTES;

use super::{CompileLimits, Head, REFUSED};
use crate::engine::EngineError;
use crate::engine::code::code_for;

/// How often it is looked how much was computed.
#[cfg(unix)]
const LOOK: Duration = Duration::from_millis(10);

/// Most bytes of a module: more than a plug-in has, as one that is made to say what it executes
/// is larger.
const LARGEST: usize = 8 * MODULE_BYTES;

/// How much lower the priority is of a compiler in the background.
#[cfg(unix)]
const NICE: i32 = 5;

/// Compiles the module that comes on standard input, as a host has asked for, and writes its code
/// to standard output. For a program that was started as a
/// [`CompilerProcess`](super::CompilerProcess); it has nothing else to do and should end.
///
/// # Errors
/// What comes on standard input is not what a host sends, or standard output does not take the code.
pub fn run() -> io::Result<()> {
    let mut input = io::stdin().lock();
    let mut head = [0; Head::BYTES];
    input.read_exact(&mut head)?;
    let strange = || io::Error::other("a host's request for compiling is expected here");
    let head = Head::decode(&head).ok_or_else(strange)?;
    if head.module_bytes as usize > LARGEST {
        return Err(strange());
    }
    let mut module = vec![0; head.module_bytes as usize];
    input.read_exact(&mut module)?;
    hold_to(head.limits, head.in_background)?;
    let mut output = io::stdout().lock();
    match code_for(&module, head.is_pooled) {
        Ok(code) => output.write_all(&code)?,
        Err(EngineError(reason)) => {
            output.write_all(REFUSED)?;
            output.write_all(reason.as_bytes())?;
        }
    }
    output.flush()
}

/// Takes the limits upon this process; what the system does not offer is left out.
fn hold_to(limits: CompileLimits, in_background: bool) -> io::Result<()> {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let limit = |resource, most: u64| {
            // Somebody may have set a lower one for all of us, which cannot be raised.
            let most = getrlimit(resource).maximum.map_or(most, |set| set.min(most));
            setrlimit(resource, Rlimit { current: Some(most), maximum: Some(most) })
        };
        limit(Resource::Core, 0)?;
        limit(Resource::Data, limits.memory)?;
        // The clock below is finer; this one holds whatever happens to its thread.
        limit(Resource::Cpu, limits.computing.as_secs() + 2)?;
        // What serves machines goes before. A system that refuses it is no reason not to compile.
        if in_background {
            let _ = rustix::process::nice(NICE);
        }
        #[cfg(target_os = "linux")]
        rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))?;
        std::thread::Builder::new().stack_size(64 * 1024).spawn(move || {
            while computed() < limits.computing {
                std::thread::sleep(LOOK);
            }
            std::process::exit(super::TIME_IS_UP);
        })?;
    }
    #[cfg(not(unix))]
    let _ = (limits, in_background);
    Ok(())
}

#[cfg(unix)]
fn computed() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}
