//! Files that are read up to a bound.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// A file of text, of so many bytes at most.
pub(crate) fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let mut text = String::new();
    read_bytes(path, most)?.as_slice().read_to_string(&mut text)?;
    Ok(text)
}

/// A file of so many bytes at most: one that is longer is not read to its end.
pub(super) fn read_bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let kind = io::ErrorKind::FileTooLarge;
        return Err(io::Error::new(kind, format!("it has more than {most} bytes")));
    }
    Ok(bytes)
}
