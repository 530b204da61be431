//! Signed results: what they say, and that no part of them can be changed.

use crate::common::{SAMPLES, leaves, sample, text};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::Value;
use softplug_report::attest::{self, KeyError, PrivateKey, PublicKey, Source, VerifyError};
use softplug_report::{VerdictKind, json};
use std::path::Path;

const PRIVATE: &str = include_str!("keys/private.pem");
const PUBLIC: &str = include_str!("keys/public.pem");
const OTHER: &str = include_str!("keys/other-public.pem");

fn private() -> PrivateKey {
    PrivateKey::read(Path::new("private.pem"), PRIVATE).unwrap()
}

fn public() -> PublicKey {
    PublicKey::read(Path::new("public.pem"), PUBLIC).unwrap()
}

fn signed(name: &str) -> String {
    attest::sign(&sample(name), &private()).unwrap()
}

fn verify(envelope: &str, report: &str) -> Result<(), VerifyError> {
    let envelope = Source { file: Path::new("attestation.json"), text: envelope };
    let report = Source { file: Path::new("conformance.json"), text: report };
    attest::verify(envelope, report, &public()).map(|_| ())
}

fn error(envelope: &str, report: &str) -> String {
    verify(envelope, report).unwrap_err().to_string()
}

fn statement(envelope: &str) -> Value {
    let envelope: Value = serde_json::from_str(envelope).unwrap();
    let payload = BASE64_STANDARD.decode(envelope["payload"].as_str().unwrap()).unwrap();
    serde_json::from_slice(&payload).unwrap()
}

/// Signs any statement with the real key, as softplug itself never would.
fn signed_anyway(statement: &Value) -> String {
    use ed25519_dalek::pkcs8::DecodePrivateKey;
    use ed25519_dalek::{Signer, SigningKey};

    let payload = statement.to_string();
    let kind = "application/vnd.in-toto+json";
    let message = format!("DSSEv1 {} {kind} {} {payload}", kind.len(), payload.len());
    let base64: String = PRIVATE.lines().filter(|line| line.starts_with("MC4")).collect();
    let key = SigningKey::from_pkcs8_der(&BASE64_STANDARD.decode(base64).unwrap()).unwrap();
    serde_json::json!({
        "payloadType": kind,
        "payload": BASE64_STANDARD.encode(&payload),
        "signatures": [{
            "keyid": public().id(),
            "sig": BASE64_STANDARD.encode(key.sign(message.as_bytes()).to_bytes()),
        }],
    })
    .to_string()
}

/// Another value of the same type.
fn another(value: &Value) -> Value {
    match value {
        Value::String(text) if text.is_empty() => "x".into(),
        Value::String(text) => {
            let first = if text.starts_with('0') { '1' } else { '0' };
            std::iter::once(first).chain(text.chars().skip(1)).collect::<String>().into()
        }
        Value::Number(number) => (number.as_i64().unwrap() + 1).into(),
        Value::Bool(flag) => (!flag).into(),
        _ => "x".into(),
    }
}

#[test]
fn the_statement_says_what_follows_from_the_report() {
    let all: Vec<String> = SAMPLES
        .iter()
        .map(|(name, _)| {
            let statement = statement(&signed(name));
            format!("# {name}\n{}", serde_json::to_string_pretty(&statement).unwrap())
        })
        .collect();
    insta::assert_snapshot!(all.join("\n"));
}

#[test]
fn every_verdict_can_be_signed_and_only_conformant_ones_are_passed() {
    for (name, verdict) in SAMPLES {
        let envelope = signed(name);
        verify(&envelope, &text(name)).unwrap();
        assert_eq!(envelope, signed(name), "the same bytes each time");
        let expected = match verdict {
            VerdictKind::Conformant => "PASSED",
            VerdictKind::ConformantWithWarnings => "WARNED",
            _ => "FAILED",
        };
        assert_eq!(statement(&envelope)["predicate"]["result"], expected, "{name}");
    }
}

#[test]
fn a_report_that_contradicts_itself_is_not_signed() {
    let mut report = sample("not-conformant");
    report.verdict = VerdictKind::Conformant;
    assert_eq!(attest::sign(&report, &private()).unwrap_err().place, "verdict");
}

#[test]
fn no_part_of_an_envelope_can_be_changed() {
    let (envelope, report) = (signed("warnings"), text("warnings"));
    let value: Value = serde_json::from_str(&envelope).unwrap();
    let all = leaves(&value);
    assert_eq!(all.len(), 4, "payload, its type, key id and signature: {all:?}");
    for pointer in all {
        let mut changed = value.clone();
        let leaf = changed.pointer_mut(&pointer).unwrap();
        *leaf = another(leaf);
        verify(&changed.to_string(), &report).expect_err(&pointer);
    }
    let whole = value["payload"].as_str().unwrap();
    for place in 0..whole.len() {
        let (head, tail) = whole.split_at(place);
        let other = if tail.starts_with('A') { 'B' } else { 'A' };
        let mut changed = value.clone();
        changed["payload"] = format!("{head}{other}{}", &tail[1..]).into();
        verify(&changed.to_string(), &report).expect_err("a character of the payload");
    }
}

