//! Modules that keep the lint's rules and do harm when they run: under every engine.

use crate::common;
use crate::common::{CAPACITY, ENGINES, Guest, HOST, HOSTS, INPUT, OUTPUT, WORDS, echo, host};
use softplug_abi::limits::{FUEL_PER_EVENT, OUTPUT_ROUNDS};
use softplug_abi::{Actions, Event, EventKind, Instance, MailboxError, Micros, Refusal};
use softplug_host::{HostOptions, LoadError, Misbehaviour, SessionFault};

const NOW: Micros = Micros(7);
const BYTE: Event<'static> = Event::Received(b"N");

/// The fault, which is the same under every engine; only the names of functions
/// come from the first alone.
fn fault_of(guest: &Guest) -> SessionFault {
    let faults: Vec<_> = guest
        .sessions()
        .map(|mut session| {
            let fault = session.step(&BYTE, NOW).unwrap_err();
            assert!(fault.is_final(), "{fault}");
            assert_eq!(session.fault(), Some(&fault));
            fault
        })
        .collect();
    for fault in &faults {
        assert_eq!(fault.to_string(), faults[0].to_string());
    }
    faults[0].clone()
}

fn trap_of(guest: &Guest) -> String {
    match fault_of(guest) {
        SessionFault::Trapped { event: EventKind::Received, reason, .. } => reason,
        other => panic!("{other}"),
    }
}

fn malformed(reason: Misbehaviour) -> SessionFault {
    SessionFault::Malformed { event: EventKind::Received, reason }
}

#[test]
fn an_endless_loop_uses_up_its_budget() {
    let guest = Guest::stepping("(loop (br 0)) unreachable");
    for mut session in guest.sessions() {
        let fault = session.step(&BYTE, NOW).unwrap_err();
        let expected =
            SessionFault::BudgetExhausted { event: EventKind::Received, fuel: FUEL_PER_EVENT };
        assert_eq!(fault, expected);
        assert_eq!(session.fuel_used(), FUEL_PER_EVENT);
        assert_eq!(session.last_words(), None);
    }
}

#[test]
fn endless_calls_end_too() {
    let guest = Guest::stepping("(loop (drop (call 0)) (br 0)) unreachable")
        .extra("(func (result i32) (i32.const 1))");
    assert!(matches!(fault_of(&guest), SessionFault::BudgetExhausted { .. }));
}

#[test]
fn deep_recursion_is_a_trap() {
    let guest = Guest::stepping("(call 0 (local.get 0))")
        .extra("(func (param i32) (result i32) (i32.add (call 0 (local.get 0)) (i32.const 1)))");
    assert_eq!(trap_of(&guest), "call stack exhausted");
}

#[test]
fn a_frame_larger_than_the_stack_is_refused() {
    let locals = "i64 ".repeat(40_000);
    let guest =
        Guest::stepping("(call 0) (i32.const 0)").extra(&format!("(func (local {locals}))"));
    for host in &*HOSTS {
        let refused = host.load_bytes(&guest.wasm()).unwrap_err();
        assert!(matches!(refused, LoadError::Lint(_)), "{refused}");
    }
}

#[test]
fn memory_cannot_grow() {
    // Answers whether memory.grow gave anything but -1.
    let guest = Guest::stepping("(i32.ne (memory.grow (i32.const 1)) (i32.const -1))");
    let by_much = Guest::stepping("(i32.ne (memory.grow (i32.const 65535)) (i32.const -1))");
    for mut session in guest.sessions().chain(by_much.sessions()) {
        assert!(session.step(&BYTE, NOW).unwrap().actions.is_empty());
    }
    let for_ever = Guest::stepping("(loop (drop (memory.grow (i32.const 1))) (br 0)) unreachable");
    assert!(matches!(fault_of(&for_ever), SessionFault::BudgetExhausted { .. }));
}

#[test]
fn traps_say_what_they_are() {
    for (step, reason) in [
        ("unreachable", "wasm `unreachable` instruction executed"),
        ("(i32.load (i32.const 65533))", "out of bounds memory access"),
        ("(i32.load offset=4294967295 (i32.const -1))", "out of bounds memory access"),
        ("(i32.store (i32.const -1) (i32.const 1)) (i32.const 0)", "out of bounds memory access"),
        ("(i32.div_u (i32.const 1) (i32.const 0))", "integer divide by zero"),
        ("(i32.div_s (i32.const 0x80000000) (i32.const -1))", "integer overflow"),
        ("(i32.trunc_f32_s (f32.const nan))", "invalid conversion to integer"),
    ] {
        assert_eq!(trap_of(&Guest::stepping(step)), reason, "{step}");
    }
    let table = "(table 2 2 funcref) (elem (i32.const 0) 0)";
    for (index, reason) in [
        (0, "indirect call type mismatch"),
        (1, "uninitialized element"),
        (2, "undefined element: out of bounds table access"),
    ] {
        let guest = Guest::stepping(&format!(
            "(call_indirect (result i64) (i32.const {index})) drop (i32.const 0)"
        ))
        .extra(table);
        assert_eq!(trap_of(&guest), reason);
    }
}

