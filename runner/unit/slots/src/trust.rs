//! Whose plug-ins a unit takes: digests and signatures.

use crate::error::{Refusal, SetUpError};
use crate::signature::Signature;
use core::fmt::Write;
use ed25519_dalek::VerifyingKey;
use sha2::{Digest, Sha256};

/// The DSSE payload type of what is signed for a plug-in.
pub const PAYLOAD_TYPE: &str = "application/vnd.softplug.plugin+json";

/// How the DER form of an Ed25519 public key begins (RFC 8410); its 32 bytes follow.
const PUBLIC_PREFIX: [u8; 12] = [0x30, 0x2A, 0x30, 5, 6, 3, 0x2B, 0x65, 0x70, 3, 0x21, 0];

impl Signature {
    /// Reads it as it is sent.
    ///
    /// # Errors
    /// [`Refusal::SignatureLength`].
    ///
    /// ```
    /// use softplug_unit_slots::{Refusal, Signature};
    ///
    /// let sent = [7; Signature::BYTES];
    /// assert_eq!(Signature::from_bytes(&sent)?.key, [7; 32]);
    /// assert!(Signature::from_bytes(&sent[1..]).is_err());
    /// # Ok::<(), Refusal>(())
    /// ```
    pub fn from_bytes(sent: &[u8]) -> Result<Self, Refusal> {
        let wrong = Refusal::SignatureLength { length: sent.len() };
        let (key, rest) = sent.split_first_chunk().ok_or(wrong)?;
        let bytes = rest.try_into().map_err(|_| wrong)?;
        Ok(Self { key: *key, bytes })
    }
}

/// Whose plug-ins a unit takes.
///
/// The example of [`Slots`](crate::Slots) makes one.
#[derive(Copy, Clone, Debug)]
pub struct Trust<'k> {
    keys: &'k [[u8; 32]],
    takes_unsigned: bool,
}

impl<'k> Trust<'k> {
    /// Only plug-ins that one of these Ed25519 public keys has signed.
    pub const fn signed(keys: &'k [[u8; 32]]) -> Self {
        Self { keys, takes_unsigned: false }
    }

    /// Plug-ins without a signature too, from anybody who reaches the unit. One that has a signature must have a good one.
    pub const fn unsigned_too(keys: &'k [[u8; 32]]) -> Self {
        Self { keys, takes_unsigned: true }
    }

    pub(crate) fn must_be_sound(&self) -> Result<(), SetUpError> {
        if self.keys.is_empty() && !self.takes_unsigned {
            return Err(SetUpError::NoKeys);
        }
        for (number, key) in self.keys.iter().enumerate() {
            // A weak key takes one signature for many messages.
            if VerifyingKey::from_bytes(key).map_or(true, |key| key.is_weak()) {
                return Err(SetUpError::Key { number });
            }
        }
        Ok(())
    }

    pub(crate) fn check(
        &self,
        length: u32,
        digest: &[u8; 32],
        signature: Option<&Signature>,
    ) -> Result<(), Refusal> {
        let Some(signature) = signature else {
            return if self.takes_unsigned { Ok(()) } else { Err(Refusal::Unsigned) };
        };
        let Some(key) = self.keys.iter().find(|key| key_id(key) == signature.key) else {
            return Err(Refusal::UnknownKey);
        };
        let bytes = ed25519_dalek::Signature::from_bytes(&signature.bytes);
        let signed = ToBeSigned::new(length, digest);
        VerifyingKey::from_bytes(key)
            .and_then(|key| key.verify_strict(signed.as_bytes(), &bytes))
            .map_err(|_| Refusal::Signature)
    }
}

/// The id of an Ed25519 public key: SHA-256 of its DER form, as signed reports have it.
///
/// ```
/// let id = softplug_unit_slots::key_id(&[7; 32]);
/// assert_eq!(id[..4], [0x5D, 0x2D, 0x7A, 0x29]);
/// ```
pub fn key_id(key: &[u8; 32]) -> [u8; 32] {
    Sha256::new().chain_update(PUBLIC_PREFIX).chain_update(key).finalize().into()
}

/// The bytes that are signed for a plug-in: DSSE's pre-authentication encoding of its length and digest.
///
/// ```
/// use ed25519_dalek::{Signer, SigningKey};
/// use softplug_unit_slots::{Signature, ToBeSigned, key_id};
///
/// let key = SigningKey::from_bytes(&[1; 32]);
/// let (length, digest) = (17_000, [0xAB; 32]);
/// let signature = Signature {
///     key: key_id(&key.verifying_key().to_bytes()),
///     bytes: key.sign(ToBeSigned::new(length, &digest).as_bytes()).to_bytes(),
/// };
/// # let _ = signature;
/// ```
#[derive(Clone, Debug)]
pub struct ToBeSigned {
    bytes: [u8; Self::LONGEST],
    length: usize,
}

impl ToBeSigned {
    /// Type and payload, and what DSSE puts around them, with the longest number.
    const LONGEST: usize = 160;

    /// For a module of this many bytes with this SHA-256.
    pub fn new(length: u32, digest: &[u8; 32]) -> Self {
        Self::build(length, digest).expect("the longest one fits")
    }

    fn build(length: u32, digest: &[u8; 32]) -> Result<Self, core::fmt::Error> {
        let mut payload = Self::empty();
        write!(payload, "{{\"length\":{length},\"sha256\":\"")?;
        for byte in digest {
            write!(payload, "{byte:02x}")?;
        }
        write!(payload, "\"}}")?;
        let mut all = Self::empty();
        let (kind, size) = (PAYLOAD_TYPE.len(), payload.length);
        write!(all, "DSSEv1 {kind} {PAYLOAD_TYPE} {size} ")?;
        all.append(payload.as_bytes())?;
        Ok(all)
    }

    /// What the signature is made of.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    const fn empty() -> Self {
        Self { bytes: [0; Self::LONGEST], length: 0 }
    }

    fn append(&mut self, bytes: &[u8]) -> core::fmt::Result {
        let end = self.length + bytes.len();
        self.bytes.get_mut(self.length..end).ok_or(core::fmt::Error)?.copy_from_slice(bytes);
        self.length = end;
        Ok(())
    }
}

impl Write for ToBeSigned {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        self.append(text.as_bytes())
    }
}
