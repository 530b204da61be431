//! The manifest: every error, how settings are resolved, hostile JSON.
#![cfg(feature = "manifest")]

use proptest::prelude::*;
use serde_json::{Value as Json, json};
use softplug_abi::manifest::{Manifest, ManifestError, Need, OwnedValue, SettingError};
use softplug_abi::{Event, Values, limits};

fn minimal() -> Json {
    json!({
        "abi": "1.0", "name": "x", "version": "1.0.0", "licence": "MIT",
        "protocol": "none", "description": "A test."
    })
}

/// The least manifest with these further or other entries.
fn with(entries: &Json) -> Json {
    let mut manifest = minimal();
    for (key, value) in entries.as_object().expect("entries are an object") {
        manifest[key] = value.clone();
    }
    manifest
}

fn parse(json: &Json) -> Result<Manifest, ManifestError> {
    Manifest::parse(json.to_string().as_bytes())
}

fn setting(entries: &Json) -> Json {
    let mut setting = json!({"name": "s", "type": "int", "default": 1, "text": "A setting."});
    for (key, value) in entries.as_object().expect("entries are an object") {
        setting[key] = value.clone();
    }
    setting
}

fn with_setting(entries: &Json) -> Result<Manifest, ManifestError> {
    parse(&with(&json!({"settings": [setting(entries)]})))
}

fn every_type() -> Manifest {
    parse(&with(&json!({
        "settings": [
            {"name": "on", "type": "bool", "default": false, "text": "."},
            {"name": "xon", "type": "int", "default": 17, "min": 0, "max": 255, "text": "."},
            {"name": "wait", "type": "int", "default": 5, "min": 1, "unit": "ms", "text": "."},
            {"name": "greeting", "type": "text", "default": "HI", "min": 1, "max": 4, "text": "."},
            {"name": "start", "type": "bytes", "default": "25 0A", "max": 3, "text": "."},
            {"name": "end", "type": "choice", "default": "lf", "choices": ["lf", "cr-lf"], "text": "."}
        ],
        "presets": [
            {"name": "slow", "text": ".", "values": {"wait": 900, "end": "cr-lf", "on": true}},
            {"name": "quick", "text": ".", "values": {"wait": 2}}
        ]
    })))
    .expect("the manifest is good")
}

fn resolve(asked: &[(&str, &str)]) -> Result<Vec<OwnedValue>, SettingError> {
    let values = every_type().resolve_settings(asked.iter().copied())?;
    Ok(values.as_slice().to_vec())
}

fn defaults() -> Vec<OwnedValue> {
    vec![
        OwnedValue::Bool(false),
        OwnedValue::Int(17),
        OwnedValue::Int(5),
        OwnedValue::Text("HI".to_string()),
        OwnedValue::Bytes(vec![0x25, 0x0a]),
        OwnedValue::Choice(0),
    ]
}

fn rule_broken(json: &Json) -> (String, &'static str) {
    match parse(json) {
        Err(ManifestError::Entry { entry, rule }) => (entry, rule),
        other => panic!("not a broken rule: {other:?}"),
    }
}

#[test]
fn the_least_manifest_has_nothing_else() {
    let manifest = parse(&minimal()).expect("the manifest is good");
    assert!(manifest.settings.is_empty() && manifest.jobs.is_empty());
    assert_eq!(manifest.needs.line_errors, Need::No);
    assert!(!manifest.needs.check_pass);
    assert_eq!(manifest.state.saves, None);
}

#[test]
fn a_manifest_survives_writing_and_reading() {
    let manifest = every_type();
    let json = serde_json::to_vec(&manifest).expect("a manifest can be written");
    assert_eq!(Manifest::parse(&json), Ok(manifest));
}

