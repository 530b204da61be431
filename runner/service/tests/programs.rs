//! Folders of programs: found, kept whole, never left.

use std::fs;
use std::io::{self, Read};

use softplug_service::programs::{ProgramError, ProgramName, Programs};

fn name(text: &str) -> ProgramName {
    text.parse().unwrap()
}

fn programs() -> (tempfile::TempDir, Programs) {
    let folder = tempfile::tempdir().unwrap();
    let roots = [folder.path().join("first"), folder.path().join("second")];
    let programs = Programs::open(&roots).unwrap();
    (folder, programs)
}

fn upload(programs: &Programs, to: &str, text: &str, replace: bool) -> Result<u64, ProgramError> {
    programs.upload(&name(to), &mut text.as_bytes(), 100, replace).map(|program| program.size)
}

fn text(programs: &Programs, of: &str) -> String {
    let mut text = String::new();
    programs.download(&name(of)).unwrap().0.read_to_string(&mut text).unwrap();
    text
}

fn files(folder: &std::path::Path) -> usize {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { files(&path) } else { 1 }).sum()
}

#[test]
fn programs_are_kept_listed_and_deleted() {
    let (folder, programs) = programs();
    fs::write(folder.path().join("second/O2.nc"), "G2").unwrap();
    fs::write(folder.path().join("second/.hidden"), "x").unwrap();
    assert_eq!(upload(&programs, "O1.nc", "G1 X1", false).unwrap(), 5);
    assert_eq!(upload(&programs, "lathes/left/O3.nc", "G3", false).unwrap(), 2);
    fs::write(folder.path().join("second/O1.nc"), "hidden by the first folder's").unwrap();
    let listed = programs.list().unwrap();
    let listed: Vec<_> = listed.iter().map(|program| (&*program.name, program.size)).collect();
    assert_eq!(listed, [("O1.nc", 5), ("O2.nc", 2), ("lathes/left/O3.nc", 2)]);
    assert!(matches!(upload(&programs, "O2.nc", "G9", false), Err(ProgramError::Exists(_))));
    assert_eq!(upload(&programs, "O1.nc", "G1 X2", true).unwrap(), 5);
    assert_eq!(text(&programs, "O1.nc"), "G1 X2");
    // What is replaced is replaced where it is.
    assert_eq!(upload(&programs, "O2.nc", "G2 X2", true).unwrap(), 5);
    assert_eq!(fs::read(folder.path().join("second/O2.nc")).unwrap(), b"G2 X2");
    programs.delete(&name("O1.nc")).unwrap();
    programs.delete(&name("O1.nc")).unwrap();
    assert!(matches!(programs.delete(&name("O1.nc")), Err(ProgramError::NotFound(_))));
}

#[test]
fn what_does_not_come_to_its_end_leaves_nothing() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::other("the connection is gone"))
        }
    }
    let (folder, programs) = programs();
    let large = "x".repeat(101);
    assert!(matches!(
        upload(&programs, "O1.nc", &large, false),
        Err(ProgramError::TooLarge { most: 100 })
    ));
    let mut broken = b"half".chain(Broken);
    let error = programs.upload(&name("O1.nc"), &mut broken, 100, false).unwrap_err();
    assert_eq!(error.to_string(), "the program did not come to its end: the connection is gone");
    assert_eq!(files(folder.path()), 0);
    upload(&programs, "O1.nc", "old", false).unwrap();
    let mut broken = b"half".chain(Broken);
    assert!(programs.upload(&name("O1.nc"), &mut broken, 100, true).is_err());
    assert_eq!((text(&programs, "O1.nc"), files(folder.path())), ("old".to_owned(), 1));
}

#[test]
fn no_name_leads_out_of_the_folders() {
    let (folder, programs) = programs();
    fs::write(folder.path().join("secret.nc"), "secret").unwrap();
    for bad in [
        "",
        "/",
        "..",
        "../secret.nc",
        "a/../../secret.nc",
        "/etc/passwd",
        "a//b",
        "./a",
        ".hidden",
        "a/.b",
        "a\\b",
        "a\0b",
        "C:\\a",
        "a/b/c/d/e/f",
        "a\nb",
        "-rf",
        "a/",
        " a",
        "O1.failed",
        "O1.partial",
    ] {
        assert!(matches!(bad.parse::<ProgramName>(), Err(ProgramError::Name(_))), "{bad:?}");
    }
    // Not through links either.
    std::os::unix::fs::symlink(folder.path(), folder.path().join("first/up")).unwrap();
    std::os::unix::fs::symlink(folder.path().join("secret.nc"), folder.path().join("first/O1.nc"))
        .unwrap();
    assert!(matches!(programs.download(&name("up/secret.nc")), Err(ProgramError::NotFound(_))));
    assert!(matches!(programs.download(&name("O1.nc")), Err(ProgramError::NotFound(_))));
    assert!(upload(&programs, "up/new.nc", "x", false).is_err());
    assert!(upload(&programs, "up/new/new.nc", "x", true).is_err());
    assert_eq!(programs.list().unwrap(), []);
    assert_eq!(programs.search(&["up".into(), "..".into(), "/".into()], "secret").unwrap(), None);
    assert!(!folder.path().join("new.nc").exists() && !folder.path().join("new").exists());
    // A name that is taken by a link is replaced, not followed.
    upload(&programs, "O1.nc", "mine", true).unwrap();
    assert_eq!(fs::read(folder.path().join("secret.nc")).unwrap(), b"secret");
}

#[test]
fn a_request_from_the_panel_is_looked_for_in_the_order_of_its_folders() {
    let (folder, programs) = programs();
    for (path, text) in [
        ("first/common/O7.nc", "common"),
        ("second/lathes/O7.nc", "lathes"),
        ("first/O7.nc", "top"),
        ("first/common/O8", "eight"),
    ] {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let search = |folders: &[&str], asked: &str| {
        let folders: Vec<_> = folders.iter().map(ToString::to_string).collect();
        let found = programs.search(&folders, asked).unwrap();
        found.map_or("none".to_owned(), |name| text(&programs, name.as_str()))
    };
    assert_eq!(search(&["lathes", "common"], "7"), "lathes");
    assert_eq!(search(&["lathes", "common"], "O8"), "eight");
    assert_eq!(search(&[""], "O7"), "top");
    assert_eq!(search(&["nowhere"], "O7"), "none");
    assert_eq!(search(&["lathes", "common"], "../O7"), "none");
    assert_eq!(search(&[], "O7"), "none");
}
