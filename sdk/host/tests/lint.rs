//! Each rule of the lint, broken by one module.

mod common;

use common::{Guest, MANIFEST, echo, wat};
use softplug_abi::limits::{MANIFEST_BYTES, MODULE_BYTES};
use softplug_abi::manifest::ManifestError;
use softplug_host::{
    Digest, ELEMENTS, GLOBALS, LOCALS, LintError, MemoryMaximum, SIGNATURE_MAILBOX, SIGNATURE_STEP,
    lint,
};

fn refused(guest: &Guest) -> LintError {
    lint(&guest.wasm()).unwrap_err()
}

fn with_extra(extra: &str) -> Guest {
    Guest::default().extra(extra)
}

fn with_memory(memory: &str) -> Guest {
    Guest { memory: memory.to_owned(), ..Guest::default() }
}

#[test]
fn an_inspection_tells_what_the_module_is() {
    let wasm = echo();
    let inspection = lint(&wasm).unwrap();
    assert_eq!(inspection.manifest.name, "echo");
    assert_eq!(inspection.digest, Digest::of(&wasm));
    assert_eq!(inspection.size, wasm.len());
    assert_eq!(inspection.memory_pages, 1);
    assert_eq!(inspection.imports, 0);
    assert_eq!(inspection.exports, ["memory", "__heap_base", "softplug_v1", "softplug_v1_step"]);
}

#[test]
fn what_is_no_wasm() {
    for bytes in [&b""[..], b"MZ", b"\x7fELF\0\0\0\0", b"%\nO1000\nG0 X1\n%"] {
        assert_eq!(lint(bytes).unwrap_err(), LintError::NotWasm);
    }
}

#[test]
fn a_component_is_no_module() {
    assert!(matches!(
        lint(b"\0asm\x0d\0\x01\0").unwrap_err(),
        LintError::ForbiddenFeature { .. } | LintError::Invalid { .. }
    ));
}

#[test]
fn a_module_cut_anywhere() {
    let wasm = echo();
    let mut whole_without_names = 0;
    for length in 0..wasm.len() {
        match lint(&wasm[..length]) {
            Err(LintError::NotWasm) => assert!(length < 4),
            Err(LintError::Truncated { at }) => assert_eq!(at, length),
            // Cut between two sections: valid, but something is missing.
            Err(
                LintError::MemoryMissing
                | LintError::MissingExport(_)
                | LintError::ManifestMissing
                | LintError::Invalid { .. },
            ) => {}
            Err(other) => panic!("cut at {length}: {other}"),
            // Without the names of functions, which come last, it is a plug-in.
            Ok(_) => whole_without_names += 1,
        }
    }
    assert_eq!(whole_without_names, 1);
}

#[test]
fn a_damaged_module_names_the_place() {
    let mut wasm = echo();
    // Length of the first section: it now swallows the rest.
    wasm[9] = 0xff;
    assert!(matches!(
        lint(&wasm).unwrap_err(),
        LintError::Invalid { .. } | LintError::Truncated { .. }
    ));

    let ill_typed = Guest::stepping("(i64.const 0)").wasm();
    let error = lint(&ill_typed).unwrap_err();
    let LintError::Invalid { at, message } = &error else { panic!("{error}") };
    assert!(*at > 8 && message.contains("type mismatch"), "{error}");
}

#[test]
fn a_file_over_the_limit() {
    let padding = "x".repeat(MODULE_BYTES);
    let guest = with_extra(&format!("(@custom \"padding\" \"{padding}\")"));
    let bytes = guest.wasm().len();
    assert_eq!(refused(&guest), LintError::TooLarge { bytes });
}