#[test]
fn a_manifest_that_is_too_large_is_refused_unread() {
    let json = vec![b'{'; limits::MANIFEST_BYTES + 1];
    assert_eq!(Manifest::parse(&json), Err(ManifestError::TooLarge(limits::MANIFEST_BYTES + 1)));
    let mut json = minimal().to_string().into_bytes();
    json.resize(limits::MANIFEST_BYTES, b' ');
    assert!(Manifest::parse(&json).is_ok());
}

#[test]
fn every_required_key_is_required() {
    for key in ["abi", "name", "version", "licence", "protocol", "description"] {
        let mut json = minimal();
        json.as_object_mut().expect("it is an object").remove(key);
        let Err(ManifestError::Json(message)) = parse(&json) else { panic!("{key} was missing") };
        assert!(message.contains(key), "{message}");
    }
}

#[test]
fn unknown_keys_are_refused_at_every_level() {
    let cases = [
        json!({"extra": 1}),
        json!({"settings": [{"name": "s", "type": "int", "default": 1, "text": ".", "extra": 1}]}),
        json!({"presets": [{"name": "p", "text": ".", "values": {}, "extra": 1}]}),
        json!({"jobs": [{"name": "j", "text": ".", "extra": 1}]}),
        json!({"jobs": [{"name": "j", "text": ".", "fields": [
            {"name": "f", "type": "int", "text": ".", "extra": 1}]}]}),
        json!({"requests": [{"name": "j", "text": ".", "extra": 1}]}),
        json!({"profiles": [{"name": "p", "extra": 1}]}),
        json!({"status": [{"code": 1, "name": "E", "text": ".", "extra": 1}]}),
        json!({"needs": {"extra": 1}}),
        json!({"state": {"extra": 1}}),
    ];
    for case in cases {
        let Err(ManifestError::Json(message)) = parse(&with(&case)) else { panic!("{case}") };
        assert!(message.contains("unknown field `extra`"), "{message}");
    }
}

/// A manifest of ABI 1.1 with these entries, besides a setting and a preset.
fn with_line(entries: &Json) -> Result<Manifest, ManifestError> {
    let mut manifest = with(&json!({
        "abi": "1.1",
        "settings": [setting(&json!({})), setting(&json!({"name": "t", "type": "bool", "default": false}))],
        "presets": [{"name": "slow", "text": ".", "values": {"s": 2}}],
    }));
    for (key, value) in entries.as_object().expect("entries are an object") {
        manifest[key] = value.clone();
    }
    parse(&manifest)
}

#[test]
fn the_line_is_that_of_the_first_case_that_holds() {
    let manifest = with_line(&json!({
        "line": "4800 7E2",
        "line_when": [
            {"when": {"preset": "slow"}, "line": "300 7E2"},
            {"when": {"s": 3, "t": true}, "line": "8N2"},
            {"when": {"s": 3}, "line": "8N1"},
        ]
    }))
    .unwrap();
    let line = |asked: &[(&str, &str)]| {
        let values = manifest.resolve_settings(asked.iter().copied()).unwrap();
        manifest.line_for(asked.iter().copied(), &values).unwrap().to_string()
    };
    assert_eq!(line(&[]), "4800 7E2");
    assert_eq!(line(&[("preset", "slow")]), "300 7E2");
    assert_eq!(line(&[("s", "2")]), "4800 7E2", "the preset is meant, not what it sets");
    assert_eq!(line(&[("s", "3")]), "8N1");
    assert_eq!(line(&[("t", "on"), ("s", "0x3")]), "8N2");
    // Written out and read again it is the same; without a line the keys are left out.
    let text = serde_json::to_string(&manifest).unwrap();
    assert_eq!(Manifest::parse(text.as_bytes()), Ok(manifest));
    let without = with_line(&json!({})).unwrap();
    assert!(!serde_json::to_string(&without).unwrap().contains("line_when"));
    let values = without.resolve_settings([]).unwrap();
    assert_eq!(without.line_for([], &values), None);
}

