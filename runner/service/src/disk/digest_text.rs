//! A digest as 64 hex digits in what is written, for serde's `with`.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serializer};
use softplug_host::Digest;

/// Writes it.
///
/// # Errors
/// The writer's.
pub fn serialize<S: Serializer>(digest: &Digest, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(digest)
}

/// Reads it.
///
/// # Errors
/// It is no digest.
pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Digest, D::Error> {
    String::deserialize(from)?.parse().map_err(D::Error::custom)
}
