//! The keys by which gateway and unit know each other: Ed25519, private ones in files, public ones as a text.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use rustls::crypto::ring;
use rustls::crypto::ring::sign::any_eddsa_type;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{PrivatePkcs8KeyDer, SubjectPublicKeyInfoDer};
use rustls::sign::SigningKey;
use thiserror::Error;

/// Bytes that a key's file may have.
const LARGEST: u64 = 16 << 10;
/// How the DER form of an Ed25519 public key begins (RFC 8410); its 32 bytes follow.
const PUBLIC_PREFIX: [u8; 12] = [0x30, 0x2A, 0x30, 5, 6, 3, 0x2B, 0x65, 0x70, 3, 0x21, 0];
/// How the DER form of a private one begins; its 32 bytes follow.
const PRIVATE_PREFIX: [u8; 16] =
    [0x30, 0x2E, 2, 1, 0, 0x30, 5, 6, 3, 0x2B, 0x65, 0x70, 4, 0x22, 4, 0x20];
/// The rights of everybody but the owner.
const OTHERS: u32 = 0o077;

/// The public key of a gateway or a unit. As a text it is the line between BEGIN and END of what
/// `openssl pkey -pubout` writes.
///
/// ```
/// use softplug_unit_uplink::TlsPublicKey;
///
/// let text = "MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=";
/// let key: TlsPublicKey = text.parse().unwrap();
/// assert_eq!(key.to_string(), text);
/// assert!("works.pem".parse::<TlsPublicKey>().is_err());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash)]
pub struct TlsPublicKey([u8; 32]);

impl TlsPublicKey {
    /// Of its DER form; `None`: it is no Ed25519 key.
    pub(crate) fn from_der(der: &[u8]) -> Option<Self> {
        let bytes = der.strip_prefix(&PUBLIC_PREFIX)?;
        bytes.try_into().ok().map(Self)
    }

    pub(crate) fn der(&self) -> [u8; 44] {
        let mut der = [0; 44];
        der[..12].copy_from_slice(&PUBLIC_PREFIX);
        der[12..].copy_from_slice(&self.0);
        der
    }
}

impl FromStr for TlsPublicKey {
    type Err = NoTlsKey;

    fn from_str(text: &str) -> Result<Self, NoTlsKey> {
        let der = BASE64_STANDARD.decode(text).ok();
        der.and_then(|der| Self::from_der(&der)).ok_or(NoTlsKey)
    }
}

impl fmt::Display for TlsPublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&BASE64_STANDARD.encode(self.der()))
    }
}

impl fmt::Debug for TlsPublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A text that is no public key.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("this is no public key: {}", Self::WRITE)]
pub struct NoTlsKey;

impl NoTlsKey {
    /// What to do.
    pub const WRITE: &str = "write the text that `softplug unit key --show FILE` shows for the \
                             other side's key, MCowBQYDK2VwAyEA and 44 more characters";
}

/// The private key of a gateway or a unit. It is never shown.
///
/// ```
/// use softplug_unit_uplink::TlsPrivateKey;
///
/// let folder = tempfile::tempdir()?;
/// let file = folder.path().join("unit.key");
/// let key = TlsPrivateKey::make(&file)?;
/// assert_eq!(TlsPrivateKey::read(&file)?.public(), key.public());
/// assert!(TlsPrivateKey::make(&file).is_err(), "a key is never overwritten");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct TlsPrivateKey {
    signs: Arc<dyn SigningKey>,
    public: TlsPublicKey,
}

impl TlsPrivateKey {
    /// Reads a PEM file with a block `PRIVATE KEY` (PKCS#8), as [`make`](Self::make) and `openssl
    /// genpkey -algorithm ed25519` write it.
    ///
    /// # Errors
    /// It cannot be read, others can read it too, or it holds no such key.
    pub fn read(file: &Path) -> Result<Self, TlsKeyError> {
        let unread = |source| TlsKeyError::Io { file: file.to_owned(), what: "read", source };
        // Rights and text are those of one file, whatever becomes of its name meanwhile.
        let mut opened = File::open(file).map_err(unread)?;
        let about = opened.metadata().map_err(unread)?;
        if about.mode() & OTHERS != 0 {
            return Err(TlsKeyError::Open { file: file.to_owned(), mode: about.mode() & 0o777 });
        }
        let mut text = Vec::new();
        (&mut opened).take(LARGEST).read_to_end(&mut text).map_err(unread)?;
        let unfit = || TlsKeyError::Unfit { file: file.to_owned() };
        let der = PrivatePkcs8KeyDer::from_pem_slice(&text).map_err(|_| unfit())?;
        Self::from_der(&der).ok_or_else(unfit)
    }

    /// Makes a key and writes it into a new file that nobody else can read.
    ///
    /// # Errors
    /// There is such a file, or none can be written there.
    pub fn make(file: &Path) -> Result<Self, TlsKeyError> {
        let unwritten = |source: io::Error| {
            let file = file.to_owned();
            match source.kind() {
                io::ErrorKind::AlreadyExists => TlsKeyError::IsThere { file },
                _ => TlsKeyError::Io { file, what: "written", source },
            }
        };
        let mut der = [0; 48];
        der[..16].copy_from_slice(&PRIVATE_PREFIX);
        ring::default_provider()
            .secure_random
            .fill(&mut der[16..])
            .map_err(|_| TlsKeyError::NoRandom)?;
        let key =
            Self::from_der(&PrivatePkcs8KeyDer::from(&der[..])).ok_or(TlsKeyError::NoRandom)?;
        let text = BASE64_STANDARD.encode(der);
        let text = format!("-----BEGIN PRIVATE KEY-----\n{text}\n-----END PRIVATE KEY-----\n");
        let mut made = OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(file)
            .map_err(unwritten)?;
        made.write_all(text.as_bytes()).and_then(|()| made.sync_all()).map_err(unwritten)?;
        Ok(key)
    }

