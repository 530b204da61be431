//! Each rule of the lint, broken by one module.

use crate::common::{Guest, MANIFEST, echo, wat};
use softplug_abi::limits::{
    ELEMENTS, EXPORTS, FUNCTIONS, GLOBALS, LOCALS, MANIFEST_BYTES, MODULE_BYTES, NESTING,
    PARAMETERS, SEGMENTS, TYPES,
};
use softplug_abi::manifest::ManifestError;
use softplug_host::{Digest, LintError, MemoryMaximum, SIGNATURE_MAILBOX, SIGNATURE_STEP, lint};

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

/// A guest that says how much memory it uses; its data ends at 40, behind the descriptor.
fn using(bytes: u32) -> Guest {
    let (version, key) =
        ("\"abi\": \"1.0\"", format!("\"abi\": \"1.1\", \"memory_bytes\": {bytes}"));
    Guest { manifests: vec![MANIFEST.replace(version, &key)], ..Guest::default() }
}

#[test]
fn memory_that_is_used() {
    for bytes in [40, 4_096, 65_536] {
        let inspection = lint(&using(bytes).wasm()).unwrap();
        assert_eq!(inspection.manifest.memory_bytes, Some(bytes));
    }
    let declared = 65_536;
    let more = LintError::MoreThanDeclared { bytes: 65_537, declared };
    assert_eq!(refused(&using(65_537)), more);
    let above = LintError::DataAbove { bytes: 39, end: 40 };
    assert_eq!(refused(&using(39)), above);
    let above = LintError::DataAbove { bytes: 4_096, end: 4_097 };
    assert_eq!(refused(&using(4_096).extra("(data (i32.const 4096) \"x\")")), above);
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

/// `extra` beside a guest's own, so often that one more is too many: `most` minus its own.
fn at_the_bound(what: &'static str, most: u64, own: u64, extra: impl Fn(u64) -> String) {
    let fitting = with_extra(&extra(most - own)).wasm();
    assert!(lint(&fitting).is_ok(), "{what}: {}", lint(&fitting).unwrap_err());
    assert_eq!(
        refused(&with_extra(&extra(most - own + 1))),
        LintError::TooMany { what, count: most + 1, most }
    );
}

#[test]
fn more_than_may_be_declared() {
    let times = |text: &str, count: u64| text.repeat(count as usize);
    at_the_bound("types", TYPES, 2, |count| times("(type (func))", count));
    at_the_bound("parameters of a function", PARAMETERS, 0, |count| {
        format!("(type (func (param {})))", times("i64 ", count))
    });
    at_the_bound("functions", FUNCTIONS, 2, |count| times("(func (type 0) (i32.const 0))", count));
    at_the_bound("globals", GLOBALS, 0, |count| times("(global i32 (i32.const 0))", count));
    at_the_bound("exports", EXPORTS, 3, |count| {
        let exports: Vec<_> = (0..count).map(|nth| format!("(export \"{nth}\")")).collect();
        let exports = exports.concat();
        format!("(global {exports} i32 (i32.const 0))")
    });
    at_the_bound("table elements", ELEMENTS, 0, |count| format!("(table {count} {count} funcref)"));
    at_the_bound("table elements", ELEMENTS, 0, |count| {
        // In two segments: they count together.
        let one = format!("(elem (i32.const 0) {})", times("0 ", count / 2));
        let rest = format!("(elem (i32.const 0) {})", times("0 ", count - count / 2));
        format!("(table 8 8 funcref) {one} {rest}")
    });
    at_the_bound("element segments", SEGMENTS, 0, |count| {
        format!("(table 8 8 funcref) {}", times("(elem (i32.const 0))", count))
    });
    at_the_bound("data segments", SEGMENTS, 1, |count| times("(data (i32.const 0) \"\")", count));
    at_the_bound("parameters and locals of a function", LOCALS, 3, |count| {
        format!("(func (param i32 i64 f32) (local {}))", times("i64 ", count))
    });
    at_the_bound("blocks within blocks", NESTING, 0, |count| {
        format!("(func {} {})", times("block ", count), times("end ", count))
    });
}

#[test]
fn a_function_that_takes_too_much_compiling() {
    let function = |loops: usize| with_extra(&format!("(func {})", "(loop) ".repeat(loops)));
    // 300 for the function, 4 for each loop and its end, 2 for the last end, and of
    // twice the loops the square by 32.
    let loops =
        (1..10_000).find(|loops| 302 + 4 * loops + (2 * loops) * (2 * loops) / 32 > 500_000);
    let loops = loops.unwrap();
    assert!(lint(&function(loops - 1).wasm()).is_ok());
    let error = refused(&function(loops));
    assert!(matches!(error, LintError::HeavyFunction { function: 0, .. }), "{error}");

    let four = format!("(func {}) ", "(loop) ".repeat(loops - 1)).repeat(4);
    assert_eq!(refused(&with_extra(&four)), LintError::HeavyModule, "four of half a million");
}

#[test]
fn the_weight_is_what_the_specification_says() {
    let empty = lint(&Guest::default().wasm()).unwrap().weight;
    let of = |body: &str| lint(&with_extra(body).wasm()).unwrap().weight - empty - 302;
    assert_eq!(of("(func)"), 0);
    assert_eq!(of("(func (param i32) (local i64 i64))"), 6);
    assert_eq!(of("(func (drop (f32.sqrt (f32.const 1))))"), 2 + 50 + 1 + 2);
    assert_eq!(of("(func (drop (i32.div_u (i32.const 1) (i32.const 1))))"), 2 + 2 + 20 + 2 + 2);
    assert_eq!(of("(func (drop (i32.ctz (i32.const 1))))"), 10);
    assert_eq!(of("(func (i32.store (i32.const 1) (i32.const 1)))"), 8);
    // Three locals (6) and a value on the stack, before a loop that counts twice; its end.
    assert_eq!(of("(func (local i32 i32 i32) i32.const 1 loop end drop)"), 6 + 2 + 2 + 2 + 2 + 4);
    // A block, and six of the table with one value and one block alive; together the square of seven by 32.
    let table = "(func (block (br_table 0 0 0 0 0 0 (i32.const 1))))";
    assert_eq!(of(table), 2 + 2 + (2 + 6 * 2 / 2) + 2 + 7 * 7 / 32);
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