#[test]
fn a_trap_names_the_functions() {
    let guest = Guest::stepping("(call $inner) (i32.const 0)")
        .extra("(func $inner (call $innermost)) (func $innermost unreachable)");
    let SessionFault::Trapped { frames, .. } = fault_of(&guest) else { panic!("no trap") };
    assert_eq!(frames[..2], ["innermost", "inner"]);
    assert_eq!(frames.len(), 3);
}

#[test]
fn lengths_that_lie() {
    for (result, length) in [
        (CAPACITY as i32 + 1, CAPACITY + 1),
        (0x3fff_ffff, 0x3fff_ffff),
        (i32::MAX, 0x3fff_ffff),
        (0x4000_0000 | (CAPACITY as i32 + 1), CAPACITY + 1),
    ] {
        let guest = Guest::stepping(&format!("(i32.const {result})"));
        let expected = malformed(Misbehaviour::Length { length, capacity: CAPACITY });
        assert_eq!(fault_of(&guest), expected);
    }
    let guest = Guest::stepping(&format!("(i32.const {})", 0x4000_0000 | CAPACITY));
    for mut session in guest.sessions() {
        let output = session.step(&BYTE, NOW).unwrap();
        assert!(output.more);
        assert_eq!(output.actions.len(), CAPACITY as usize);
    }
}

#[test]
fn negative_results() {
    for result in [-5, -6, -1_000, -65_537, i32::MIN, i32::MIN + 1] {
        let guest = Guest::stepping(&format!("(i32.const {result})"));
        assert_eq!(fault_of(&guest), malformed(Misbehaviour::UnknownResult(result)));
    }
    for refusal in [Refusal::MalformedEvent, Refusal::UnknownEvent] {
        let guest = Guest::stepping(&format!("(i32.const -{})", refusal.code()));
        for mut session in guest.sessions() {
            let fault = session.step(&BYTE, NOW).unwrap_err();
            assert_eq!(fault.refusal(), Some(refusal));
            assert!(!fault.is_final());
            assert_eq!(session.fault(), None);
        }
    }
    for refusal in [Refusal::Settings, Refusal::State] {
        let guest = Guest::stepping(&format!("(i32.const -{})", refusal.code()));
        assert_eq!(fault_of(&guest), malformed(Misbehaviour::Refusal(refusal)));
    }
}

#[test]
fn a_refusal_comes_with_its_words_and_ends_nothing() {
    // Refuses with the words "no", but only the first time it says why.
    let guest = Guest::stepping(&format!(
        "(if (i32.eqz (i32.load (i32.const 0))) (then
            (i32.store (i32.const 0) (i32.const 1))
            (i32.store (i32.const {WORDS}) (i32.const 2))
            (i32.store16 (i32.const {}) (i32.const 0x6f6e))))
        (i32.const -2)",
        WORDS + 4
    ));
    let refused = |words| SessionFault::Refused {
        event: EventKind::Received,
        refusal: Refusal::UnknownEvent,
        words,
    };
    for mut session in guest.sessions() {
        assert_eq!(session.step(&BYTE, NOW).unwrap_err(), refused(Some("no".to_owned())));
        assert_eq!(session.step(&BYTE, NOW).unwrap_err(), refused(None));
    }
}

#[test]
fn last_words_come_with_a_trap() {
    let guest = Guest::stepping(&format!(
        "(i32.store (i32.const {WORDS}) (i32.const 3))
        (i32.store (i32.const {}) (i32.const 0x00656962))
        unreachable",
        WORDS + 4
    ));
    for mut session in guest.sessions() {
        let fault = session.step(&BYTE, NOW).unwrap_err();
        assert!(matches!(fault, SessionFault::Trapped { .. }), "{fault}");
        assert_eq!(session.last_words(), Some("bie"));
    }
}

