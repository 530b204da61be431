//! Whether somebody has a file open for writing, by a lease.
//!
//! Unsafe, because rustix has no function for leases. What keeps it sound: `fcntl` is called with a
//! descriptor that is borrowed, and with whole numbers only.
#![allow(unsafe_code)]

use std::fs::File;
use std::os::fd::{AsRawFd as _, RawFd};

/// Numbers of file systems on disks of this computer, from Linux's `linux/magic.h`: ext2 to ext4, XFS,
/// Btrfs, F2FS, tmpfs. On a share the kernel knows nothing of writers on other computers, and refuses
/// leases for reasons of its own.
const LOCAL: [u32; 5] = [0xEF53, 0x5846_5342, 0x9123_683E, 0xF2F5_2010, 0x0102_1994];
/// From Linux's `asm-generic/fcntl.h`.
const SET_SIGNAL: i32 = 10;

pub(super) fn is_open_for_writing(file: &File) -> Option<bool> {
    let kind = rustix::fs::fstatfs(file).ok()?.f_type;
    if !LOCAL.contains(&(kind as u32)) {
        return None;
    }
    let file = file.as_raw_fd();
    // Who opens it meanwhile has a signal sent to us, which would end the process but for this one,
    // that is ignored.
    control(file, SET_SIGNAL, libc::SIGURG)?;
    match control(file, libc::F_SETLEASE, libc::F_RDLCK) {
        Some(()) => {
            control(file, libc::F_SETLEASE, libc::F_UNLCK)?;
            Some(false)
        }
        None if last_error() == libc::EAGAIN => Some(true),
        None => None,
    }
}

/// `None`: refused, and why is in the thread's error.
fn control(file: RawFd, what: i32, value: i32) -> Option<()> {
    // SAFETY: these requests take a whole number and touch no memory.
    (unsafe { libc::fcntl(file, what, value) } == 0).then_some(())
}

fn last_error() -> i32 {
    std::io::Error::last_os_error().raw_os_error().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;

    use super::*;

    #[test]
    fn on_a_disk_a_writer_is_known_for_as_long_as_it_has_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("O1.nc");
        std::fs::write(&path, "G1").unwrap();
        let file = File::open(&path).unwrap();
        let kind = rustix::fs::fstatfs(&file).unwrap().f_type as u32;
        let known = |is: bool| LOCAL.contains(&kind).then_some(is);
        assert_eq!(is_open_for_writing(&file), known(false));
        let appends = OpenOptions::new().append(true).open(&path).unwrap();
        assert_eq!(is_open_for_writing(&file), known(true));
        let reads = File::open(&path).unwrap();
        drop(appends);
        assert_eq!(is_open_for_writing(&file), known(false));
        drop(reads);
    }
}
