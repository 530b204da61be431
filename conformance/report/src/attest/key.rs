//! Ed25519 keys in PEM files, as `openssl genpkey -algorithm ed25519` and
//! `openssl pkey -pubout` write them.

use crate::text;
use base64::prelude::BASE64_STANDARD;
use base64::{DecodeError, Engine};
use data_encoding::HEXLOWER;
use ed25519_dalek::pkcs8::{DecodePrivateKey, DecodePublicKey};
use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Bytes that a key's file may have.
const LARGEST: usize = 16 << 10;
/// How the DER form of an Ed25519 public key begins (RFC 8410); its 32 bytes follow.
const PUBLIC_PREFIX: [u8; 12] = [0x30, 0x2A, 0x30, 5, 6, 3, 0x2B, 0x65, 0x70, 3, 0x21, 0];

/// A key to sign with. It is never printed, and wiped from memory when it is dropped.
///
/// The examples of [`PublicKey`] and [`sign`](super::sign) show one.
#[derive(Clone, Debug)]
pub struct PrivateKey(SigningKey);

/// A key to verify with.
///
/// ```
/// use softplug_report::attest::{PrivateKey, PublicKey};
/// use std::path::Path;
///
/// let (private, public) = (Path::new("tests/keys/private.pem"), Path::new("tests/keys/public.pem"));
/// let key = PrivateKey::read(private, &std::fs::read_to_string(private)?)?;
/// let public = PublicKey::read(public, &std::fs::read_to_string(public)?)?;
/// assert_eq!(key.public(), public);
/// assert_eq!(public.id().len(), 64);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct PublicKey(VerifyingKey);

impl PrivateKey {
    /// Reads a PEM file with a block `PRIVATE KEY` (PKCS#8). `file` is for errors only.
    ///
    /// # Errors
    /// There is no such block, or it holds no Ed25519 key.
    pub fn read(file: &Path, text: &str) -> Result<Self, KeyError> {
        let block = Block::find(file, text, "PRIVATE KEY")?;
        SigningKey::from_pkcs8_der(&block.der).map(Self).map_err(|error| block.unfit(&error))
    }

    /// The key that verifies what this one signs.
    pub fn public(&self) -> PublicKey {
        PublicKey(self.0.verifying_key())
    }

    pub(super) fn sign(&self, message: &[u8]) -> [u8; 64] {
        self.0.sign(message).to_bytes()
    }
}

impl PublicKey {
    /// Reads a PEM file with a block `PUBLIC KEY`. `file` is for errors only.
    ///
    /// # Errors
    /// There is no such block, or it holds no Ed25519 key, or a weak one.
    pub fn read(file: &Path, text: &str) -> Result<Self, KeyError> {
        let block = Block::find(file, text, "PUBLIC KEY")?;
        let key =
            VerifyingKey::from_public_key_der(&block.der).map_err(|error| block.unfit(&error))?;
        // Such a key takes one signature for many messages.
        if key.is_weak() { Err(block.unfit("it is a weak key")) } else { Ok(Self(key)) }
    }

    /// SHA-256 of the key in its DER form, as 64 hex digits: what
    /// `openssl pkey -pubin -in FILE -outform DER | sha256sum` prints.
    pub fn id(&self) -> String {
        let digest = Sha256::new().chain_update(PUBLIC_PREFIX).chain_update(self.0.as_bytes());
        HEXLOWER.encode(&digest.finalize())
    }

    pub(super) fn has_signed(&self, message: &[u8], signature: &[u8]) -> bool {
        let signature = Signature::from_slice(signature);
        signature.is_ok_and(|signature| self.0.verify_strict(message, &signature).is_ok())
    }
}