#[test]
fn actions_come_raw_and_the_decoder_refuses_what_is_wrong() {
    let guest = Guest::stepping(&format!(
        "(i32.store (i32.const {OUTPUT}) (i32.const 0x0009ffff)) (i32.const 4)"
    ));
    let mut session = guest.session();
    let output = session.step(&BYTE, NOW).unwrap();
    assert_eq!(output.actions, [0xff, 0xff, 9, 0]);
    assert!(Actions::new(output.actions).next().unwrap().is_err());
}

#[test]
fn output_without_end() {
    let guest = Guest::stepping("(i32.const 0x40000000)");
    for mut session in guest.sessions() {
        assert!(session.step(&BYTE, NOW).unwrap().more);
        for _ in 0..OUTPUT_ROUNDS {
            assert!(session.step(&Event::Continue, NOW).unwrap().more);
        }
        let fault = session.step(&Event::Continue, NOW).unwrap_err();
        let reason = Misbehaviour::TooManyRounds;
        assert_eq!(fault, SessionFault::Malformed { event: EventKind::Continue, reason });
    }

    // Another event begins a new count.
    let mut session = guest.session();
    for _ in 0..3 {
        session.step(&BYTE, NOW).unwrap();
        for _ in 0..OUTPUT_ROUNDS {
            session.step(&Event::Continue, NOW).unwrap();
        }
    }
}

#[test]
fn an_event_that_does_not_fit_reaches_nobody() {
    let mut session = Guest::stepping("unreachable").session();
    let long = vec![0; CAPACITY as usize + 1];
    assert_eq!(
        session.step(&Event::Received(&long), NOW).unwrap_err(),
        SessionFault::EventTooLarge { event: EventKind::Received, capacity: CAPACITY as usize }
    );
    assert_eq!(session.fault(), None);
    assert_eq!(session.input_capacity(), CAPACITY as usize);
}

#[test]
fn mailboxes_that_cannot_be() {
    let start = |descriptor| {
        let guest = Guest { descriptor, ..Guest::default() };
        let errors = guest.start_errors().map(|error| match error {
            LoadError::Mailbox(error) => error,
            other => panic!("{other}"),
        });
        let errors: Vec<_> = errors.collect();
        assert!(errors.iter().all(|error| *error == errors[0]), "{errors:?}");
        errors[0]
    };
    let good = Guest::default().descriptor;
    let changed = |at: usize, value| {
        let mut descriptor = good;
        descriptor[at] = value;
        start(descriptor)
    };
    assert_eq!(changed(0, 0xf001), MailboxError::OutOfMemory("input"));
    assert_eq!(changed(0, u32::MAX), MailboxError::OutOfMemory("input"));
    assert_eq!(changed(2, u32::MAX - CAPACITY), MailboxError::OutOfMemory("output"));
    assert_eq!(changed(4, 0xffff_ff01), MailboxError::OutOfMemory("last words"));
    assert_eq!(changed(1, 511), MailboxError::Size("input", 511));
    assert_eq!(changed(3, u32::MAX), MailboxError::Size("output", u32::MAX));
    assert_eq!(changed(5, 0), MailboxError::Size("last words", 0));
    assert_eq!(changed(2, INPUT + CAPACITY - 1), MailboxError::Overlap("input", "output"));
    assert_eq!(changed(4, INPUT), MailboxError::Overlap("input", "last words"));
    assert_eq!(changed(4, OUTPUT), MailboxError::Overlap("output", "last words"));
}

#[test]
fn descriptors_outside_the_memory() {
    for address in [0xffe9_u32, 0xffff, 0x1_0000, 0x7fff_ffff, 0xffff_ffff, 0xffff_ffe8] {
        let mailbox = format!("(i32.const {address})");
        let guest = Guest { mailbox, ..Guest::default() };
        for error in guest.start_errors() {
            match error {
                LoadError::Descriptor { address: found } => assert_eq!(found, address),
                other => panic!("{other}"),
            }
        }
    }
    // The last place at which it fits: all zero there.
    let guest = Guest { mailbox: "(i32.const 0xffe8)".to_owned(), ..Guest::default() };
    assert!(matches!(
        guest.start().unwrap_err(),
        LoadError::Mailbox(MailboxError::Size("input", 0))
    ));
}

#[test]
fn a_mailbox_function_that_does_not_return() {
    let guest = |mailbox: &str| Guest { mailbox: mailbox.to_owned(), ..Guest::default() };
    for error in guest("(loop (br 0)) unreachable").start_errors() {
        assert!(matches!(error, LoadError::BudgetExhausted { fuel: FUEL_PER_EVENT }), "{error}");
    }
    for error in guest("unreachable").start_errors() {
        assert!(matches!(error, LoadError::Trapped { .. }), "{error}");
    }
}

