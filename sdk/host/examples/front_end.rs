//! A host as in the front-end unit of a machine: one thread, memory of a fixed size, no compiler.
//!
//! `cargo run --release --no-default-features --features wasmi --example front_end PLUGIN.wasm
//! [KIB]`: loads the plug-in into the interpreter, opens a link, gives it a job of 1,000 bytes for 5 s of
//! virtual time, and prints how many bytes each of that took. No more than KIB of memory can be had; whatever
//! asks for more ends the program, as it would end the unit. The module itself lies in the unit's flash and is not
//! counted.
#![allow(unsafe_code)]
// An allocator is unsafe to write. This one only counts what it passes on to the system's.

use softplug_abi::{JobId, LineParameters, Micros};
use softplug_host::{EngineKind, Host, HostOptions};
use softplug_link::{Job, LinkOptions, Recorder, VirtualLine};
use std::alloc::{GlobalAlloc, Layout, System};
use std::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};

#[global_allocator]
static MEMORY: Memory = Memory {
    used: AtomicUsize::new(0),
    peak: AtomicUsize::new(0),
    most: AtomicUsize::new(usize::MAX),
};

/// Memory of a fixed size: there is no more once `most` bytes are in use.
struct Memory {
    used: AtomicUsize,
    peak: AtomicUsize,
    most: AtomicUsize,
}

// SAFETY: every pointer is one of the system's allocator, for the same layout.
unsafe impl GlobalAlloc for Memory {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let used = self.used.load(Ordering::Relaxed) + layout.size();
        if used > self.most.load(Ordering::Relaxed) {
            return std::ptr::null_mut();
        }
        self.used.store(used, Ordering::Relaxed);
        self.peak.fetch_max(used, Ordering::Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        self.used.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

impl Memory {
    /// Begins to count anew from what is in use: its peak is that.
    fn used(&self) -> usize {
        let used = self.used.load(Ordering::Relaxed);
        self.peak.store(used, Ordering::Relaxed);
        used
    }

    /// The most that was in use since then.
    fn peak(&self) -> usize {
        self.peak.load(Ordering::Relaxed)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("give the file of a plug-in")?;
    let module = std::fs::read(path)?;
    let start = MEMORY.used();
    if let Some(kib) = arguments.next() {
        MEMORY.most.store(start + kib.parse::<usize>()? * 1_024, Ordering::Relaxed);
    }

    let host = Host::new(HostOptions { engine: EngineKind::Wasmi, ..HostOptions::default() })?;
    let engine = MEMORY.used();
    let plugin = host.load_bytes(&module)?;
    let loading = MEMORY.peak();
    let loaded = MEMORY.used();
    let session = plugin.instantiate()?;
    let instantiated = MEMORY.used();

    let manifest = plugin.manifest();
    let settings = manifest.resolve_settings([])?;
    let options =
        LinkOptions { line: LineParameters::new(9_600), settings, ..LinkOptions::default() };
    let mut line = VirtualLine::new(session, options, 16);
    let mut outside = Recorder::default();
    line.link.open(Micros::ZERO, &mut outside)?;
    let kind = manifest.job_kind("send").ok_or("it takes no job of kind \"send\"")?;
    let check = manifest.needs.check_pass;
    let job = Job { id: JobId(1), kind, size: Some(1_000), fields: Vec::new(), check };
    let before_job = MEMORY.used();
    // The program comes from elsewhere, block by block; here it lies in memory.
    outside.add_source(JobId(1), b"N0010 G1 X-22.035 Y-96.6\n".repeat(40));
    let program = MEMORY.used() - before_job;
    line.link.begin_job(Micros::ZERO, job, &mut outside)?;
    line.transmit(Micros::ZERO, &mut outside)?;
    line.run_until(Micros::from_secs(5), &mut outside)?;
    let running =
        MEMORY.peak() - program - outside.observed.capacity() * size_of_val(&outside.observed[0]);

    let memory = plugin.inspection().memory_pages * 64 * 1_024;
    println!(
        "{{\"plugin\":\"{}\",\"module\":{},\"engine\":{},\"loading_peak\":{},\"code\":{},\"instance\":{},\
         \"instance_memory\":{memory},\"running_peak\":{},\"bytes_left\":{}}}",
        manifest.name,
        module.len(),
        engine - start,
        loading - start,
        loaded - engine,
        instantiated - loaded,
        running - start,
        outside.sent().len(),
    );
    Ok(())
}
