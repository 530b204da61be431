//! Files as devices: made whole or not at all, and for one at a time.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use softplug_unit_slots::{Device, FileDevice, Geometry};
use tempfile::TempDir;

const GEOMETRY: Geometry = Geometry { size: 65_536, erase: 4_096, granule: 4 };

fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mill.slots");
    (folder, path)
}

fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn refused(path: &Path) -> std::io::Error {
    FileDevice::open(path, GEOMETRY).unwrap_err()
}

#[test]
fn a_file_is_a_device_of_one_at_a_time() {
    let (_folder, path) = folder();
    let made = FileDevice::open(&path, GEOMETRY).unwrap();
    assert_eq!(refused(&path).kind(), ErrorKind::ResourceBusy);
    drop(made);
    let opened = FileDevice::open(&path, GEOMETRY).unwrap();
    assert_eq!(refused(&path).kind(), ErrorKind::ResourceBusy);
    drop(opened);
    FileDevice::open(&path, GEOMETRY).unwrap();
}

#[cfg(unix)]
#[test]
fn another_name_of_a_file_is_the_same_device() {
    let (folder, path) = folder();
    let link = folder.path().join("link.slots");
    std::os::unix::fs::symlink("mill.slots", &link).unwrap();
    // The link comes first: what it leads to is made, and it stays a link.
    let _made = FileDevice::open(&link, GEOMETRY).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::metadata(&path).unwrap().len(), 65_536);
    assert_eq!(refused(&path).kind(), ErrorKind::ResourceBusy);
    let hard = folder.path().join("hard.slots");
    fs::hard_link(&path, &hard).unwrap();
    assert_eq!(refused(&hard).kind(), ErrorKind::ResourceBusy);
}

#[test]
fn a_file_has_its_name_when_it_is_whole() {
    let (folder, path) = folder();
    // What a loss of power may have left of one that was being made.
    fs::write(folder.path().join("mill.slots.new"), [0xFF; 1_000]).unwrap();
    FileDevice::open(&path, GEOMETRY).unwrap();
    assert_eq!(names(&folder), ["mill.slots"]);
    assert_eq!(fs::read(&path).unwrap(), vec![0xFF; 65_536]);
    let nowhere = folder.path().join("none/mill.slots");
    assert_eq!(refused(&nowhere).kind(), ErrorKind::NotFound);
}

#[test]
fn a_file_that_was_cut_short_while_it_was_made_is_made_to_its_end() {
    let (_folder, path) = folder();
    let mut torn = vec![0xFF; 10_000];
    torn[5_000..].fill(0);
    for left in [&[][..], &[0xFF; 4_097], &torn] {
        fs::write(&path, left).unwrap();
        let mut device = FileDevice::open(&path, GEOMETRY).unwrap();
        device.program(4_096, b"soft").unwrap();
        drop(device);
        assert_eq!(fs::metadata(&path).unwrap().len(), 65_536);
    }
    // One with something in it is somebody's, whatever its size is.
    let mut with_header = vec![0xFF; 10_000];
    with_header[..8].copy_from_slice(b"SPLGSLOT");
    for other in [with_header, vec![0xFF; 65_537], b"a letter".to_vec()] {
        fs::write(&path, &other).unwrap();
        assert_eq!(refused(&path).to_string(), "the file has another size than the device");
        assert_eq!(fs::read(&path).unwrap(), other);
    }
}