/// Only the interpreter of units gives no more memory than that: the others have all that is declared.
#[cfg(feature = "interpreter")]
#[test]
fn memory_above_what_the_manifest_says() {
    let key = "\"abi\": \"1.1\", \"memory_bytes\": 16384";
    let manifest = common::MANIFEST.replace("\"abi\": \"1.0\"", key);
    // Touches the byte whose address is what it received.
    let step = format!("(i32.store8 (i32.load (i32.const {INPUT})) (i32.const 1)) (i32.const 0)");
    let guest = Guest { manifests: vec![manifest], ..Guest::stepping(&step) };
    let touch = |host: &softplug_host::Host, address: u32| {
        let mut session = host.load_bytes(&guest.wasm()).unwrap().instantiate().unwrap();
        session.step(&Event::Received(&address.to_le_bytes()), NOW).map(drop)
    };
    let engine = softplug_host::EngineKind::Interpreter;
    let unit = host(HostOptions { engine, ..HostOptions::default() });
    assert_eq!(touch(&unit, 16_383), Ok(()));
    let fault = touch(&unit, 16_384).unwrap_err();
    assert!(fault.to_string().contains("out of bounds memory access"), "{fault}");
    assert_eq!(touch(&HOST, 16_384), Ok(()));
}

#[test]
fn segments_that_do_not_fit() {
    for extra in [
        "(data (i32.const 65535) \"ab\")",
        "(data (i32.const -1) \"ab\")",
        "(table 1 1 funcref) (elem (i32.const 1) 0)",
    ] {
        for error in Guest::default().extra(extra).start_errors() {
            assert!(matches!(error, LoadError::Instantiate { .. }), "{extra}: {error}");
        }
    }
}

#[test]
fn data_that_fills_all_of_a_large_memory() {
    // 200 KiB of data: image and instance stay within the declared memory.
    let data = "\\aa".repeat(200 * 1024);
    let guest = Guest {
        memory: "(memory (export \"memory\") 4 4)".to_owned(),
        step: "(i32.ne (i32.load8_u (i32.const 0x10000)) (i32.const 0xaa))".to_owned(),
        ..Guest::default()
    }
    .extra(&format!("(data (i32.const 0x4000) \"{data}\")"));
    for mut session in guest.sessions() {
        assert!(session.step(&BYTE, NOW).unwrap().actions.is_empty());
    }
}

#[test]
fn more_instances_than_the_host_was_made_for() {
    let host = host(HostOptions { instances: 3, ..HostOptions::default() });
    let plugin = host.load_bytes(&echo()).unwrap();
    let running: Vec<_> = (0..3).map(|_| plugin.instantiate().unwrap()).collect();
    assert!(matches!(plugin.instantiate(), Err(LoadError::TooManyInstances { limit: 3 })));
    drop(running);
    assert!(plugin.instantiate().is_ok());
}

#[test]
fn the_budget_can_be_set() {
    for &engine in ENGINES {
        let host = host(HostOptions { engine, fuel_per_event: 50, ..HostOptions::default() });
        let mut session = host.load_bytes(&echo()).unwrap().instantiate().unwrap();
        assert_eq!(
            session.step(&Event::Received(&[0; 1_000]), NOW).unwrap_err(),
            SessionFault::BudgetExhausted { event: EventKind::Received, fuel: 50 }
        );
    }
}

#[test]
fn fuel_is_counted() {
    for host in &*HOSTS {
        let mut session = host.load_bytes(&echo()).unwrap().instantiate().unwrap();
        session.step(&Event::Received(&[0; 100]), NOW).unwrap();
        let large = session.fuel_used();
        session.step(&BYTE, NOW).unwrap();
        let small = session.fuel_used();
        assert!(small > 0 && small < large, "{small} {large}");
        assert_eq!(session.largest_fuel(), large);
        assert_eq!(session.total_fuel(), large + small);
    }
}

#[test]
fn everything_can_go_to_another_thread() {
    fn is_send_and_sync<T: Send + Sync + Clone>(_: &T) {}
    fn is_send<T: Send>(_: &T) {}
    is_send_and_sync(&*HOST);
    let plugin = HOST.load_bytes(&echo()).unwrap();
    is_send_and_sync(&plugin);
    let mut session = plugin.instantiate().unwrap();
    is_send(&session);
    let length = std::thread::spawn(move || session.step(&BYTE, NOW).unwrap().actions.len());
    assert_eq!(length.join().unwrap(), 9);
}
