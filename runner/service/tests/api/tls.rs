//! The API over TLS.

use std::fs;
use std::io::{Read, Write};
use std::time::Duration;

use softplug_service::http::Certificate;
use ureq::tls::{RootCerts, TlsConfig};
use ureq::{Agent, tls};

use crate::common::bench::Bench;

/// A gateway with a certificate for `localhost`, and that certificate.
fn secured() -> (Bench, String) {
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (chain, key) = (folder.path().join("chain.pem"), folder.path().join("key.pem"));
    fs::write(&chain, made.cert.pem()).unwrap();
    fs::write(&key, made.signing_key.serialize_pem()).unwrap();
    let bench = Bench::with(|options| {
        options.certificate = Some(Certificate { chain, key });
        options.limits.head_patience = Duration::from_secs(20);
    });
    (bench, made.cert.pem())
}

#[test]
fn who_trusts_the_certificate_gets_in_and_nobody_else() {
    let (bench, pem) = secured();
    let url = format!("https://localhost:{}/api/v1/me", bench.address().port());
    let ask = |configuration: TlsConfig| {
        let agent: Agent =
            Agent::config_builder().proxy(None).tls_config(configuration).build().into();
        agent.get(&url).header("Authorization", format!("Bearer {}", bench.operator)).call()
    };
    let certificate = tls::Certificate::from_pem(pem.as_bytes()).unwrap();
    let roots = RootCerts::new_with_certs(&[certificate]);
    let mut answer = ask(TlsConfig::builder().root_certs(roots).build()).unwrap();
    let text = answer.body_mut().read_to_string().unwrap();
    assert_eq!(text, r#"{"role":"operator"}"#);
    assert!(ask(TlsConfig::default()).is_err());
}

#[test]
fn without_tls_nothing_is_answered() {
    let (bench, _) = secured();
    let answer = bench.raw(bench.request("GET", "/api/v1/me", "").as_bytes());
    assert!(!answer.contains("HTTP/1.1 200"), "{answer}");
    let mut torn = bench.connect();
    torn.write_all(b"\x16\x03\x01\x00\xf4\x01").unwrap();
    torn.shutdown(std::net::Shutdown::Write).unwrap();
    let mut rest = Vec::new();
    let _ = torn.read_to_end(&mut rest);
}

#[test]
fn a_certificate_that_cannot_be_used_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nothing.pem");
    fs::write(&path, "nothing").unwrap();
    let bench = Bench::new();
    let mut options = softplug_service::http::Options::new(bench.address(), None);
    options.certificate = Some(Certificate { chain: path.clone(), key: path.clone() });
    let error = softplug_service::http::serve(bench.gateway.clone(), &options).unwrap_err();
    assert!(error.to_string().contains("nothing.pem holds no"), "{error}");
    let plain = softplug_service::http::Options::new(bench.address(), None);
    let error = softplug_service::http::serve(bench.gateway.clone(), &plain).unwrap_err();
    assert!(error.to_string().starts_with("cannot listen at 127.0.0.1:"), "{error}");
}
