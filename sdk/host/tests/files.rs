//! Loading from files, and what is wrong with a file.

use crate::common::{HOST, echo};
use softplug_host::{LintError, LoadError};
use std::io::Write;

#[test]
fn a_plug_in_is_loaded_from_a_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("echo.wasm");
    std::fs::write(&path, echo()).unwrap();
    let plugin = HOST.load(&path).unwrap();
    assert_eq!(plugin.manifest().name, "echo");
    assert_eq!(plugin.digest(), plugin.inspection().digest);
}

#[test]
fn a_missing_file_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("none.wasm");
    let error = HOST.load(&path).unwrap_err();
    assert!(matches!(error, LoadError::Io { .. }));
    assert!(error.to_string().starts_with(&format!("cannot read {}: ", path.display())));
}

#[test]
fn a_directory_or_device_is_no_plug_in() {
    let directory = tempfile::tempdir().unwrap();
    let error = HOST.load(directory.path()).unwrap_err();
    assert!(matches!(error, LoadError::NotAFile { .. }));
    #[cfg(unix)]
    assert!(matches!(
        HOST.load(std::path::Path::new("/dev/zero")),
        Err(LoadError::NotAFile { .. })
    ));
}

#[test]
fn a_file_that_is_something_else() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("program.nc");
    std::fs::write(&path, b"%\nO0001\nG0 X0\nM30\n%\n").unwrap();
    assert!(matches!(HOST.load(&path), Err(LoadError::Lint(LintError::NotWasm))));
    std::fs::write(&path, b"").unwrap();
    assert!(matches!(HOST.load(&path), Err(LoadError::Lint(LintError::NotWasm))));
}

#[test]
fn the_engine_has_a_name_and_a_version() {
    let engine = HOST.engine();
    assert_eq!(engine.name, "wasmtime");
    assert_eq!(engine.to_string(), format!("wasmtime {}", engine.version));
}

#[test]
fn a_plug_in_of_the_largest_size_is_taken() {
    use softplug_abi::limits::MODULE_BYTES;
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("large.wasm");
    let mut wasm = echo();
    // A custom section with an empty name fills it up exactly.
    let content = MODULE_BYTES - wasm.len() - 4;
    let mut length = (content as u32).to_le_bytes();
    length[0] = (content & 0x7f) as u8 | 0x80;
    length[1] = (content >> 7 & 0x7f) as u8 | 0x80;
    length[2] = (content >> 14 & 0x7f) as u8;
    wasm.push(0);
    wasm.extend(&length[..3]);
    wasm.extend(std::iter::repeat_n(0, content));
    assert_eq!(wasm.len(), MODULE_BYTES);
    std::fs::File::create(&path).unwrap().write_all(&wasm).unwrap();
    assert_eq!(HOST.load(&path).unwrap().inspection().size, MODULE_BYTES);
}
