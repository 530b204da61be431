//! What processes have used.

use std::fs;
use std::time::Duration;

use super::Outcome;

/// What has been computed so far, in hundredths of a second.
pub struct Used {
    /// By the subject, all its threads.
    subject: u64,
    /// By this process.
    harness: u64,
    /// By the whole machine.
    machine: u64,
}

/// What was computed in a span, in hundredths of a core.
pub struct Share {
    pub subject: f64,
    /// By all else but the harness: the kernel's own threads above all, on whose behalf
    /// soever. They pass on what is written to a pty, the harness's bytes as well.
    pub others: f64,
}

impl Used {
    pub fn now(subject: u32) -> Outcome<Self> {
        let machine = machine()?;
        Ok(Self { subject: ticks(subject)?, harness: ticks(std::process::id())?, machine })
    }

    pub fn since(&self, before: &Self, span: Duration) -> Share {
        let share = |ticks: u64| ticks as f64 / span.as_secs_f64();
        let subject = self.subject - before.subject;
        let ours = subject + (self.harness - before.harness);
        let others = (self.machine - before.machine).saturating_sub(ours);
        Share { subject: share(subject), others: share(others) }
    }
}

/// Hundredths of a second that a process has computed, all its threads.
fn ticks(pid: u32) -> Outcome<u64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let rest = stat.rsplit_once(')').ok_or("no such statistics")?.1;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    Ok(fields[11].parse::<u64>()? + fields[12].parse::<u64>()?)
}

/// Ticks that all processors worked; what they idled, and what the host took away, is not counted.
fn machine() -> Outcome<u64> {
    let stat = fs::read_to_string("/proc/stat")?;
    let line = stat.lines().next().ok_or("no such statistics")?;
    // user, nice, system, idle, waiting, interrupts of two kinds, taken away
    let spans: Vec<u64> = line.split_whitespace().skip(1).flat_map(str::parse).collect();
    Ok(spans[0] + spans[1] + spans[2] + spans[5] + spans[6])
}

/// Bytes of the process that are in memory.
pub fn resident(pid: u32) -> Outcome<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/statm"))?;
    let pages: u64 = text.split_whitespace().nth(1).ok_or("no such statistics")?.parse()?;
    Ok(pages * 4_096)
}
