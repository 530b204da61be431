//! Who has a device open, and which group may.

use std::ffi::OsStr;
use std::fs::{self, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

use crate::error::Holder;

/// Major numbers of pty slaves.
pub(crate) const PTY_SLAVES: std::ops::RangeInclusive<u32> = 136..=143;

/// Processes that have the device open, as far as this user may see; sorted.
pub(crate) fn holders(path: &Path) -> Vec<Holder> {
    holders_but(path, None)
}

/// The same without one descriptor of this process: the one just opened.
pub(crate) fn holders_but(path: &Path, own: Option<i32>) -> Vec<Holder> {
    let Ok(device) = fs::metadata(path) else { return Vec::new() };
    let Ok(processes) = fs::read_dir("/proc") else { return Vec::new() };
    let mut holders = Vec::new();
    for process in processes.flatten() {
        let name = process.file_name();
        let Some(pid) = name.to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
        let ours = |fd: &OsStr| {
            pid == std::process::id() && own.is_some_and(|own| *fd == *own.to_string())
        };
        let Ok(open) = fs::read_dir(process.path().join("fd")) else { continue };
        // Only links below /dev are followed: stat of a file on a dead
        // network share would hang.
        let holds = open.flatten().filter(|fd| !ours(&fd.file_name())).any(|fd| {
            fs::read_link(fd.path()).is_ok_and(|target| target.starts_with("/dev"))
                && fs::metadata(fd.path()).is_ok_and(|file| same_device(&file, &device))
        });
        if holds {
            let command = fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            holders.push(Holder { pid, command: command.trim().to_owned() });
        }
    }
    holders.sort();
    holders
}

/// The group that may read and write the device; `None` if no group may.
pub(crate) fn group(device: &Metadata) -> Option<String> {
    let may = device.mode() & 0o060 == 0o060;
    may.then(|| group_name(device.gid()))
}

/// The name of a group, or its number if it has none.
pub(crate) fn group_name(id: u32) -> String {
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(id)).then(|| name.to_owned())
    });
    name.unwrap_or_else(|| id.to_string())
}

/// Whether the device is the slave of a pty.
pub(crate) fn is_pty(device: &Metadata) -> bool {
    PTY_SLAVES.contains(&rustix::fs::major(device.rdev()))
}

fn same_device(one: &Metadata, other: &Metadata) -> bool {
    // Ptys of two containers have the same numbers, but not the same devpts.
    let alike =
        |a: &Metadata, b: &Metadata| a.rdev() == b.rdev() && (!is_pty(a) || a.dev() == b.dev());
    one.file_type().is_char_device() && other.file_type().is_char_device() && alike(one, other)
}