    /// By which the other side knows this one.
    pub fn public(&self) -> TlsPublicKey {
        self.public
    }

    fn from_der(der: &PrivatePkcs8KeyDer<'_>) -> Option<Self> {
        let signs = any_eddsa_type(der).ok()?;
        let public: SubjectPublicKeyInfoDer<'_> = signs.public_key()?;
        let public = TlsPublicKey::from_der(&public)?;
        Some(Self { signs, public })
    }

    pub(crate) fn signs(&self) -> Arc<dyn SigningKey> {
        Arc::clone(&self.signs)
    }
}

impl fmt::Debug for TlsPrivateKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TlsPrivateKey").field("public", &self.public).finish_non_exhaustive()
    }
}

/// Why a file with a private key cannot be used.
#[derive(Debug, Error)]
pub enum TlsKeyError {
    /// It cannot be read, or not be written.
    #[error("the key {} cannot be {what}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// What cannot be done with it.
        what: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// Others than its owner have rights to it.
    #[error(
        "the key {shown} can be read or written by others than its owner (mode {mode:03o}): `chmod \
         600 {shown}`, and take another key if one of them may have read it",
        shown = file.display()
    )]
    Open {
        /// The file.
        file: PathBuf,
        /// Its rights.
        mode: u32,
    },
    /// It holds no such key.
    #[error(
        "{} holds no private Ed25519 key that can be read: make one with `softplug unit key FILE`, \
         or with `openssl genpkey -algorithm ed25519`",
        file.display()
    )]
    Unfit {
        /// The file.
        file: PathBuf,
    },
    /// A key is never overwritten.
    #[error(
        "{} is there already, and a key is never overwritten: name a new file, or see its public \
         key with --show",
        file.display()
    )]
    IsThere {
        /// The file.
        file: PathBuf,
    },
    /// No key can be made without.
    #[error("the system gives no random numbers to make a key of")]
    NoRandom,
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    /// As `openssl genpkey -algorithm ed25519` and `openssl pkey -pubout` write them.
    const PRIVATE: &str = "-----BEGIN PRIVATE KEY-----\n\
                           MC4CAQAwBQYDK2VwBCIEINTuctv5E1hK1bbY8fdp+K06/nwoy/HU++CXqI9EdVhC\n\
                           -----END PRIVATE KEY-----\n";
    const PUBLIC: &str = "MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=";

    fn read(text: &str, mode: u32) -> Result<TlsPrivateKey, TlsKeyError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("some.key");
        fs::write(&file, text).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
        TlsPrivateKey::read(&file)
    }

    #[test]
    fn a_key_that_openssl_made_is_read() {
        assert_eq!(read(PRIVATE, 0o600).unwrap().public().to_string(), PUBLIC);
        assert_eq!(read(PRIVATE, 0o400).unwrap().public(), PUBLIC.parse().unwrap());
    }

    #[test]
    fn a_key_that_others_may_touch_is_refused() {
        for mode in [0o640, 0o604, 0o620, 0o602, 0o610, 0o644, 0o666] {
            let error = read(PRIVATE, mode).unwrap_err();
            assert!(matches!(error, TlsKeyError::Open { mode: is, .. } if is == mode), "{error}");
        }
    }

    #[test]
    fn what_is_no_key_is_refused() {
        let encrypted = PRIVATE.replace("PRIVATE", "ENCRYPTED PRIVATE");
        let cut = PRIVATE.replace("dVhC", "");
        let public = format!("-----BEGIN PUBLIC KEY-----\n{PUBLIC}\n-----END PUBLIC KEY-----\n");
        let other_kind = PRIVATE.replace("K2Vw", "K2Vx");
        for text in ["", "no key", &encrypted, &cut, &public, &other_kind] {
            let error = read(text, 0o600).unwrap_err();
            assert!(matches!(error, TlsKeyError::Unfit { .. }), "{text}: {error}");
        }
        let error = TlsPrivateKey::read(Path::new("/nowhere")).unwrap_err();
        assert!(matches!(error, TlsKeyError::Io { .. }), "{error}");
    }

    #[test]
    fn a_key_is_made_for_its_owner_alone_and_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("unit.key");
        let key = TlsPrivateKey::make(&file).unwrap();
        let text = fs::read(&file).unwrap();
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
        let error = TlsPrivateKey::make(&file).unwrap_err();
        assert!(matches!(error, TlsKeyError::IsThere { .. }), "{error}");
        assert_eq!(fs::read(&file).unwrap(), text);
        let other = TlsPrivateKey::make(&folder.path().join("other.key")).unwrap();
        assert_ne!(key.public(), other.public());
        assert!(!format!("{key:?}").contains(text.escape_ascii().to_string().as_str()));
    }

    #[test]
    fn texts_that_are_no_public_keys_are_refused() {
        let short = &PUBLIC[..56];
        let other_kind = PUBLIC.replace("K2Vw", "K2Vx");
        for text in ["", "unit.key", short, &other_kind, &format!("{PUBLIC} "), &PRIVATE[28..92]] {
            assert_eq!(text.parse::<TlsPublicKey>(), Err(NoTlsKey), "{text}");
        }
    }
}
