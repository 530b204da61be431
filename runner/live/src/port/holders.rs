//! Who has a device open, and which group may.

use std::ffi::OsStr;
use std::fs::{self, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

use crate::error::Holder;

/// Major numbers of pty slaves.
pub(crate) const PTY_SLAVES: std::ops::RangeInclusive<u32> = 136..=143;

/// Descriptors that a process begins with: a console has its own as these.
const STANDARD_STREAMS: std::ops::RangeInclusive<i32> = 0..=2;

/// Processes that have the device open, as far as this user may see; sorted. The standard
/// streams of this process do not count.
pub(crate) fn holders(path: &Path) -> Vec<Holder> {
    holders_but(path, None)
}

/// Processes that have the device open, as [`holders`] finds them; of this process neither the
/// descriptor `own`, which it has just opened, nor the standard streams, which it was given.
pub(crate) fn holders_but(path: &Path, own: Option<i32>) -> Vec<Holder> {
    let Ok(device) = fs::metadata(path) else { return Vec::new() };
    let Ok(processes) = fs::read_dir("/proc") else { return Vec::new() };
    let mut holders = Vec::new();
    for process in processes.flatten() {
        let name = process.file_name();
        let Some(pid) = name.to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
        let ours = |fd: &OsStr| {
            let fd = fd.to_str().and_then(|fd| fd.parse::<i32>().ok());
            pid == std::process::id()
                && fd.is_some_and(|fd| STANDARD_STREAMS.contains(&fd) || Some(fd) == own)
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

/// Whether the device is a terminal, as the kernel lists them; `true` where it does not tell.
pub(crate) fn is_terminal(device: &Metadata) -> bool {
    let number = (rustix::fs::major(device.rdev()), rustix::fs::minor(device.rdev()));
    match fs::read_to_string("/proc/tty/drivers") {
        Ok(drivers) => is_listed(&drivers, number),
        Err(_) => true,
    }
}

/// Whether one of these drivers has the number: lines such as
/// `serial  /dev/ttyS  4  64-95  serial`.
fn is_listed(drivers: &str, (major, minor): (u32, u32)) -> bool {
    let mut ranges = drivers.lines().filter_map(|line| {
        let mut words = line.split_whitespace().skip(2);
        let listed: u32 = words.next()?.parse().ok()?;
        let (first, last) =
            words.next().map(|minors| minors.split_once('-').unwrap_or((minors, minors)))?;
        Some((listed, first.parse().ok()?..=last.parse().ok()?))
    });
    ranges.any(|(listed, minors): (u32, std::ops::RangeInclusive<u32>)| {
        listed == major && minors.contains(&minor)
    })
}

fn same_device(one: &Metadata, other: &Metadata) -> bool {
    // Ptys of two containers have the same numbers, but not the same devpts.
    let alike =
        |a: &Metadata, b: &Metadata| a.rdev() == b.rdev() && (!is_pty(a) || a.dev() == b.dev());
    one.file_type().is_char_device() && other.file_type().is_char_device() && alike(one, other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminals_are_told_from_other_devices() {
        let drivers = "\
/dev/tty             /dev/tty        5       0 system:/dev/tty
serial               /dev/ttyS       4 64-111 serial
usbserial            /dev/ttyUSB   188 0-511 serial
pty_slave            /dev/pts      136 0-1048575 pty:slave
";
        for number in [(4, 64), (4, 111), (188, 0), (136, 7), (5, 0)] {
            assert!(is_listed(drivers, number), "{number:?}");
        }
        // /dev/null, a virtual console, and a UART too many.
        for number in [(1, 3), (4, 1), (4, 112)] {
            assert!(!is_listed(drivers, number), "{number:?}");
        }
        let null = fs::metadata("/dev/null").unwrap();
        assert_eq!(is_terminal(&null), fs::metadata("/proc/tty/drivers").is_err());
    }
}