#[test]
fn memory_that_is_used_is_a_number_of_the_new_version() {
    let manifest = with_line(&json!({"memory_bytes": 20_000})).unwrap();
    assert_eq!(manifest.memory_bytes, Some(20_000));
    let text = serde_json::to_string(&manifest).unwrap();
    assert_eq!(Manifest::parse(text.as_bytes()), Ok(manifest));
    let without = with_line(&json!({})).unwrap();
    assert_eq!(without.memory_bytes, None);
    assert!(!serde_json::to_string(&without).unwrap().contains("memory_bytes"));
    assert!(with_line(&json!({"memory_bytes": 262_144})).is_ok());
    for (entries, message) in [
        (
            json!({"abi": "1.0", "memory_bytes": 20_000}),
            "memory_bytes: it came with ABI 1.1: write that as `abi`",
        ),
        (json!({"memory_bytes": 0}), "memory_bytes: it is 1 to 262144"),
        (json!({"memory_bytes": 262_145}), "memory_bytes: it is 1 to 262144"),
    ] {
        let error = with_line(&entries).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    assert!(with_line(&json!({"memory_bytes": -1})).is_err());
}

#[test]
fn a_line_that_says_nothing_is_refused() {
    let cases = [
        (json!({"abi": "1.0", "line": "7E2"}), "line: it came with ABI 1.1: write that as `abi`"),
        (json!({"abi": "1.00", "line": "7E2"}), "line: it came with ABI 1.1: write that as `abi`"),
        (
            json!({"line_when": [{"when": {"s": 1}, "line": "7E2"}]}),
            "line_when: it needs a `line`, for all other settings",
        ),
        (
            json!({"line": "7E2", "line_when": [{"when": {}, "line": "8N1"}]}),
            "line_when[0]: `when` names no setting",
        ),
        (
            json!({"line": "7E2", "line_when": [{"when": {"x": 1}, "line": "8N1"}]}),
            "line_when[0]: there is no such setting",
        ),
        (
            json!({"line": "7E2", "line_when": [{"when": {"preset": "x"}, "line": "8N1"}]}),
            "line_when[0]: there is no such preset",
        ),
        (
            json!({"line": "7E2", "line_when": [{"when": {"s": "a"}, "line": "8N1"}]}),
            "line_when[0].s: setting \"s\": \"\"a\"\" is not a whole number",
        ),
    ];
    for (entries, message) in cases {
        assert_eq!(with_line(&entries).unwrap_err().to_string(), message, "{entries}");
    }
    for line in [
        "",
        "4800",
        "7e2",
        "9N1",
        "8N3",
        "8N1 ",
        " 8N1",
        "049 8N1",
        "49 8N1",
        "+50 8N1",
        "16000001 8N1",
        "9600  8N1",
    ] {
        let error = with_line(&json!({"line": line})).unwrap_err().to_string();
        assert!(error.contains("is not a line; write it as"), "{line}: {error}");
    }
    for line in ["5N1.5", "50 8M1", "16000000 8S2"] {
        let manifest = with_line(&json!({"line": line})).unwrap();
        assert_eq!(manifest.line.unwrap().to_string(), line);
    }
}

#[test]
fn versions() {
    let too_new = format!("{}.{}", softplug_abi::VERSION.0, softplug_abi::VERSION.1 + 1);
    for abi in
        ["2.0", "0.9", &too_new, "1", "", "1.", ".0", "1.0.0", "one", "+1.0", "1.+0", "1.99999"]
    {
        let error = parse(&with(&json!({"abi": abi})));
        assert_eq!(error, Err(ManifestError::Version(abi.to_string())), "{abi}");
    }
    let error = ManifestError::Version("2.0".to_string());
    assert_eq!(error.to_string(), "the plug-in speaks ABI 2.0, this host serves 1.0 to 1.1");
}

#[test]
fn names() {
    let longest = "a".repeat(40);
    for name in ["x", "xon-xoff", "r3964", &longest] {
        assert!(parse(&with(&json!({"name": name}))).is_ok(), "{name}");
    }
    let too_long = "a".repeat(41);
    for name in ["", "X", "a_b", "a b", "é", "a/b", "..", &too_long] {
        let (entry, rule) = rule_broken(&with(&json!({"name": name})));
        assert!(entry == "name" && rule.starts_with("a name is"), "{name}: {rule}");
    }
}

#[test]
fn entries_that_break_a_rule_are_named() {
    let two = |entry: Json| json!([entry.clone(), entry]);
    let job = json!({"name": "send", "text": "."});
    let field = json!({"name": "f", "type": "int", "text": "."});
    let preset = json!({"name": "p", "text": ".", "values": {}});
    let many_fields: Vec<_> = (0..=limits::FIELDS)
        .map(|at| json!({"name": format!("f{at}"), "type": "int", "text": "."}))
        .collect();
    let many_settings: Vec<_> =
        (0..=limits::SETTINGS).map(|at| setting(&json!({"name": format!("s{at}")}))).collect();
    let one = |entries| json!({"settings": [setting(&entries)]});
    let cases = [
        (json!({"settings": many_settings}), "settings", "more settings than"),
        (one(json!({"name": "a-b"})), "settings[0]", "a name is"),
        (one(json!({"name": "preset"})), "settings[0]", "\"preset\" is the host's"),
        (json!({"settings": two(setting(&json!({})))}), "settings[1]", "the name stands twice"),
        (one(json!({"type": "choice", "default": "a"})), "settings[0]", "choices belong to"),
        (one(json!({"choices": ["a"]})), "settings[0]", "choices belong to"),
        (
            one(json!({"type": "choice", "default": "a", "choices": ["a", "a"]})),
            "settings[0]",
            "a choice stands twice",
        ),
        (one(json!({"min": 2, "max": 1})), "settings[0]", "min is over max"),
        (one(json!({"type": "text", "default": "", "max": 401})), "settings[0]", "max is over"),
        (one(json!({"type": "bytes", "default": "", "max": 401})), "settings[0]", "max is over"),
        (one(json!({"type": "bytes", "default": "", "max": -1})), "settings[0]", "max is over"),
        (json!({"presets": [{"name": "P", "text": ".", "values": {}}]}), "presets[0]", "a name is"),
        (json!({"presets": two(preset)}), "presets[1]", "the name stands twice"),
        (
            json!({"presets": [{"name": "p", "text": ".", "values": {"no": 1}}]}),
            "presets[0]",
            "it sets what is no setting",
        ),
        (json!({"jobs": [{"name": "", "text": "."}]}), "jobs[0]", "a name is"),
        (json!({"jobs": two(job.clone())}), "jobs[1]", "the name stands twice"),
        (json!({"requests": two(job)}), "requests[1]", "the name stands twice"),
        (
            json!({"jobs": [{"name": "j", "text": ".", "fields": many_fields}]}),
            "jobs[0]",
            "more fields than",
        ),
        (
            json!({"requests": [{"name": "j", "text": ".", "fields": two(field)}]}),
            "requests[0]",
            "the name of a field stands twice",
        ),
        (
            json!({"jobs": [{"name": "j", "text": ".", "fields": [
                {"name": "a-b", "type": "int", "text": "."}]}]}),
            "jobs[0]",
            "a name is",
        ),
    ];
    for (entries, path, start) in cases {
        let (entry, rule) = rule_broken(&with(&entries));
        assert_eq!(entry, path, "{entries}");
        assert!(rule.starts_with(start), "{entries}: {rule}");
    }
}

#[test]
fn as_many_entries_as_allowed() {
    let settings: Vec<_> =
        (0..limits::SETTINGS).map(|at| setting(&json!({"name": format!("s{at}")}))).collect();
    let fields: Vec<_> = (0..limits::FIELDS)
        .map(|at| json!({"name": format!("f{at}"), "type": "int", "text": "."}))
        .collect();
    let jobs = json!([{"name": "j", "text": ".", "fields": fields}, {"name": "k", "text": "."}]);
    let manifest =
        parse(&with(&json!({"settings": settings, "jobs": jobs}))).expect("the manifest is good");
    assert_eq!(manifest.job_kind("k"), Some(1));
    assert_eq!(manifest.job_kind("l"), None);
}

#[test]
fn defaults_must_fit_their_setting() {
    let cases = [
        json!({"default": "1"}),
        json!({"default": 1.5}),
        json!({"default": null}),
        json!({"default": 1, "min": 2}),
        json!({"default": 3, "max": 2}),
        json!({"type": "bool", "default": 0}),
        json!({"type": "text", "default": 1}),
        json!({"type": "text", "default": "abc", "max": 2}),
        json!({"type": "text", "default": "x".repeat(401)}),
        json!({"type": "bytes", "default": "1"}),
        json!({"type": "bytes", "default": "xx"}),
        json!({"type": "bytes", "default": "", "min": 1}),
        json!({"type": "choice", "default": "c", "choices": ["a", "b"]}),
        json!({"type": "choice", "default": 0, "choices": ["a", "b"]}),
    ];
    for case in cases {
        let error = with_setting(&case);
        let Err(ManifestError::Value { entry, .. }) = &error else { panic!("{case}: {error:?}") };
        assert_eq!(entry, "settings[0]");
    }
}

#[test]
fn presets_must_fit_their_settings() {
    let error = parse(&with(&json!({
        "settings": [setting(&json!({"max": 9}))],
        "presets": [{"name": "p", "text": ".", "values": {"s": 10}}]
    })));
    let text = error.expect_err("10 is over 9").to_string();
    assert!(text.starts_with("presets[0].s: setting \"s\": 10 is outside"), "{text}");
}

#[test]
fn settings_default() {
    assert_eq!(resolve(&[]), Ok(defaults()));
}

#[test]
fn settings_of_every_type_are_read_from_text() {
    let cases = [
        (("on", "on"), OwnedValue::Bool(true)),
        (("on", "yes"), OwnedValue::Bool(true)),
        (("on", "true"), OwnedValue::Bool(true)),
        (("on", "off"), OwnedValue::Bool(false)),
        (("on", "no"), OwnedValue::Bool(false)),
        (("on", "false"), OwnedValue::Bool(false)),
        (("xon", "0"), OwnedValue::Int(0)),
        (("xon", "255"), OwnedValue::Int(255)),
        (("xon", "0x91"), OwnedValue::Int(0x91)),
        (("wait", "9223372036854775807"), OwnedValue::Int(i64::MAX)),
        (("greeting", "a=b"), OwnedValue::Text("a=b".to_string())),
        (("start", "11 13"), OwnedValue::Bytes(vec![0x11, 0x13])),
        (("start", "fFaB"), OwnedValue::Bytes(vec![0xff, 0xab])),
        (("start", ""), OwnedValue::Bytes(Vec::new())),
        (("end", "cr-lf"), OwnedValue::Choice(1)),
    ];
    for (asked, expected) in cases {
        assert!(resolve(&[asked]).expect("the value fits").contains(&expected), "{asked:?}");
    }
}

#[test]
fn explicit_values_win_over_presets_wherever_they_stand() {
    let mut expected = defaults();
    expected[0] = OwnedValue::Bool(true);
    expected[2] = OwnedValue::Int(7);
    expected[5] = OwnedValue::Choice(1);
    assert_eq!(resolve(&[("wait", "7"), ("preset", "slow")]), Ok(expected.clone()));
    assert_eq!(resolve(&[("preset", "slow"), ("wait", "3"), ("wait", "7")]), Ok(expected));
}

#[test]
fn a_later_preset_wins_over_an_earlier_one() {
    let wait = |asked: &[_]| resolve(asked).expect("the presets exist").swap_remove(2);
    assert_eq!(wait(&[("preset", "slow"), ("preset", "quick")]), OwnedValue::Int(2));
    assert_eq!(wait(&[("preset", "quick"), ("preset", "slow")]), OwnedValue::Int(900));
}

#[test]
fn settings_errors_say_what_to_do() {
    let cases = [
        (
            ("xoff", "1"),
            "unknown setting \"xoff\"; this plug-in has: on, xon, wait, greeting, start, end",
        ),
        (("preset", "fast"), "unknown preset \"fast\"; this plug-in has: slow, quick"),
        (("on", "1"), "setting \"on\": \"1\" is not on or off"),
        (("xon", "x"), "setting \"xon\": \"x\" is not a whole number"),
        (("xon", "1.0"), "setting \"xon\": \"1.0\" is not a whole number"),
        (("xon", "0x-1"), "setting \"xon\": \"0x-1\" is not a whole number"),
        (("xon", "0x"), "setting \"xon\": \"0x\" is not a whole number"),
        (
            ("xon", "99999999999999999999"),
            "setting \"xon\": \"99999999999999999999\" is not a whole number",
        ),
        (("xon", "256"), "setting \"xon\": 256 is outside 0 to 255"),
        (("wait", "0"), "setting \"wait\": 0 is outside 1 to 9223372036854775807 ms"),
        (("greeting", ""), "setting \"greeting\": 0 is outside 1 to 4 bytes"),
        (("greeting", "HÖHE"), "setting \"greeting\": 5 is outside 1 to 4 bytes"),
        (("start", "1"), "setting \"start\": \"1\" is not hex pairs such as \"11 13\""),
        (("start", "11 13 11 13"), "setting \"start\": 4 is outside 0 to 3 bytes"),
        (("end", "cr"), "setting \"end\": \"cr\" is not one of lf, cr-lf"),
    ];
    for (asked, text) in cases {
        assert_eq!(resolve(&[asked]).expect_err("the value does not fit").to_string(), text);
    }
    let none = parse(&minimal()).expect("the manifest is good");
    let error = none.resolve_settings([("a", "1")]).expect_err("there is no setting");
    assert_eq!(error.to_string(), "unknown setting \"a\"; this plug-in has: none");
}

/// The settings events of a manifest as bytes, and the longest one's length.
fn pieces(manifest: &Manifest, capacity: usize) -> (Vec<Vec<u8>>, Vec<OwnedValue>) {
    let values = manifest.resolve_settings([]).expect("defaults fit");
    let mut given = Vec::new();
    values
        .pieces(capacity, |event| {
            let mut buffer = [0; 1_024];
            let length = event.encode(&mut buffer).expect("the buffer is large enough");
            given.push(buffer[..length].to_vec());
            Ok::<(), ()>(())
        })
        .expect("nothing stops it");
    (given, values.as_slice().to_vec())
}

#[test]
fn settings_travel_in_whole_pieces() {
    let long: Vec<_> = (0..9)
        .map(|at| {
            let text = "x".repeat(limits::VALUE_BYTES - 40 * at);
            setting(&json!({"name": format!("s{at}"), "type": "text", "default": text}))
        })
        .collect();
    let manifest = parse(&with(&json!({"settings": long}))).expect("the manifest is good");
    for capacity in [0, 1, 100, 407, 408, 500, 512, 4_096] {
        let (pieces, expected) = pieces(&manifest, capacity);
        let longest = capacity.clamp(407, 512);
        let mut values = Vec::new();
        for (at, piece) in pieces.iter().enumerate() {
            assert!(piece.len() <= longest, "{capacity}: {}", piece.len());
            let flags = u8::from(at == 0) | u8::from(at + 1 == pieces.len()) << 1;
            assert_eq!(piece[0], flags, "{capacity}: piece {at}");
            let records: Result<Vec<_>, _> = Values::new(&piece[1..]).collect();
            values.extend(records.expect("records are whole").into_iter().map(|(index, value)| {
                assert_eq!(value, expected[usize::from(index)].as_value());
                index
            }));
        }
        assert!(values.into_iter().eq(0..9), "{capacity}");
    }
}

#[test]
fn without_settings_there_is_one_empty_piece() {
    let manifest = parse(&minimal()).expect("the manifest is good");
    assert_eq!(pieces(&manifest, 512).0, [[0b11]]);
}

#[test]
fn pieces_stop_at_the_first_error() {
    let values = every_type().resolve_settings([]).expect("defaults fit");
    let mut calls = 0;
    let result = values.pieces(512, |_: &Event<'_>| {
        calls += 1;
        Err("no")
    });
    assert_eq!((result, calls), (Err("no"), 1));
}

