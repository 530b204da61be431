//! Whether somebody has a file open for writing, as far as the system tells.

#[cfg(target_os = "linux")]
mod linux;

use std::fs::File;

/// Whether somebody has this file, which is open for reading, open for writing. `None`: it cannot be
/// known, as the file is on a share, another user's, or the system is not Linux.
///
/// On Linux a lease for reading is taken and given back at once: the kernel grants none on a file that
/// somebody may write to. Whoever opens it just then waits for that moment.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// use softplug_live::store::is_open_for_writing;
/// use std::fs::File;
///
/// let path = folder.path().join("O1.nc");
/// let writer = File::create(&path)?;
/// assert_ne!(is_open_for_writing(&File::open(&path)?), Some(false));
/// drop(writer);
/// assert_ne!(is_open_for_writing(&File::open(&path)?), Some(true));
/// # Ok::<_, std::io::Error>(())
/// ```
pub fn is_open_for_writing(file: &File) -> Option<bool> {
    #[cfg(target_os = "linux")]
    let known = linux::is_open_for_writing(file);
    #[cfg(not(target_os = "linux"))]
    let (known, _) = (None, file);
    known
}