/// Why a key cannot be taken.
///
/// ```
/// use softplug_report::attest::{KeyError, PublicKey};
/// use std::path::Path;
///
/// let error = PublicKey::read(Path::new("key.pub"), "ssh-ed25519 AAAAC3Nz").unwrap_err();
/// assert!(matches!(error, KeyError::Missing { expected: "PUBLIC KEY", .. }));
/// assert!(error.to_string().starts_with("key.pub:1:1: holds no key: "));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum KeyError {
    /// The file is too large for a key.
    #[error("{}: a key's file has at most {} KiB", .file.display(), LARGEST >> 10)]
    TooLarge {
        /// The file.
        file: PathBuf,
    },
    /// There is no PEM block in it.
    #[error(
        "{}:1:1: holds no key: a line \"-----BEGIN {expected}-----\" is expected", .file.display()
    )]
    Missing {
        /// The file.
        file: PathBuf,
        /// The block that is expected.
        expected: &'static str,
    },
    /// The block is another one.
    #[error("{}:{line}:1: holds {}, and \"{expected}\" is expected: {}", .file.display(), text::quoted(.found), advice(.found))]
    OtherBlock {
        /// The file.
        file: PathBuf,
        /// Where the block begins, from 1.
        line: usize,
        /// What it is.
        found: String,
        /// What is expected.
        expected: &'static str,
    },
    /// The block is damaged.
    #[error("{}:{line}:{column}: {message}", .file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// Bytes from the line's beginning, from 1.
        column: usize,
        /// What is wrong there.
        message: &'static str,
    },
    /// The block holds no Ed25519 key.
    #[error("{}:{line}:1: this is no Ed25519 key: {message}", .file.display())]
    Unfit {
        /// The file.
        file: PathBuf,
        /// Where the block begins, from 1.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
}

/// What to do with a block that is not the expected one.
fn advice(found: &str) -> &'static str {
    match found {
        "PUBLIC KEY" => "give the private key, which signs",
        "PRIVATE KEY" => "give the public key, as `openssl pkey -in FILE -pubout` writes it",
        "ENCRYPTED PRIVATE KEY" => "decrypt it first, with `openssl pkey -in FILE`",
        _ => "make a key with `openssl genpkey -algorithm ed25519`",
    }
}

/// The content of a PEM block.
struct Block<'a> {
    file: &'a Path,
    /// Where it begins.
    line: usize,
    der: Vec<u8>,
}

impl<'a> Block<'a> {
    /// The only block of the file. Text around it is passed over, as RFC 7468 asks.
    fn find(file: &'a Path, text: &str, expected: &'static str) -> Result<Self, KeyError> {
        if text.len() > LARGEST {
            return Err(KeyError::TooLarge { file: file.to_owned() });
        }
        let damaged = |line, column, message| {
            let file = file.to_owned();
            KeyError::Damaged { file, line, column, message }
        };
        let mut lines = (1..).zip(text.lines());
        let Some((begin, found)) = lines.find_map(|(n, line)| Some((n, label(line, "BEGIN")?)))
        else {
            return Err(KeyError::Missing { file: file.to_owned(), expected });
        };
        if found != expected {
            let found = found.to_owned();
            return Err(KeyError::OtherBlock {
                file: file.to_owned(),
                line: begin,
                found,
                expected,
            });
        }
        let (mut last, mut base64, mut is_closed) = (begin, String::new(), false);
        // Of each byte of it, the line and column.
        let mut places = Vec::new();
        for (number, line) in lines.by_ref() {
            last = number;
            if line.trim().starts_with("-----") {
                is_closed = label(line, "END") == Some(expected);
                break;
            }
            let indent = line.len() - line.trim_start().len();
            base64.push_str(line.trim());
            places.extend((indent + 1..).map(|column| (number, column)).take(line.trim().len()));
        }
        if !is_closed {
            return Err(damaged(last, 1, "the line that ends the key is missing, or another one"));
        }
        if let Some((number, _)) = lines.find(|(_, line)| label(line, "BEGIN").is_some()) {
            return Err(damaged(number, 1, "a second key begins here, and one is expected"));
        }
        let der = BASE64_STANDARD.decode(&base64).map_err(|error| {
            let place = match error {
                DecodeError::InvalidByte(offset, _)
                | DecodeError::InvalidLastSymbol { offset, .. } => places.get(offset),
                DecodeError::InvalidLength(_) | DecodeError::InvalidPadding => None,
            };
            let end = places.last().map_or((last, 1), |(line, column)| (*line, column + 1));
            let (line, column) = place.copied().unwrap_or(end);
            damaged(line, column, "this is no base64: the key is damaged")
        })?;
        Ok(Self { file, line: begin, der })
    }

    fn unfit(&self, message: &(impl ToString + ?Sized)) -> KeyError {
        let message = message.to_string();
        KeyError::Unfit { file: self.file.to_owned(), line: self.line, message }
    }
}

/// The label of a line `-----BEGIN LABEL-----`.
fn label<'a>(line: &'a str, word: &str) -> Option<&'a str> {
    let line = line.trim().strip_prefix("-----")?.strip_prefix(word)?.strip_prefix(' ')?;
    line.strip_suffix("-----")
}