#[test]
fn imports_are_named() {
    let wasm = wat("(module (import \"env\" \"log\" (func (param i32)))
                 (import \"wasi_snapshot_preview1\" \"fd_write\" (func))
                 (memory (export \"memory\") 1 1))");
    assert_eq!(
        lint(&wasm).unwrap_err(),
        LintError::Imports {
            count: 2,
            names: "env.log, wasi_snapshot_preview1.fd_write".to_owned()
        }
    );
    for kind in ["(memory 1 1)", "(table 1 funcref)", "(global i32)", "(func)"] {
        let wasm = wat(&format!("(module (import \"a\" \"b\" {kind}))"));
        assert!(matches!(lint(&wasm), Err(LintError::Imports { count: 1, .. })), "{kind}");
    }
}

#[test]
fn very_many_imports_make_a_short_message() {
    let imports = "(import \"module\" \"name\" (func))".repeat(1_000);
    let text = lint(&wat(&format!("(module {imports})"))).unwrap_err().to_string();
    assert!(text.contains("1000 in all") && text.len() < 300, "{text}");
}

#[test]
fn exports_that_are_missing() {
    let functions = "(func (export \"softplug_v1\") (result i32) (i32.const 0))";
    for (module, missing) in [
        ("(memory 1 1)".to_owned(), "memory"),
        ("(memory (export \"memory\") 1 1)".to_owned(), "softplug_v1"),
        (format!("(memory (export \"memory\") 1 1) {functions}"), "softplug_v1_step"),
    ] {
        let wasm = wat(&format!("(module {module})"));
        assert_eq!(lint(&wasm).unwrap_err(), LintError::MissingExport(missing));
    }
}

#[test]
fn exports_of_another_kind() {
    let wasm = wat("(module (memory 1 1) (func (export \"memory\")))");
    assert_eq!(
        lint(&wasm).unwrap_err(),
        LintError::WrongKind { name: "memory", expected: "a memory", found: "function" }
    );
    let wasm = wat(
        "(module (memory (export \"memory\") 1 1) (global (export \"softplug_v1\") i32 (i32.const 0)))",
    );
    assert_eq!(
        lint(&wasm).unwrap_err(),
        LintError::WrongKind {
            name: "softplug_v1",
            expected: "a function",
            found: "immutable global"
        }
    );
}

#[test]
fn signatures_that_are_wrong() {
    let module = |mailbox: &str, step: &str| {
        wat(&format!(
            "(module (memory (export \"memory\") 1 1)
                (func (export \"softplug_v1\") {mailbox} unreachable)
                (func (export \"softplug_v1_step\") {step} unreachable))"
        ))
    };
    let right = "(param i32 i32 i64) (result i32)";
    for (mailbox, found) in
        [("(result i64)", "() -> i64"), ("", "()"), ("(param f32) (result i32)", "(f32) -> i32")]
    {
        assert_eq!(
            lint(&module(mailbox, right)).unwrap_err(),
            LintError::WrongSignature {
                name: "softplug_v1",
                expected: SIGNATURE_MAILBOX,
                found: found.to_owned()
            }
        );
    }
    for (step, found) in [
        ("(param i32 i32) (result i32)", "(i32, i32) -> i32"),
        ("(param i32 i32 i64)", "(i32, i32, i64)"),
        ("(param i32 i32 f64) (result i32)", "(i32, i32, f64) -> i32"),
    ] {
        assert_eq!(
            lint(&module("(result i32)", step)).unwrap_err(),
            LintError::WrongSignature {
                name: "softplug_v1_step",
                expected: SIGNATURE_STEP,
                found: found.to_owned()
            }
        );
    }
}

#[test]
fn further_exports() {
    for (extra, kind) in [
        ("(func (export \"more\"))", "function"),
        ("(table (export \"more\") 1 1 funcref)", "table"),
        ("(global (export \"more\") (mut i32) (i32.const 0))", "mutable global"),
        ("(export \"more\" (memory 0))", "memory"),
    ] {
        let expected = LintError::UnexpectedExport { name: "more".to_owned(), kind };
        assert_eq!(refused(&with_extra(extra)), expected);
    }
    let ignored = with_extra("(global (export \"__data_end\") i32 (i32.const 4))");
    assert!(lint(&ignored.wasm()).is_ok());
}

#[test]
fn memories() {
    let grows = |min, max| LintError::MemoryGrows { min, max: MemoryMaximum(max) };
    for (memory, error) in [
        ("(memory (export \"memory\") 1)", grows(1, None)),
        ("(memory (export \"memory\") 1 2)", grows(1, Some(2))),
        ("(memory (export \"memory\") 0 65536)", grows(0, Some(65_536))),
        ("(memory (export \"memory\") 5 5)", LintError::TooManyPages { pages: 5 }),
        ("(memory (export \"memory\") 65536 65536)", LintError::TooManyPages { pages: 65_536 }),
        ("(memory (export \"memory\") 0 0)", LintError::EmptyMemory),
        ("(memory (export \"memory\") i64 1 1)", LintError::Memory64),
        ("(memory (export \"memory\") 1 1 shared)", LintError::SharedMemory),
    ] {
        assert_eq!(refused(&with_memory(memory)), error, "{memory}");
    }
    assert_eq!(lint(&wat("(module)")).unwrap_err(), LintError::MemoryMissing);
    let largest = with_memory("(memory (export \"memory\") 4 4)");
    assert_eq!(lint(&largest.wasm()).unwrap().memory_pages, 4);
}

#[test]
fn a_start_function() {
    for body in ["unreachable", "(loop (br 0))", ""] {
        let guest = with_extra(&format!("(func $start {body}) (start $start)"));
        assert_eq!(refused(&guest), LintError::StartFunction);
    }
}

#[test]
fn features_past_version_1() {
    for (step, feature) in [
        ("(i32.extend8_s (local.get 0))", "sign extension"),
        ("(i32.trunc_sat_f32_s (f32.const 1))", "saturating"),
        ("(memory.fill (i32.const 0) (i32.const 0) (i32.const 1)) (i32.const 0)", "bulk memory"),
        ("(i32x4.extract_lane 0 (v128.const i32x4 0 0 0 0))", "SIMD"),
        ("(return_call 0)", "tail calls"),
        ("(drop (ref.null func)) (i32.const 0)", "reference types"),
        ("(i32.atomic.load (i32.const 0))", "threads"),
    ] {
        let error = refused(&Guest::stepping(step));
        // `return_call 0` is of the mailbox, whose result fits.
        assert!(matches!(error, LintError::ForbiddenFeature { .. }), "{feature}: {error}");
    }
    for extra in [
        "(memory 1 1)",
        "(func (result i32 i32) unreachable)",
        "(table 1 externref)",
        "(tag)",
        "(type (struct))",
        "(table 1 funcref) (table 1 funcref)",
        "(data \"passive\")",
        "(func) (elem func 0)",
        "(global i32 (i32.add (i32.const 1) (i32.const 2)))",
    ] {
        let error = refused(&with_extra(extra));
        assert!(matches!(error, LintError::ForbiddenFeature { .. }), "{extra}: {error}");
    }
}

#[test]
fn floats_and_mutable_globals_are_part_of_it() {
    let guest =
        Guest::stepping("(global.set 0 (f64.sqrt (f64.const 2))) (i32.trunc_f64_s (global.get 0))")
            .extra("(global (mut f64) (f64.const 0))");
    assert!(lint(&guest.wasm()).is_ok());
}

#[test]
fn more_than_an_instance_should_hold() {
    let too_many = |what, count, most| LintError::TooMany { what, count, most };
    let table = |elements: u64| with_extra(&format!("(table {elements} {elements} funcref)"));
    assert!(lint(&table(ELEMENTS).wasm()).is_ok());
    assert_eq!(refused(&table(ELEMENTS + 1)), too_many("table elements", ELEMENTS + 1, ELEMENTS));
    assert_eq!(
        refused(&with_extra("(table 10000000 funcref)")),
        too_many("table elements", 10_000_000, ELEMENTS)
    );
    let segments = "(elem (i32.const 0) 0 0 0 0 0 0 0 0)".repeat(200);
    assert_eq!(
        refused(&with_extra(&format!("(table 8 8 funcref) {segments}"))),
        too_many("table elements", 1_600, ELEMENTS)
    );
    let globals = "(global i32 (i32.const 0))".repeat(GLOBALS as usize + 1);
    assert_eq!(refused(&with_extra(&globals)), too_many("globals", GLOBALS + 1, GLOBALS));
}

#[test]
fn locals_that_take_few_bytes_and_much_compiling() {
    // A run of locals is a count and a type, whatever the count.
    let locals = format!("(func (local {}))", "i64 ".repeat(40_000));
    let error = refused(&with_extra(&locals.repeat(7)));
    assert!(
        matches!(error, LintError::TooMany { what: "parameters and locals", count, most: LOCALS } if count > 280_000),
        "{error}"
    );
}

#[test]
fn manifests() {
    let with = |manifests: &[&str]| Guest {
        manifests: manifests.iter().map(ToString::to_string).collect(),
        ..Guest::default()
    };
    assert_eq!(refused(&with(&[])), LintError::ManifestMissing);
    assert_eq!(refused(&with(&[MANIFEST, MANIFEST])), LintError::ManifestTwice);
    assert!(matches!(refused(&with(&["{"])), LintError::Manifest(ManifestError::Json(_))));
    assert!(matches!(refused(&with(&["\u{fffd}"])), LintError::Manifest(ManifestError::Json(_))));
    let newer = MANIFEST.replace("\"1.0\"", "\"2.0\"");
    assert_eq!(
        refused(&with(&[&newer])),
        LintError::Manifest(ManifestError::Version("2.0".to_owned()))
    );
    let large = format!("{MANIFEST}{}", " ".repeat(MANIFEST_BYTES));
    assert_eq!(
        refused(&with(&[&large])),
        LintError::Manifest(ManifestError::TooLarge(large.len()))
    );
    let deep = "[".repeat(MANIFEST_BYTES - 1);
    assert!(matches!(refused(&with(&[&deep])), LintError::Manifest(ManifestError::Json(_))));
}

#[test]
fn messages_keep_control_characters_to_themselves() {
    let wasm = wat("(module (import \"\\1b[2J\" \"\\07\" (func)))");
    let text = lint(&wasm).unwrap_err().to_string();
    assert!(!text.contains(char::is_control), "{text:?}");
}