#[test]
fn no_part_of_a_statement_can_be_changed_even_by_its_signer() {
    for name in ["conformant", "warnings", "not-conformant", "stale-baseline"] {
        let (good, report) = (statement(&signed(name)), text(name));
        verify(&signed_anyway(&good), &report).expect("signed anew, it still holds");
        let all = leaves(&good);
        assert!(all.len() > 15, "{all:?}");
        for pointer in all {
            let mut changed = good.clone();
            let leaf = changed.pointer_mut(&pointer).unwrap();
            *leaf = another(leaf);
            let error = verify(&signed_anyway(&changed), &report).expect_err(&pointer);
            let is_right = match pointer.as_str() {
                "/_type" | "/predicateType" => matches!(error, VerifyError::Statement { .. }),
                "/predicate/result" => matches!(error, VerifyError::Result { .. }),
                "/predicate/configuration/0/digest/sha256" => {
                    matches!(error, VerifyError::ReportDigest { .. })
                }
                _ if pointer.starts_with("/subject/") => {
                    matches!(error, VerifyError::Subject { .. })
                }
                _ => matches!(error, VerifyError::Field { .. }),
            };
            assert!(is_right, "{pointer}: {error}");
        }
    }
}

#[test]
fn no_part_of_a_report_can_be_changed() {
    let envelope = signed("not-conformant");
    let report = text("not-conformant");
    let value: Value = serde_json::from_str(&report).unwrap();
    let all = leaves(&value);
    assert!(all.len() > 200);
    for pointer in all {
        let mut changed = value.clone();
        let leaf = changed.pointer_mut(&pointer).unwrap();
        *leaf = another(leaf);
        let changed = format!("{}\n", serde_json::to_string_pretty(&changed).unwrap());
        verify(&envelope, &changed).expect_err(&pointer);
    }
    let spaced = format!("{report}\n");
    assert!(matches!(verify(&envelope, &spaced), Err(VerifyError::ReportDigest { .. })));
}

#[test]
fn what_is_wrong_is_named() {
    let (envelope, report) = (signed("conformant"), text("conformant"));
    let value: Value = serde_json::from_str(&envelope).unwrap();
    let changed = |pointer: &str, new: Value| {
        let mut changed = value.clone();
        *changed.pointer_mut(pointer).unwrap() = new;
        changed.to_string()
    };
    let mut all = vec![
        error("{\n  \"payloadType\": 1}", &report),
        error(&changed("/payloadType", "text/plain\u{1B}".into()), &report),
        error(&changed("/payload", "!".into()), &report),
        error(&changed("/signatures", serde_json::json!([])), &report),
        error(&changed("/signatures/0/keyid", "ab".into()), &report),
        error(&changed("/signatures/0/sig", "AAAA".into()), &report),
        error(&changed("/signatures/0/sig", "A".into()), &report),
        error(&envelope, &report.replace("\"failed\": 0,", "\"failed\": 1,")),
        error(&envelope, &text("partial")),
        error(&signed_anyway(&serde_json::json!({"a\u{1B}": 1})), &report),
        error(&" ".repeat(attest::LARGEST + 1), &report),
    ];
    let mut other_module: Value = serde_json::from_str(&report).unwrap();
    other_module["plugin"]["sha256"] = "1".repeat(64).into();
    all.push(error(&envelope, &other_module.to_string()));
    let mut statement = statement(&envelope);
    statement["predicate"]["result"] = "FAILED".into();
    all.push(error(&signed_anyway(&statement), &report));
    insta::assert_snapshot!(all.join("\n"));

    let other = PublicKey::read(Path::new("other.pem"), OTHER).unwrap();
    let envelope = Source { file: Path::new("attestation.json"), text: &envelope };
    let report = Source { file: Path::new("conformance.json"), text: &report };
    let error = attest::verify(envelope, report, &other).unwrap_err();
    assert!(matches!(error, VerifyError::OtherKey { .. }), "{error}");
}

#[test]
fn another_signature_beside_it_does_no_harm() {
    let mut envelope: Value = serde_json::from_str(&signed("conformant")).unwrap();
    let signatures = envelope["signatures"].as_array_mut().unwrap();
    signatures.insert(0, serde_json::json!({"keyid": "of another", "sig": "AAAA"}));
    verify(&envelope.to_string(), &text("conformant")).unwrap();
}

#[test]
fn keys_are_read_as_openssl_writes_them() {
    assert_eq!(private().public(), public());
    // openssl pkey -pubin -in public.pem -outform DER | sha256sum
    let id = "f239974f045bfdd6cc30caea1671e77e88fefa37e3c86c2093af18d184647490";
    assert_eq!(public().id(), id);
    let windows = PUBLIC.replace('\n', "\r\n");
    assert_eq!(PublicKey::read(Path::new("a"), &windows), Ok(public()));
    let printed = format!("{:?}", private()).to_lowercase();
    let begin_of_secret = ["255, 164", "ffa427", "ff, a4", "p+kjw"];
    assert!(!begin_of_secret.iter().any(|text| printed.contains(text)), "{printed}");
}

