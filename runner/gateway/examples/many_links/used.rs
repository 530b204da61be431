//! What processes have used.

use std::fs;
use std::time::Duration;

use super::Outcome;

/// What has been computed so far, in hundredths of a second.
pub struct Used {
    /// By the subject, all its threads.
    subject: u64,
    /// By the kernel's own threads, on whose behalf soever: they pass on what is
    /// written to a pty, the harness's bytes as well.
    kernel: u64,
}

/// What was computed in a span, in hundredths of a core.
pub struct Share {
    pub subject: f64,
    pub kernel: f64,
}

impl Used {
    pub fn now(subject: u32) -> Outcome<Self> {
        let mut kernel = 0;
        for entry in fs::read_dir("/proc")?.flatten() {
            // Others come and go.
            let Some(Ok(pid)) = entry.file_name().to_str().map(str::parse) else { continue };
            if let Ok(Process { parent: KERNEL, ticks }) = Process::read(pid) {
                kernel += ticks;
            }
        }
        Ok(Self { subject: Process::read(subject)?.ticks, kernel })
    }

    pub fn since(&self, before: &Self, span: Duration) -> Share {
        let share = |now: u64, before: u64| now.saturating_sub(before) as f64 / span.as_secs_f64();
        Share {
            subject: share(self.subject, before.subject),
            kernel: share(self.kernel, before.kernel),
        }
    }
}

/// The parent of the kernel's threads.
const KERNEL: u32 = 2;

struct Process {
    parent: u32,
    /// Hundredths of a second that it has computed, all its threads.
    ticks: u64,
}

impl Process {
    fn read(pid: u32) -> Outcome<Self> {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat"))?;
        let rest = stat.rsplit_once(')').ok_or("no such statistics")?.1;
        let fields: Vec<&str> = rest.split_whitespace().collect();
        let ticks = fields[11].parse::<u64>()? + fields[12].parse::<u64>()?;
        Ok(Self { parent: fields[1].parse()?, ticks })
    }
}

/// Bytes of the process that are in memory.
pub fn resident(pid: u32) -> Outcome<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/statm"))?;
    let pages: u64 = text.split_whitespace().nth(1).ok_or("no such statistics")?.parse()?;
    Ok(pages * 4_096)
}
