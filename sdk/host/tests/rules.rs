//! The specification's rules on budget and faults, one test each, by name.

use crate::common::{CAPACITY, Guest, HOST, OUTPUT, WORDS, echo};
use softplug_abi::limits::{EXPORTS, FUEL_PER_EVENT, MODULE_BYTES, MODULE_WEIGHT, PARAMETERS};
use softplug_abi::{Event, EventKind, Instance, LineErrorKind, MailboxError, Micros};
use softplug_host::{LintError, LoadError, Misbehaviour, SessionFault, lint};

const NOW: Micros = Micros(7);
const BYTE: Event<'static> = Event::Received(b"N");
const DAMAGED: Event<'static> =
    Event::LineError { kind: LineErrorKind::Framing, byte: None, span: 0 };

#[test]
fn budget_fuel() {
    // Computes for as many rounds as it has bytes of input, times 10,000.
    let guest = Guest::stepping(
        "(local i32) (local.set 3 (i32.mul (local.get 1) (i32.const 10000)))
        (loop (br_if 0 (local.tee 3 (i32.sub (local.get 3) (i32.const 1))))) (i32.const 0)",
    );
    let mut session = guest.session();
    // The budget is each call's own: what one leaves or uses is nothing to the next.
    for _ in 0..30 {
        session.step(&Event::Received(&[0; 10]), NOW).unwrap();
        assert!(session.fuel_used() > FUEL_PER_EVENT / 3);
    }
    session.step(&BYTE, NOW).unwrap();
    assert!(session.fuel_used() < FUEL_PER_EVENT / 10);
    let fault = session.step(&Event::Received(&[0; 100]), NOW).unwrap_err();
    let event = EventKind::Received;
    assert_eq!(fault, SessionFault::BudgetExhausted { event, fuel: FUEL_PER_EVENT });

    // `continue` has a budget of its own too.
    let guest = Guest::stepping(
        "(if (i32.eq (local.get 0) (i32.const 24)) (then (loop (br 0)))) (i32.const 0x40000000)",
    );
    let mut session = guest.session();
    assert!(session.step(&BYTE, NOW).unwrap().more);
    let fault = session.step(&Event::Continue, NOW).unwrap_err();
    let event = EventKind::Continue;
    assert_eq!(fault, SessionFault::BudgetExhausted { event, fuel: FUEL_PER_EVENT });
}

#[test]
fn budget_module_size() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("large.wasm");
    // A terabyte with nothing in it: reading it would not end.
    std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    match HOST.load(&path).unwrap_err() {
        LoadError::TooLarge { bytes, .. } => assert_eq!(bytes, 1 << 40),
        other => panic!("{other}"),
    }
    std::fs::File::create(&path).unwrap().set_len(MODULE_BYTES as u64 + 1).unwrap();
    assert!(matches!(HOST.load(&path), Err(LoadError::TooLarge { .. })));
}

#[test]
fn fault_poisoned() {
    // Traps on its first event and would answer each later one.
    let guest = Guest::stepping(
        "(if (i32.eqz (i32.load (i32.const 0)))
            (then (i32.store (i32.const 0) (i32.const 1)) unreachable))
        (i32.const 0)",
    );
    let mut session = guest.session();
    let first = session.step(&BYTE, NOW).unwrap_err();
    assert!(matches!(first, SessionFault::Trapped { event: EventKind::Received, .. }));
    let fuel = session.total_fuel();
    for event in [BYTE, Event::Close, Event::Save, Event::Continue] {
        assert_eq!(session.step(&event, Micros(8)).unwrap_err(), first);
    }
    assert_eq!(session.save(NOW).unwrap_err(), first);
    assert_eq!(session.fault(), Some(&first));
    assert_eq!(session.total_fuel(), fuel, "the guest ran again");
}

#[test]
fn fault_last_words() {
    let mut session = HOST.load_bytes(&echo()).unwrap().instantiate().unwrap();
    let fault = session.step(&DAMAGED, NOW).unwrap_err();
    assert_eq!(session.last_words(), Some("no breaks, please"));
    assert_eq!(
        fault.to_string(),
        "the plug-in trapped on event line-error: wasm `unreachable` instruction executed; \
         it says: no breaks, please"
    );
    session.step(&BYTE, NOW).unwrap_err();
    assert_eq!(session.last_words(), Some("no breaks, please"));

    // A length that lies is cut to the region of 256 bytes.
    let lying = Guest::stepping(&format!(
        "(i32.store (i32.const {WORDS}) (i32.const -1))
        (i32.store8 (i32.const {}) (i32.const 0x41)) unreachable",
        WORDS + 4
    ));
    let mut session = lying.session();
    session.step(&BYTE, NOW).unwrap_err();
    let words = session.last_words().unwrap();
    assert_eq!(words.chars().count(), 252);
    assert!(words.starts_with('A') && !words.contains(char::is_control));
}