#[test]
fn hostile_json_is_a_typed_error() {
    let nested = |open: &str, close: &str| {
        let (depth, rest) = (10_000, "1");
        format!("{{\"abi\":{}{rest}{}}}", open.repeat(depth), close.repeat(depth))
    };
    let default = |value: &str| {
        minimal().to_string().replace(
            "\"abi\"",
            &format!("\"settings\":[{{\"name\":\"s\",\"type\":\"int\",\"text\":\".\",\"default\":{value}}}],\"abi\""),
        )
    };
    let cases: Vec<Vec<u8>> = vec![
        Vec::new(),
        b"null".to_vec(),
        b"[]".to_vec(),
        b"{".to_vec(),
        b"\xff\xfe".to_vec(),
        b"{\"name\":\"\xff\"}".to_vec(),
        nested("[", "]").into_bytes(),
        nested("{\"a\":", "}").into_bytes(),
        default(&nested("[", "]")).into_bytes(),
        default("1e999").into_bytes(),
        [minimal().to_string().as_bytes(), b"{}"].concat(),
        minimal()
            .to_string()
            .replace("\"name\":\"x\"", "\"name\":\"x\",\"name\":\"y\"")
            .into_bytes(),
        with(&json!({"state": {"saves": 65_536}})).to_string().into_bytes(),
        with(&json!({"status": [{"code": -1, "name": "E", "text": "."}]})).to_string().into_bytes(),
        with(&json!({"needs": {"line_errors": "maybe"}})).to_string().into_bytes(),
    ];
    for json in cases {
        let error = Manifest::parse(&json);
        let shown = String::from_utf8_lossy(&json[..json.len().min(80)]).into_owned();
        assert!(matches!(error, Err(ManifestError::Json(_))), "{shown}: {error:?}");
    }
    for number in ["99999999999999999999", "-99999999999999999999", "1e30", "0.5", "1e-400"] {
        let error = Manifest::parse(default(number).as_bytes());
        let value =
            matches!(&error, Err(ManifestError::Value { source: SettingError::Type { .. }, .. }));
        assert!(value, "{number}: {error:?}");
    }
}

proptest! {
    #[test]
    fn any_bytes_are_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(Manifest::parse(&bytes).is_err());
    }

    /// A good manifest with one byte changed is refused or still obeys the rules.
    #[test]
    fn a_damaged_manifest_is_refused_or_usable(
        at in any::<proptest::sample::Index>(),
        byte in any::<u8>(),
    ) {
        let mut json = serde_json::to_vec(&every_type()).expect("a manifest can be written");
        let place = at.index(json.len());
        json[place] = byte;
        if let Ok(manifest) = Manifest::parse(&json) {
            prop_assert!(manifest.resolve_settings([]).is_ok());
            for preset in &manifest.presets {
                let asked = [("preset", preset.name.as_str())];
                prop_assert!(manifest.resolve_settings(asked).is_ok());
            }
        }
    }

    #[test]
    fn any_text_is_a_value_or_an_error(name in "[a-z]{0,9}", text in ".{0,40}") {
        for setting in ["on", "xon", "wait", "greeting", "start", "end", "preset", &name] {
            if let Ok(values) = every_type().resolve_settings([(setting, text.as_str())]) {
                prop_assert_eq!(values.as_slice().len(), 6);
            }
        }
    }
}
