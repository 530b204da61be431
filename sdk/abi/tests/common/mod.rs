//! Reads the frozen encodings in `fixtures/abi`.

use std::fs;
use std::path::{Path, PathBuf};

/// One line of a file of frozen encodings.
#[derive(Debug)]
pub(crate) struct Golden {
    /// Name of the kind, with a variant behind a slash.
    pub(crate) name: String,
    /// The kind's number.
    pub(crate) kind: u16,
    /// The encoding.
    pub(crate) bytes: Vec<u8>,
}

/// The frozen encodings in `fixtures/abi/FILE`.
pub(crate) fn golden(file: &str) -> Vec<Golden> {
    let text = read(&format!("fixtures/abi/{file}"));
    text.lines().filter(|line| !line.starts_with('#')).map(parse).collect()
}

/// A file of the repository as text.
pub(crate) fn read(path: &str) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn parse(line: &str) -> Golden {
    let fields: Vec<_> = line.split(' ').collect();
    let [name, kind, hex] = fields[..] else { panic!("not name, kind, hex: {line}") };
    let kind = kind.parse().expect("a kind is a number");
    Golden { name: name.to_string(), kind, bytes: if hex == "-" { Vec::new() } else { bytes(hex) } }
}

fn bytes(hex: &str) -> Vec<u8> {
    let (pairs, rest) = hex.as_bytes().as_chunks::<2>();
    assert!(rest.is_empty(), "hex in pairs: {hex}");
    let digit = |c: u8| char::from(c).to_digit(16).expect("a hex digit") as u8;
    pairs.iter().map(|[high, low]| digit(*high) << 4 | digit(*low)).collect()
}
