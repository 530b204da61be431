//! Who has a memory open already.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::process;

/// In a sentence.
pub(crate) fn of(memory: &Path) -> String {
    match process_with_lock(memory) {
        Some(pid) if pid == process::id() => {
            "another link of this unit has it: give each its own".to_owned()
        }
        Some(pid) => {
            let command = fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default();
            let command = softplug_live::plain_text(command.trim());
            format!("process {pid} ({command}) has it: give each unit its own, or end that one")
        }
        None => "another unit has it: give each its own, or end that one".to_owned(),
    }
}

/// As the kernel lists them: lines such as `1: FLOCK  ADVISORY  WRITE 1234 fe:00:131 0 EOF`.
fn process_with_lock(memory: &Path) -> Option<u32> {
    let inode = fs::metadata(memory).ok()?.ino().to_string();
    let locks = fs::read_to_string("/proc/locks").ok()?;
    locks.lines().find_map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [_, "FLOCK", _, _, pid, file, ..] = words[..] else { return None };
        // The device is that of the file system below, which may have another number.
        (file.rsplit(':').next() == Some(&*inode)).then(|| pid.parse().ok())?
    })
}
