//! The signature that comes with a plug-in.

/// The signature that comes with a plug-in.
///
/// The example of [`ToBeSigned`](crate::ToBeSigned) makes one.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Signature {
    /// The key's id, see [`key_id`](crate::key_id). It only says which key to try.
    pub key: [u8; 32],
    /// The Ed25519 signature of [`ToBeSigned`](crate::ToBeSigned).
    pub bytes: [u8; 64],
}

impl Signature {
    /// Bytes of it as it is sent: the key's id, and the signature.
    pub const BYTES: usize = 32 + 64;
}