#[test]
fn fault_alone() {
    let plugin = HOST.load_bytes(&echo()).unwrap();
    let mut neighbour = plugin.instantiate().unwrap();
    let mut faulty = plugin.instantiate().unwrap();
    faulty.step(&DAMAGED, NOW).unwrap_err();
    assert_eq!(neighbour.step(&BYTE, NOW).unwrap().actions, b"\x01\0\x05\0\0\0\0\0N");
    let mut next = plugin.instantiate().unwrap();
    assert_eq!(next.step(&BYTE, NOW).unwrap().actions, b"\x01\0\x05\0\0\0\0\0N");
    drop(faulty);
    assert_eq!(neighbour.step(&BYTE, NOW).unwrap().actions, b"\x01\0\x05\0\0\0\0\0N");
}

#[test]
fn fault_region_checked() {
    // At load: the regions, against the memory.
    let mut descriptor = Guest::default().descriptor;
    descriptor[2] = 0x1_0000 - CAPACITY + 1;
    let outside = Guest { descriptor, ..Guest::default() };
    assert!(matches!(
        outside.start(),
        Err(LoadError::Mailbox(MailboxError::OutOfMemory("output")))
    ));
    // The same region one byte lower reaches to the memory's very end.
    descriptor[2] -= 1;
    let inside = Guest { descriptor, step: format!("(i32.const {CAPACITY})"), ..Guest::default() };
    let mut session = inside.session();
    assert_eq!(session.step(&BYTE, NOW).unwrap().actions.len(), CAPACITY as usize);

    // At each step: the result, against the output region.
    let mut session = Guest::stepping(&format!("(i32.const {OUTPUT})")).session();
    assert_eq!(
        session.step(&BYTE, NOW).unwrap_err(),
        SessionFault::Malformed {
            event: EventKind::Received,
            reason: Misbehaviour::Length { length: OUTPUT, capacity: CAPACITY }
        }
    );
}

#[test]
fn budget_declared() {
    // One type with as many parameters as a file may have, and an export for every three bytes:
    // read into a list of texts, it would be thousands of times its size.
    let extra = |exports: usize| {
        let exports: Vec<_> = (0..exports).map(|nth| format!("(export \"{nth}\")")).collect();
        let exports = exports.concat();
        format!("(func {exports} (param {}))", "i64 ".repeat(1_000))
    };
    let fault = Guest::default().extra(&extra(20_000)).start().unwrap_err();
    let LoadError::Lint(LintError::TooMany { what, count, most }) = fault else {
        panic!("{fault}")
    };
    assert_eq!((what, count, most), ("parameters of a function", 1_000, PARAMETERS));
    let exports: Vec<_> = (0..20_000).map(|nth| format!("(export \"{nth}\")")).collect();
    let exports = exports.concat();
    let fault = Guest::default().extra(&format!("(func {exports})")).start().unwrap_err();
    let LoadError::Lint(LintError::TooMany { what, count, most }) = fault else {
        panic!("{fault}")
    };
    assert_eq!((what, count, most), ("exports", 20_003, EXPORTS));
}

#[test]
fn budget_weight() {
    // 100 loops within each other, and 1,000 locals that each of them carries.
    let body = |times: usize| {
        let copy = "(local.set 1 (local.get 0))".repeat(times);
        let (loops, ends) = ("loop ".repeat(100), "(br_if 0 (local.get 0)) end ".repeat(100));
        format!("(func (local {}) {loops} {copy} {ends})", "i32 ".repeat(1_000))
    };
    assert!(Guest::default().extra(&body(1)).start().is_ok());
    let heavy = Guest::default().extra(&body(1).repeat(20));
    let weight = lint(&Guest::default().extra(&body(1)).wasm()).unwrap().weight;
    assert!(weight < MODULE_WEIGHT && weight * 20 > MODULE_WEIGHT, "{weight}");
    assert!(matches!(heavy.start(), Err(LoadError::Lint(LintError::HeavyModule))));

    let table = "(block (br_table 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 (local.get 0)))".repeat(300);
    let heavy = Guest::default().extra(&format!("(func (param i32) {table})"));
    let fault = heavy.start().unwrap_err();
    assert!(matches!(fault, LoadError::Lint(LintError::HeavyFunction { .. })), "{fault}");
}
