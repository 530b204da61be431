//! The cache of compiled code: a directory of files, each of which is checked
//! before the engine sees it.
//!
//! A file is: magic (8 bytes), key (32), length of the code (u64), SHA-256 of the
//! code (32), code. The key binds module, engine, version and settings; the
//! checksum finds damage. Neither would find a forgery, so on Unix the directory and the
//! file must belong to this user and be writable by nobody else. On other
//! systems the directory's own permissions have to see to that.

use super::EngineInfo;
use crate::Digest;
use std::fs::{self, Metadata, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

const MAGIC: &[u8; 8] = b"SPLGCOD1";
const HEADER_BYTES: usize = 8 + 32 + 8 + 32;

/// Code of a 256 KiB module is a few MiB; what is larger is not ours.
pub(crate) const CODE_BYTES: u64 = 64 << 20;

/// Names one module's code for one engine, version and settings.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct CacheKey(Digest);

impl CacheKey {
    pub(crate) fn new(module: Digest, engine: EngineInfo, settings: u64) -> Self {
        let settings = settings.to_le_bytes();
        let engine = engine.to_string();
        Self(Digest::of(&[module.as_bytes(), &settings[..], engine.as_bytes()].concat()))
    }
}

/// Code that passed every check. Only this module makes one.
pub(crate) struct VerifiedCode {
    file: Vec<u8>,
}

impl VerifiedCode {
    /// What our own compiler's process has written, in the form of a cache file.
    pub(crate) fn received(file: Vec<u8>, key: CacheKey) -> Result<Self, &'static str> {
        check(&file, key)?;
        Ok(Self { file })
    }

    /// The code in the form of a cache file.
    pub(crate) fn file_for(key: CacheKey, code: &[u8]) -> Vec<u8> {
        let length = (code.len() as u64).to_le_bytes();
        let sum = Digest::of(code);
        [&MAGIC[..], key.0.as_bytes(), &length[..], sum.as_bytes(), code].concat()
    }

    pub(crate) fn as_bytes(&self) -> &[u8] {
        &self.file[HEADER_BYTES..]
    }
}

/// A directory for compiled code.
pub(crate) struct Cache {
    directory: PathBuf,
}

impl Cache {
    /// The cache in `directory`, which is made if need be; `None`, with a warning
    /// in the log, if it cannot be used.
    pub(crate) fn open(directory: &Path) -> Option<Self> {
        let usable = make_private(directory)
            .and_then(|()| fs::metadata(directory))
            .and_then(|metadata| belongs_to_us_alone(&metadata));
        if let Err(error) = usable {
            tracing::warn!(
                directory = %directory.display(), %error,
                "the cache cannot be used, plug-ins are compiled at every load"
            );
            return None;
        }
        Some(Self { directory: directory.to_owned() })
    }

    /// The code under `key`, if there is any that can be trusted.
    pub(crate) fn read(&self, key: CacheKey) -> Option<VerifiedCode> {
        let path = self.path(key);
        match read_verified(&path, key) {
            Ok(code) => Some(code),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => {
                tracing::warn!(path = %path.display(), %error, "a cache file is not trusted, compiling anew");
                None
            }
        }
    }

    /// Keeps `code`; a failure is logged and otherwise does no harm.
    pub(crate) fn write(&self, key: CacheKey, code: &[u8]) {
        self.keep(key, &VerifiedCode { file: VerifiedCode::file_for(key, code) });
    }

    /// Keeps code that was checked for this key.
    pub(crate) fn keep(&self, key: CacheKey, code: &VerifiedCode) {
        let path = self.path(key);
        if let Err(error) = self.write_whole(&path, &code.file) {
            tracing::warn!(path = %path.display(), %error, "compiled code cannot be kept");
        }
    }

    fn path(&self, key: CacheKey) -> PathBuf {
        self.directory.join(format!("{}.code", key.0))
    }

    /// Another process may read or write the same file: it is made under a name
    /// of its own and put in place whole.
    fn write_whole(&self, path: &Path, file: &[u8]) -> io::Result<()> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let temporary = self.directory.join(format!("{}.{count}.new", std::process::id()));
        let written = write_new(&temporary, file).and_then(|()| fs::rename(&temporary, path));
        if written.is_err() {
            // What could not be written is of no use; if it cannot be removed
            // either, the warning about the first failure says enough.
            let _ = fs::remove_file(&temporary);
        }
        written
    }
}

fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(path)?;
    file.write_all(bytes)
}

fn read_verified(path: &Path, key: CacheKey) -> io::Result<VerifiedCode> {
    let file = crate::files::open(path)?;
    // Of the open file, not of the path: nothing can come between.
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(io::Error::other("it is not a file"));
    }
    belongs_to_us_alone(&metadata)?;
    let mut bytes = Vec::with_capacity(metadata.len().min(CODE_BYTES) as usize);
    file.take(CODE_BYTES).read_to_end(&mut bytes)?;
    check(&bytes, key).map_err(io::Error::other)?;
    Ok(VerifiedCode { file: bytes })
}

fn check(file: &[u8], key: CacheKey) -> Result<(), &'static str> {
    let (magic, rest) = file.split_first_chunk::<8>().ok_or("it is too short")?;
    let (found, rest) = rest.split_first_chunk::<32>().ok_or("it is too short")?;
    let (length, rest) = rest.split_first_chunk::<8>().ok_or("it is too short")?;
    let (sum, code) = rest.split_first_chunk::<32>().ok_or("it is too short")?;
    if magic != MAGIC {
        return Err("it is no cache file of this version");
    }
    if found != key.0.as_bytes() {
        return Err("it belongs to another module, engine or settings");
    }
    if u64::from_le_bytes(*length) != code.len() as u64 {
        return Err("its length is not the one that it was written with");
    }
    if Digest::of(code).as_bytes() != sum {
        return Err("its checksum does not match");
    }
    Ok(())
}

fn make_private(directory: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(directory)
}

#[cfg(unix)]
fn belongs_to_us_alone(metadata: &Metadata) -> io::Result<()> {
    use std::os::unix::fs::MetadataExt;
    if metadata.uid() != rustix::process::geteuid().as_raw() {
        return Err(io::Error::other("it belongs to another user"));
    }
    if metadata.mode() & 0o022 != 0 {
        return Err(io::Error::other("others may write to it: take that right away (chmod go-w)"));
    }
    Ok(())
}

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "the same signature on every system")]
fn belongs_to_us_alone(_: &Metadata) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENGINE: EngineInfo = EngineInfo { name: "wasmtime", version: "48.0.8" };

    #[test]
    fn a_key_is_bound_to_module_engine_version_and_settings() {
        let key = CacheKey::new(Digest::of(b"a"), ENGINE, 1);
        assert_eq!(key, CacheKey::new(Digest::of(b"a"), ENGINE, 1));
        let newer = EngineInfo { version: "48.0.9", ..ENGINE };
        let other = EngineInfo { name: "wasmi", ..ENGINE };
        for different in [
            CacheKey::new(Digest::of(b"b"), ENGINE, 1),
            CacheKey::new(Digest::of(b"a"), newer, 1),
            CacheKey::new(Digest::of(b"a"), other, 1),
            CacheKey::new(Digest::of(b"a"), ENGINE, 2),
        ] {
            assert_ne!(key, different);
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_in_the_place_of_a_cache_file_holds_nobody_up() {
        let directory = tempfile::tempdir().unwrap();
        let cache = Cache::open(directory.path()).unwrap();
        let key = CacheKey::new(Digest::of(b"a"), ENGINE, 1);
        let made = std::process::Command::new("mkfifo").arg(cache.path(key)).status().unwrap();
        assert!(made.success());
        // Nobody will ever write into it.
        assert!(cache.read(key).is_none());
        cache.write(key, b"code");
        assert_eq!(cache.read(key).unwrap().as_bytes(), b"code");
    }

    #[test]
    fn what_was_written_is_read_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let cache = Cache::open(directory.path()).unwrap();
        let key = CacheKey::new(Digest::of(b"a"), ENGINE, 1);
        assert!(cache.read(key).is_none());
        cache.write(key, b"code");
        assert_eq!(cache.read(key).unwrap().as_bytes(), b"code");
        assert!(cache.read(CacheKey::new(Digest::of(b"b"), ENGINE, 1)).is_none());

        let file = fs::read(cache.path(key)).unwrap();
        for at in 0..file.len() {
            let mut damaged = file.clone();
            damaged[at] ^= 1;
            assert!(check(&damaged, key).is_err(), "byte {at} flipped");
            assert!(check(&file[..at], key).is_err(), "cut at byte {at}");
        }
        assert_eq!(check(&file, key), Ok(()));
    }
}
