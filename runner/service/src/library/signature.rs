//! Signatures with which front-end units take a module.

use softplug_host::Digest;

use super::{Library, LibraryError};
use crate::disk;

/// Bytes of a signature: the key's id, and the Ed25519 signature.
pub const SIGNATURE_BYTES: usize = 32 + 64;

impl Library {
    /// Keeps the signature of a module: the id of the key and the Ed25519 signature, as units
    /// want them. One that was there before is replaced.
    ///
    /// # Errors
    /// It is not [`SIGNATURE_BYTES`] long, there is no such module, or the disk would not take it.
    pub fn keep_signature(&self, digest: Digest, signature: &[u8]) -> Result<(), LibraryError> {
        if signature.len() != SIGNATURE_BYTES {
            return Err(LibraryError::Signature(signature.len()));
        }
        self.read(digest)?;
        disk::make_folder(&self.folder.join("signatures"))?;
        Ok(disk::write_whole(&self.signature_path(digest), signature)?)
    }

    /// The signature of a module, if there is one.
    ///
    /// # Errors
    /// What is there cannot be read, or is none.
    pub fn signature(&self, digest: Digest) -> Result<Option<Box<[u8]>>, LibraryError> {
        match disk::read_small(&self.signature_path(digest), SIGNATURE_BYTES) {
            Ok(bytes) if bytes.len() == SIGNATURE_BYTES => Ok(Some(bytes.into())),
            Ok(bytes) => Err(LibraryError::Signature(bytes.len())),
            Err(error) if error.is_missing() => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    fn signature_path(&self, digest: Digest) -> std::path::PathBuf {
        self.folder.join("signatures").join(format!("{digest}.sig"))
    }
}