#[test]
fn damaged_keys_are_refused_with_their_place() {
    let private = |text: &str| PrivateKey::read(Path::new("key.pem"), text).unwrap_err();
    let public = |text: &str| PublicKey::read(Path::new("key.pem"), text).unwrap_err();
    let zero = BASE64_STANDARD.encode(
        [&[0x30, 0x2A, 0x30, 5, 6, 3, 0x2B, 0x65, 0x70, 3, 0x21, 0][..], &[0; 32][..]].concat(),
    );
    let errors: Vec<KeyError> = vec![
        private(""),
        private(PUBLIC),
        public(PRIVATE),
        private(include_str!("keys/encrypted.pem")),
        private(include_str!("keys/x25519.pem")),
        private("-----BEGIN OPENSSH PRIVATE KEY-----\u{1B}-----"),
        private(&PRIVATE.replace("MC4CAQ", "MC4C*Q")),
        private(&PRIVATE.replace("MC4CAQ", "  MC4C*Q")),
        private(&PRIVATE.replace("MC4CAQ", "MC4")),
        private(&PRIVATE.replace("MC4CAQAw", "")),
        private(PRIVATE.lines().take(3).collect::<Vec<_>>().join("\n").as_str()),
        private(&PRIVATE.replace("END PRIVATE", "END PUBLIC")),
        private(&format!("{PRIVATE}{PRIVATE}")),
        public(&format!("-----BEGIN PUBLIC KEY-----\n{zero}\n-----END PUBLIC KEY-----")),
        public(&"x".repeat(1 << 20)),
    ];
    let all: Vec<_> = errors.iter().map(ToString::to_string).collect();
    insta::assert_snapshot!(all.join("\n"));
}

/// Any single wrong character of a key's file is an error or another key, never a crash.
#[test]
fn a_key_with_any_one_character_changed_is_not_the_key() {
    let begin = PRIVATE.find("MC4").unwrap();
    for place in begin..PRIVATE.len() - 1 {
        let changed = if PRIVATE.as_bytes()[place] == b'A' { "B" } else { "A" };
        let mut text = PRIVATE.to_owned();
        text.replace_range(place..=place, changed);
        if let Ok(key) = PrivateKey::read(Path::new("key.pem"), &text) {
            assert_ne!(key.public(), public(), "{place}");
        }
    }
}

#[test]
fn a_signed_report_is_read_back() {
    let (envelope, report) = (signed("conformant"), text("conformant"));
    let envelope = Source { file: Path::new("attestation.json"), text: &envelope };
    let source = Source { file: Path::new("conformance.json"), text: &report };
    let judged = attest::verify(envelope, source, &public()).unwrap();
    assert_eq!(json::write(&judged), report);
}

/// Held against a program that shares no code with this one.
mod needs_openssl {
    use super::*;
    use std::process::Command;

    fn openssl(folder: &Path, arguments: &[&str]) -> String {
        let output = Command::new("openssl").args(arguments).current_dir(folder).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    #[test]
    fn openssl_makes_the_keys_and_verifies_the_signature() {
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).unwrap();
        };
        openssl(folder.path(), &["genpkey", "-algorithm", "ed25519", "-out", "private.pem"]);
        let make = ["pkey", "-in", "private.pem", "-pubout", "-out", "public.pem"];
        openssl(folder.path(), &make);
        let key = PrivateKey::read(Path::new("private.pem"), &read("private.pem")).unwrap();
        let public = PublicKey::read(Path::new("public.pem"), &read("public.pem")).unwrap();
        assert_eq!(key.public(), public);

        let envelope = attest::sign(&sample("conformant"), &key).unwrap();
        let envelope: Value = serde_json::from_str(&envelope).unwrap();
        let decode = |text: &Value| BASE64_STANDARD.decode(text.as_str().unwrap()).unwrap();
        let payload = decode(&envelope["payload"]);
        let kind = envelope["payloadType"].as_str().unwrap();
        let mut message = format!("DSSEv1 {} {kind} {} ", kind.len(), payload.len()).into_bytes();
        message.extend(payload);
        write("message", &message);
        write("signature", &decode(&envelope["signatures"][0]["sig"]));
        let verify = [
            "pkeyutl",
            "-verify",
            "-pubin",
            "-inkey",
            "public.pem",
            "-rawin",
            "-in",
            "message",
            "-sigfile",
            "signature",
        ];
        let said = openssl(folder.path(), &verify);
        assert!(said.contains("Signature Verified Successfully"), "{said}");

        message[0] ^= 1;
        write("message", &message);
        let refused = Command::new("openssl").args(verify).current_dir(folder.path()).output();
        assert!(!refused.unwrap().status.success(), "the check can fail");
    }
}
