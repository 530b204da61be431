//! Who is let in, and how far.

use crate::common::bench::Bench;

/// What is asked of the API, and whether it is an admin's.
const OPERATIONS: [(&str, &str, bool); 16] = [
    ("GET", "/links", false),
    ("GET", "/links/lathe-1", false),
    ("GET", "/links/lathe-1/watch", false),
    ("GET", "/links/lathe-1/check?program=O1.nc", false),
    ("GET", "/jobs", false),
    ("GET", "/programs", false),
    ("GET", "/plugins", false),
    ("GET", "/journal", false),
    ("GET", "/events", false),
    ("GET", "/health", false),
    ("POST", "/links/lathe-1/swap", true),
    ("POST", "/links/lathe-1/quarantine", true),
    ("POST", "/plugins", true),
    ("POST", "/reload", true),
    ("DELETE", "/programs/O1.nc", true),
    ("POST", "/plugins/collect-garbage", true),
];

#[test]
fn nobody_enters_without_a_token_that_is_known() {
    let bench = Bench::new();
    let upper = bench.operator.to_uppercase();
    let half = &bench.operator[..bench.operator.len() / 2];
    let both = format!("{}{}", bench.operator, bench.admin);
    for (method, path, _) in OPERATIONS {
        for token in ["", "x", "softplug_", &upper, half, &both, "null", "*", "Bearer"] {
            bench.ask(method, path, token, b"{}").with(401);
        }
    }
    let answer =
        bench.raw(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    assert!(answer.starts_with("HTTP/1.1 401 "), "{answer}");
    assert!(answer.to_lowercase().contains("\r\nwww-authenticate: bearer"), "{answer}");
    let basic = "GET /api/v1/links HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\
                 Authorization: Basic b3BlcmF0b3I6eA==\r\n\r\n";
    assert!(bench.raw(basic.as_bytes()).starts_with("HTTP/1.1 401 "));
    let twice = format!(
        "GET /api/v1/links HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nAuthorization: x\r\n\
         Authorization: Bearer {}\r\n\r\n",
        bench.operator
    );
    assert!(bench.raw(twice.as_bytes()).starts_with("HTTP/1.1 401 "));
}

#[test]
fn a_viewer_sees_all_and_changes_nothing() {
    let bench = Bench::new();
    bench.upload("O1.nc", b"G0 X1\n").with(201);
    assert_eq!(bench.ask("GET", "/me", &bench.viewer, b"").with(200).json()["role"], "viewer");
    for path in [
        "/links",
        "/links/lathe-1/history",
        "/links/lathe-1/check?program=O1.nc",
        "/jobs",
        "/programs/O1.nc",
        "/journal",
    ] {
        bench.ask("GET", path, &bench.viewer, b"").with(200);
    }
    for (method, path) in [
        ("POST", "/links/lathe-1/jobs"),
        ("POST", "/links/lathe-1/feed"),
        ("POST", "/links/lathe-1/reopen"),
        ("POST", "/links/lathe-1/force-resume"),
        ("POST", "/links/lathe-1/release"),
        ("POST", "/links/lathe-1/swap"),
        ("POST", "/jobs/1/abort"),
        ("POST", "/jobs/1/acknowledge"),
        ("PUT", "/jobs/1/priority"),
        ("PUT", "/programs/O2.nc"),
        ("DELETE", "/programs/O1.nc"),
        ("POST", "/reload"),
    ] {
        bench.ask(method, path, &bench.viewer, b"{\"program\": \"O1.nc\"}").with(403);
    }
    assert_eq!(bench.get("/jobs").with(200).json(), serde_json::json!([]));
    assert_eq!(bench.get("/programs").with(200).json().as_array().map(Vec::len), Some(1));
}

#[test]
fn an_operator_does_not_do_what_is_an_admins() {
    let bench = Bench::new();
    for (method, path, is_admins) in OPERATIONS {
        if is_admins {
            bench.ask(method, path, &bench.operator, b"{}").with(403);
            let answer = bench.ask(method, path, &bench.admin, b"{}");
            assert_ne!(answer.status, 403, "{method} {path}");
            assert_ne!(answer.status, 401, "{method} {path}");
        }
    }
    assert_eq!(bench.get("/me").with(200).json()["role"], "operator");
    let me = bench.ask("GET", "/me", &bench.admin, b"");
    assert_eq!(me.with(200).json()["role"], "admin");
}

#[test]
fn what_is_public_is_public_and_says_little() {
    let bench = Bench::new();
    assert_eq!(bench.plain("/healthz").with(200).body, b"healthy\n");
    let ready = bench.plain("/readyz");
    assert!([200, 503].contains(&ready.status), "{ready:?}");
    let document = bench.plain("/api/v1/openapi.json").with(200).json();
    assert!(document["paths"]["/api/v1/links"].is_object());
    let page = bench.plain("/").with(200);
    assert_eq!(page.kind, "text/html; charset=utf-8");
    let text = String::from_utf8(page.body).unwrap();
    for file in ["/page/style.css", "/page/app.js", "/page/icon.svg"] {
        assert!(text.contains(file), "{file}");
        bench.plain(file).with(200);
    }
    assert!(!text.contains("http://") && !text.contains("https://"), "nothing from elsewhere");
    let head =
        bench.raw(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").to_lowercase();
    assert!(
        head.contains("content-security-policy: default-src 'none'; script-src 'self'"),
        "{head}"
    );
    assert!(head.contains("x-content-type-options: nosniff"), "{head}");
    for path in ["/nothing", "/api", "/api/v1", "/api/v2/links", "/page/", "/page/mod.rs"] {
        bench.plain(path).with(404);
    }
}

#[test]
fn who_asks_too_often_is_told_to_wait() {
    let bench = Bench::with(|options| {
        options.limits.burst = 5;
        options.limits.requests_per_second = 1;
    });
    let answers: Vec<_> = (0..50).map(|_| bench.get("/jobs").status).collect();
    assert_eq!(answers[0], 200);
    let refused = answers.iter().filter(|status| **status == 429).count();
    // Slow machines may get one more a second.
    assert!(refused > 25, "{answers:?}");
    assert!(answers.iter().all(|status| [200, 429].contains(status)), "{answers:?}");
}
