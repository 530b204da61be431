//! The DSSE envelope: a payload with its type, and signatures over both.

use super::key::{PrivateKey, PublicKey};
use super::{LARGEST, Source, VerifyError};
use crate::text;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The type of a payload that is an in-toto statement.
pub(super) const PAYLOAD: &str = "application/vnd.in-toto+json";

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub(super) struct Envelope {
    payload_type: String,
    payload: String,
    signatures: Vec<Signature>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Signature {
    keyid: String,
    sig: String,
}

impl Envelope {
    pub(super) fn sign(payload: &str, key: &PrivateKey) -> Self {
        let signature = key.sign(&authenticated(PAYLOAD, payload.as_bytes()));
        let signature =
            Signature { keyid: key.public().id(), sig: BASE64_STANDARD.encode(signature) };
        Self {
            payload_type: PAYLOAD.to_owned(),
            payload: BASE64_STANDARD.encode(payload),
            signatures: vec![signature],
        }
    }

    pub(super) fn write(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("an envelope is texts");
        text.push('\n');
        text
    }

    pub(super) fn read(source: Source<'_>) -> Result<Self, VerifyError> {
        let file = source.file.to_owned();
        if source.text.len() > LARGEST {
            return Err(VerifyError::TooLarge { file });
        }
        serde_json::from_str(source.text).map_err(|error| {
            let (line, column, message) = text::json_error(&error);
            VerifyError::Malformed { file, line, column, message }
        })
    }

    /// The payload, if this key has signed it. Other keys may have signed it too.
    pub(super) fn open(&self, file: &Path, key: &PublicKey) -> Result<Vec<u8>, VerifyError> {
        if self.payload_type != PAYLOAD {
            let found = self.payload_type.clone();
            return Err(VerifyError::PayloadType { file: file.to_owned(), found });
        }
        let id = key.id();
        let Some(signature) = self.signatures.iter().find(|signature| signature.keyid == id) else {
            let found = self.signatures.iter().map(|signature| signature.keyid.clone()).collect();
            return Err(VerifyError::OtherKey { file: file.to_owned(), expected: id, found });
        };
        let decode = |field, text: &String| {
            let error = |_| VerifyError::Base64 { file: file.to_owned(), field };
            BASE64_STANDARD.decode(text).map_err(error)
        };
        let payload = decode("payload", &self.payload)?;
        let signature = decode("sig", &signature.sig)?;
        if !key.has_signed(&authenticated(&self.payload_type, &payload), &signature) {
            return Err(VerifyError::Signature { file: file.to_owned() });
        }
        Ok(payload)
    }
}

/// DSSE's pre-authentication encoding: no byte can move between type and payload.
fn authenticated(kind: &str, payload: &[u8]) -> Vec<u8> {
    let mut bytes = format!("DSSEv1 {} {kind} {} ", kind.len(), payload.len()).into_bytes();
    bytes.extend_from_slice(payload);
    bytes
}

/// Ids of keys in a sentence.
pub(super) fn listed(ids: &[String]) -> String {
    match ids {
        [] => "none at all".to_owned(),
        ids => {
            let shown: Vec<_> = ids.iter().take(3).map(|id| text::quoted(id)).collect();
            let more = if ids.len() > 3 { ", …" } else { "" };
            shown.join(", ") + more
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of DSSE's own specification.
    #[test]
    fn what_is_signed_is_encoded_as_the_specification_says() {
        let bytes = authenticated("http://example.com/HelloWorld", b"hello world");
        assert_eq!(bytes, b"DSSEv1 29 http://example.com/HelloWorld 11 hello world");
    }
}
