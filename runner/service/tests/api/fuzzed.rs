//! The API fuzzed from its own document, by a tool that knows nothing else of it.

mod needs_schemathesis {
    use std::process::Command;

    use crate::common::bench::Bench;

    /// Streams never end; a feed holds its link.
    const ENDLESS: &str = "/(events|watch|feed)$";

    /// What is held against every answer: no failure of the server, nothing that the document does
    /// not say, no entry without a token.
    const CHECKS: &str = "not_a_server_error,status_code_conformance,content_type_conformance,\
        response_headers_conformance,response_schema_conformance,negative_data_rejection,\
        unsupported_method,allow_header_conformance,ignored_auth";

    #[test]
    fn no_request_out_of_the_document_brings_it_down_or_lets_anyone_in() {
        let bench = Bench::new();
        bench.until_link("lathe-1", "idle");
        let document = bench.plain("/api/v1/openapi.json").with(200).body;
        std::fs::write(bench.path("openapi.json"), document).unwrap();
        let tokens = std::fs::read(bench.path("tokens.toml")).unwrap();
        for token in [&bench.operator, &bench.admin] {
            let run = Command::new("schemathesis")
                .args(["run", "openapi.json", "--url", &bench.url(""), "--no-color"])
                .args(["--checks", CHECKS, "--exclude-path-regex", ENDLESS])
                .args(["--max-examples", "10", "--seed", "1", "--request-timeout", "60"])
                .args(["--phases", "examples,coverage,fuzzing", "--warnings", "off"])
                .args(["--header", &format!("Authorization: Bearer {token}")])
                .current_dir(bench.path(""))
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&run.stdout);
            assert!(run.status.success(), "{said}");
        }
        bench.get("/me").with(200);
        assert_eq!(std::fs::read(bench.path("tokens.toml")).unwrap(), tokens);
    }
}
