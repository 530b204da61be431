//! The library of plug-ins: what is added is found, what is used stays, and
//! nothing is there by half.

use std::fs;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use crate::common::plugins::echo;
use softplug_host::Digest;
use softplug_service::library::{Library, LibraryError, LibraryNews, Use, Watch};

fn library() -> (tempfile::TempDir, Library) {
    let folder = tempfile::tempdir().unwrap();
    let library = Library::open(&folder.path().join("plugins")).unwrap();
    (folder, library)
}

fn version(library: &Library, asked: &str) -> Result<String, String> {
    let entry = library.resolve(&asked.parse().unwrap());
    entry.map(|entry| entry.version).map_err(|error| error.to_string())
}

fn files(folder: &Path) -> Vec<String> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(self::files(&path));
        } else if path.file_name().unwrap() != ".lock" {
            files.push(path.file_name().unwrap().to_str().unwrap().to_owned());
        }
    }
    files.sort();
    files
}

#[test]
fn names_versions_and_digests_find_what_was_added() {
    let (_folder, library) = library();
    for version in ["0.1.2", "0.1.10", "0.2.0-beta", "1.0.0"] {
        library.add(&echo("echo", version, "")).unwrap();
    }
    library.add(&echo("trial", "0.1.0-rc1", "")).unwrap();
    for (asked, found) in [
        ("echo", "1.0.0"),
        ("echo@0.1", "0.1.10"),
        ("echo@0.1.2", "0.1.2"),
        ("echo@0.2.0-beta", "0.2.0-beta"),
        ("trial", "0.1.0-rc1"),
    ] {
        assert_eq!(version(&library, asked).as_deref(), Ok(found), "{asked}");
    }
    let module = echo("echo", "0.1.2", "");
    let digest = Digest::of(&module);
    assert_eq!(version(&library, &format!("echo@sha256:{digest}")).as_deref(), Ok("0.1.2"));
    let short = &digest.to_string()[..10];
    assert_eq!(version(&library, &format!("echo@sha256:{short}")).as_deref(), Ok("0.1.2"));
    assert_eq!(library.read(digest).unwrap(), module);

    let listed = library.entries().unwrap();
    let listed: Vec<_> =
        listed.iter().map(|entry| format!("{}@{}", entry.name, entry.version)).collect();
    assert_eq!(
        listed,
        ["echo@1.0.0", "echo@0.2.0-beta", "echo@0.1.10", "echo@0.1.2", "trial@0.1.0-rc1"]
    );
}

#[test]
fn what_is_not_there_is_said_with_what_is() {
    let (_folder, library) = library();
    assert_eq!(
        version(&library, "echo"),
        Err("the library has no plug-in \"echo\"; it is empty".to_owned())
    );
    library.add(&echo("echo", "0.1.0", "")).unwrap();
    library.add(&echo("echo", "0.2.0", "")).unwrap();
    for (asked, sentence) in [
        ("ehco", "the library has no plug-in \"ehco\"; did you mean \"echo\"?"),
        ("fanuc", "the library has no plug-in \"fanuc\"; it has echo"),
        ("echo@3", "the library has no plug-in \"echo@3\"; its versions are 0.1.0, 0.2.0"),
        (
            "other@sha256:00000000",
            "the library has no plug-in \"other@sha256:00000000\"; it has echo",
        ),
    ] {
        assert_eq!(version(&library, asked), Err(sentence.to_owned()));
    }
    assert!(matches!(
        Library::existing(&library.folder().join("none")),
        Err(LibraryError::NoLibrary(_))
    ));
}

#[test]
fn a_version_that_is_built_anew_replaces_the_old_one_which_stays_until_garbage_is_collected() {
    let (_folder, library) = library();
    let (first, second) = (echo("echo", "1.0.0", ""), echo("echo", "1.0.0", "Quickly. "));
    let added = library.add(&first).unwrap();
    assert!(!added.was_there && added.replaced.is_none());
    assert!(library.add(&first).unwrap().was_there);
    let added = library.add(&second).unwrap();
    assert_eq!(added.replaced, Some(Digest::of(&first)));
    assert_eq!(library.resolve(&"echo".parse().unwrap()).unwrap().digest, Digest::of(&second));
    let old = format!("echo@sha256:{}", Digest::of(&first)).parse().unwrap();
    assert!(!library.resolve(&old).unwrap().is_named);

    library
        .note_use("lathe 1", Use { running: None, last_good: Some(Digest::of(&first)) })
        .unwrap();
    assert_eq!(library.use_of("lathe 1").last_good, Some(Digest::of(&first)));
    assert_eq!(library.resolve(&old).unwrap().used_by, ["lathe 1"]);
    assert_eq!(library.collect_garbage(false).unwrap(), []);
    assert_eq!(
        library.remove(&old, false).unwrap_err().to_string(),
        format!("\"{old}\" is used by lathe 1: swap it there first, or force it")
    );

    library.note_use("lathe 1", Use::default()).unwrap();
    let garbage = library.collect_garbage(true).unwrap();
    assert_eq!(
        garbage.iter().map(|object| object.digest).collect::<Vec<_>>(),
        [Digest::of(&first)]
    );
    assert!(library.resolve(&old).is_ok());
    assert_eq!(library.collect_garbage(false).unwrap(), garbage);
    assert!(library.resolve(&old).is_err() && library.read(Digest::of(&second)).is_ok());
}

#[test]
fn what_is_removed_has_no_name_any_more() {
    let (_folder, library) = library();
    let module = echo("echo", "1.0.0", "");
    library.add(&module).unwrap();
    library.remove(&"echo@1.0.0".parse().unwrap(), false).unwrap();
    assert!(library.resolve(&"echo".parse().unwrap()).is_err());
    assert!(library.read(Digest::of(&module)).is_ok());
    library.add(&module).unwrap();
    let by_digest = format!("echo@sha256:{}", Digest::of(&module)).parse().unwrap();
    library.remove(&by_digest, false).unwrap();
    assert_eq!(files(library.folder()), Vec::<String>::new());
}

#[test]
fn what_is_no_plug_in_leaves_nothing_behind() {
    let (folder, library) = library();
    let cut = &echo("echo", "1.0.0", "")[..200];
    assert!(matches!(library.add(cut), Err(LibraryError::NotAPlugin(_))));
    assert!(matches!(library.add(&echo("echo", "../1", "")), Err(LibraryError::Version(_))));
    assert!(matches!(library.add(&echo("echo", "", "")), Err(LibraryError::Version(_))));
    let large = folder.path().join("large.wasm");
    fs::write(&large, vec![0; 300 << 10]).unwrap();
    assert!(matches!(library.add_file(&large), Err(LibraryError::NotAPlugin(_))));
    assert!(matches!(library.add_file(folder.path()), Err(LibraryError::Disk(_))));
    assert_eq!(files(library.folder()), Vec::<String>::new());
}

#[test]
fn damage_is_found_and_mended_by_adding_again() {
    let (_folder, library) = library();
    let module = echo("echo", "1.0.0", "");
    let digest = library.add(&module).unwrap().entry.digest;
    let hex = digest.to_string();
    let path = library.folder().join(format!("sha256/{}/{}.wasm", &hex[..2], &hex[2..]));
    let mut damaged = module.clone();
    *damaged.last_mut().unwrap() ^= 1;
    fs::write(&path, &damaged).unwrap();
    assert!(matches!(library.resolve(&"echo".parse().unwrap()), Err(LibraryError::Damaged { .. })));
    assert_eq!(library.entries().unwrap(), []);
    library.add(&module).unwrap();
    assert_eq!(library.read(digest).unwrap(), module);
    // A name that means nothing does not keep the others from being found.
    fs::write(library.folder().join("names/echo/2.0.0"), "nonsense").unwrap();
    fs::write(library.folder().join("names/.DS_Store"), "x").unwrap();
    assert_eq!(version(&library, "echo").as_deref(), Ok("1.0.0"));
    // What a killed writer left goes at the next change.
    fs::write(library.folder().join("sha256/.new-abc"), "half").unwrap();
    library.collect_garbage(false).unwrap();
    assert!(!library.folder().join("sha256/.new-abc").exists());
}

#[test]
fn several_may_add_at_once() {
    let (_folder, library) = library();
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let library = library.clone();
            scope.spawn(move || {
                for version in 0..8 {
                    let version = format!("1.{version}.{}", writer % 2);
                    library.add(&echo("echo", &version, "")).unwrap();
                }
            });
        }
    });
    let entries = library.entries().unwrap();
    assert_eq!(entries.len(), 16);
    assert!(entries.iter().all(|entry| entry.is_named));
    assert_eq!(library.collect_garbage(false).unwrap(), []);
}

fn watched(library: &Library) -> (Watch, Receiver<LibraryNews>) {
    let (tell, news) = channel();
    (library.watch(move |what| tell.send(what).unwrap()).unwrap(), news)
}

fn next(news: &Receiver<LibraryNews>) -> String {
    match news.recv_timeout(Duration::from_mins(1)).expect("news comes") {
        LibraryNews::Available(entry) => format!("{}@{}", entry.name, entry.version),
        LibraryNews::Gone { name, version } => format!("gone {name}@{version}"),
        LibraryNews::Refused { file, error } => {
            format!("refused {}: {error}", file.file_name().unwrap().display())
        }
    }
}

#[test]
fn what_is_new_is_told_at_once() {
    let (folder, library) = library();
    library.add(&echo("echo", "1.0.0", "")).unwrap();
    let (watch, news) = watched(&library);
    // By another hand, as the command would.
    let other = Library::existing(library.folder()).unwrap();
    other.add(&echo("echo", "1.1.0", "")).unwrap();
    assert_eq!(next(&news), "echo@1.1.0");
    other.add(&echo("echo", "1.1.0", "Anew. ")).unwrap();
    assert_eq!(next(&news), "echo@1.1.0");
    other.remove(&"echo@1.0".parse().unwrap(), false).unwrap();
    assert_eq!(next(&news), "gone echo@1.0.0");

    let incoming = library.folder().join("incoming");
    fs::write(incoming.join("new.wasm"), echo("new", "0.1.0", "")).unwrap();
    assert_eq!(next(&news), "new@0.1.0");
    assert!(!incoming.join("new.wasm").exists());
    let moved = folder.path().join("moved.wasm");
    fs::write(&moved, echo("new", "0.2.0", "")).unwrap();
    fs::rename(moved, incoming.join("moved.wasm")).unwrap();
    assert_eq!(next(&news), "new@0.2.0");

    fs::write(incoming.join("bad.wasm"), "no module").unwrap();
    assert!(next(&news).starts_with("refused bad.wasm: it is not a plug-in: "));
    assert!(incoming.join("bad.wasm").exists());
    // It is tried again when it has changed, and only then.
    fs::write(incoming.join("bad.wasm"), echo("bad", "1.0.0", "")).unwrap();
    assert_eq!(next(&news), "bad@1.0.0");
    drop(watch);
    assert!(news.recv().is_err());
}

#[test]
fn what_lies_there_already_is_taken_when_the_watch_begins() {
    let (_folder, library) = library();
    fs::write(library.folder().join("incoming/a.wasm"), echo("echo", "1.0.0", "")).unwrap();
    let (_watch, news) = watched(&library);
    assert_eq!(next(&news), "echo@1.0.0");
}
