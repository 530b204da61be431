//! What the specification of WebAssembly 1.0 demands, operator by operator where it is easy to be wrong, and
//! what is refused. Random modules are held against the other engines by the host's tests.

use std::sync::Arc;

use softplug_interpreter::{Invalid, InvalidReason, Machine, Module, Room, Trap};

fn module(text: &str) -> Result<Module<Vec<u8>>, Invalid> {
    Module::load(wat::parse_str(text).unwrap_or_else(|error| panic!("{error}")))
}

/// Calls `run`, which this module exports.
fn run(text: &str, arguments: &[u64]) -> Result<Option<u64>, Trap> {
    let module = Arc::new(module(text).unwrap());
    let function = module.exported_function("run").unwrap();
    let room = Room { stack_slots: 256, call_depth: 20, ..Room::default() };
    Machine::new(module, room).unwrap().call(function, arguments, &mut 10_000)
}

/// An expression with a result of this type.
fn value(ty: &str, expression: &str) -> Result<u64, Trap> {
    let text = format!("(module (memory 1 1) (func (export \"run\") (result {ty}) {expression}))");
    run(&text, &[]).map(Option::unwrap)
}

#[test]
fn integers() {
    for (ty, expression, result) in [
        ("i32", "(i32.div_s (i32.const -7) (i32.const 2))", Ok(-3_i64)),
        ("i32", "(i32.rem_s (i32.const -7) (i32.const 2))", Ok(-1)),
        ("i32", "(i32.rem_s (i32.const 0x80000000) (i32.const -1))", Ok(0)),
        ("i32", "(i32.div_s (i32.const 0x80000000) (i32.const -1))", Err(Trap::IntegerOverflow)),
        ("i32", "(i32.div_u (i32.const 1) (i32.const 0))", Err(Trap::DivisionByZero)),
        ("i64", "(i64.div_s (i64.const 1) (i64.const 0))", Err(Trap::DivisionByZero)),
        ("i64", "(i64.rem_u (i64.const 1) (i64.const 0))", Err(Trap::DivisionByZero)),
        ("i64", "(i64.div_s (i64.const -9) (i64.const 0x100000002))", Ok(0)),
        ("i32", "(i32.shl (i32.const 1) (i32.const 33))", Ok(2)),
        ("i32", "(i32.shr_s (i32.const -8) (i32.const 1))", Ok(-4)),
        ("i32", "(i32.rotl (i32.const 0x80000001) (i32.const 1))", Ok(3)),
        ("i64", "(i64.shr_u (i64.const -1) (i64.const 63))", Ok(1)),
        ("i64", "(i64.extend_i32_s (i32.const -2))", Ok(-2)),
        ("i64", "(i64.extend_i32_u (i32.const -2))", Ok(0xFFFF_FFFE)),
        ("i32", "(i32.wrap_i64 (i64.const 0x100000007))", Ok(7)),
        ("i32", "(i32.clz (i32.const 0))", Ok(32)),
        ("i64", "(i64.ctz (i64.const 0))", Ok(64)),
    ] {
        let found = value(ty, expression)
            .map(|bits| if ty == "i32" { i64::from(bits as i32) } else { bits as i64 });
        assert_eq!(found, result, "{expression}");
    }
}

#[test]
fn floats() {
    const NAN: u64 = 0x7FC0_0000;
    let bits = |value: f32| Ok(u64::from(value.to_bits()));
    for (ty, expression, result) in [
        ("f32", "(f32.min (f32.const 0) (f32.const -0))", bits(-0.0)),
        ("f32", "(f32.max (f32.const -0) (f32.const 0))", bits(0.0)),
        ("f32", "(f32.max (f32.const 1) (f32.const nan:0x200000))", Ok(NAN)),
        ("f32", "(f32.sqrt (f32.const -1))", Ok(NAN)),
        ("f32", "(f32.nearest (f32.const 2.5))", bits(2.0)),
        ("f32", "(f32.nearest (f32.const -0.4))", bits(-0.0)),
        ("f32", "(f32.neg (f32.const nan:0x200000))", Ok(0xFFA0_0000)),
        ("i32", "(i32.trunc_f64_s (f64.const -2147483648.9))", Ok(0x8000_0000)),
        ("i32", "(i32.trunc_f64_s (f64.const -2147483649))", Err(Trap::IntegerOverflow)),
        ("i32", "(i32.trunc_f64_u (f64.const -0.9))", Ok(0)),
        ("i32", "(i32.trunc_f32_s (f32.const 2147483648))", Err(Trap::IntegerOverflow)),
        ("i32", "(i32.trunc_f32_u (f32.const nan))", Err(Trap::InvalidConversion)),
        ("i64", "(i64.trunc_f64_s (f64.const -9223372036854775808))", Ok(1 << 63)),
        ("i64", "(i64.trunc_f64_s (f64.const 9223372036854775808))", Err(Trap::IntegerOverflow)),
        ("i64", "(i64.trunc_f64_u (f64.const 18446744073709549568))", Ok(u64::MAX - 2_047)),
    ] {
        assert_eq!(value(ty, expression), result, "{expression}");
    }
}

#[test]
fn memory() {
    for (expression, result) in [
        ("(i32.load (i32.const 65532))", Ok(0)),
        ("(i32.load (i32.const 65533))", Err(Trap::MemoryOutOfBounds)),
        ("(i32.load8_u offset=65535 (i32.const 0))", Ok(0)),
        ("(i32.load8_u offset=65535 (i32.const 1))", Err(Trap::MemoryOutOfBounds)),
        ("(i32.load8_u offset=0xFFFFFFFF (i32.const 1))", Err(Trap::MemoryOutOfBounds)),
        (
            "(i32.store16 (i32.const 0) (i32.const 0x18081)) (i32.load8_s (i32.const 1))",
            Ok(0xFFFF_FF80),
        ),
        ("(i32.store (i32.const 1) (i32.const -2)) (i32.load16_s (i32.const 1))", Ok(0xFFFF_FFFE)),
        ("(memory.size)", Ok(1)),
        ("(memory.grow (i32.const 0))", Ok(1)),
        ("(memory.grow (i32.const 1))", Ok(0xFFFF_FFFF)),
    ] {
        assert_eq!(value("i32", expression), result, "{expression}");
    }
}

#[test]
fn branches_take_one_value_along_and_leave_the_rest() {
    for (expression, result) in [
        ("(block (result i32) (i32.const 1) (i32.const 2) (br 0 (i32.const 3)))", 3),
        (
            "(i32.add (i32.const 10) (block (result i32) (i32.const 9) (br_if 0 (i32.const 5) (i32.const 1)) (drop)))",
            15,
        ),
        ("(if (result i32) (i32.const 0) (then (i32.const 1)) (else (i32.const 2)))", 2),
        ("(if (result i32) (i32.const 7) (then (i32.const 1)) (else (i32.const 2)))", 1),
        ("(if (i32.const 0) (then (return (i32.const 1)))) (i32.const 2)", 2),
        (
            "(block (block (block (br_table 0 1 2 (i32.const 1))) (return (i32.const 10))) (return (i32.const 11))) (i32.const 12)",
            11,
        ),
        (
            "(block (block (block (br_table 0 1 2 (i32.const -1))) (return (i32.const 10))) (return (i32.const 11))) (i32.const 12)",
            12,
        ),
        ("(br 0 (i32.const 4)) (i32.const 5)", 4),
        ("(select (i32.const 1) (i32.const 2) (i32.const 0))", 2),
    ] {
        assert_eq!(value("i32", expression), Ok(result), "{expression}");
    }
    let sum = "(module (func (export \"run\") (param i32) (result i32) (local i32)
        (loop $again
            (local.set 1 (i32.add (local.get 1) (local.get 0)))
            (br_if $again (local.tee 0 (i32.sub (local.get 0) (i32.const 1)))))
        (local.get 1)))";
    assert_eq!(run(sum, &[10]), Ok(Some(55)));
}

#[test]
fn calls() {
    let table = "(module (type $get (func (result i32))) (table 4 4 funcref) (elem (i32.const 1) $seven $other)
        (func $seven (result i32) (i32.const 7)) (func $other (param i32))
        (func (export \"run\") (param i32) (result i32) (call_indirect (type $get) (local.get 0))))";
    assert_eq!(run(table, &[1]), Ok(Some(7)));
    assert_eq!(run(table, &[0]), Err(Trap::UninitializedElement));
    assert_eq!(run(table, &[2]), Err(Trap::IndirectCallType));
    assert_eq!(run(table, &[4]), Err(Trap::TableOutOfBounds));
    let endless = "(module (func $again (export \"run\") (call $again)))";
    assert_eq!(run(endless, &[]), Err(Trap::StackExhausted));
    // 256 slots are there: 300 locals have no room, wherever the call comes from.
    let wide = format!("(module (func (export \"run\") (local {})))", "i64 ".repeat(300));
    assert_eq!(run(&wide, &[]), Err(Trap::StackExhausted));
    assert_eq!(run("(module (func (export \"run\") unreachable))", &[]), Err(Trap::Unreachable));
}

#[test]
fn fuel_ends_what_never_ends_and_is_counted_by_operators() {
    let text = "(module (func (export \"run\") (param i32)
        (loop (br_if 0 (local.tee 0 (i32.sub (local.get 0) (i32.const 1)))))))";
    let module = Arc::new(module(text).unwrap());
    let function = module.exported_function("run").unwrap();
    let mut machine = Machine::new(module, Room::default()).unwrap();
    let mut used = |rounds: u64| {
        let mut fuel = 100_000;
        machine.call(function, &[rounds], &mut fuel).map(|_| 100_000 - fuel)
    };
    let one = used(1).unwrap();
    assert_eq!(used(1_001).unwrap() - one, 1_000 * 5);
    assert_eq!(used(0), Err(Trap::OutOfFuel));
}

/// Clearing a thousand locals takes some time each, however few bytes declare them.
#[test]
fn a_call_that_clears_many_locals_takes_fuel_for_them() {
    let used = |locals: &str| {
        let text =
            format!("(module (func $many (local {locals})) (func (export \"run\") (call $many)))");
        let module = Arc::new(module(&text).unwrap());
        let function = module.exported_function("run").unwrap();
        let mut fuel = 100_000;
        let mut machine = Machine::new(module, Room::default()).unwrap();
        machine.call(function, &[], &mut fuel).map(|_| 100_000 - fuel)
    };
    let few = used("i32").unwrap();
    assert_eq!(used(&"i64 ".repeat(1_024)).unwrap() - few, 1_024 / 8);
}

#[test]
fn what_is_not_valid_is_refused() {
    use InvalidReason as Reason;
    for (text, reason) in [
        ("(module (import \"a\" \"b\" (func)))", Reason::Imports),
        ("(module (func $f) (start $f))", Reason::StartFunction),
        ("(module (memory 2 1))", Reason::Limits),
        ("(module (func (result i32)))", Reason::Operand),
        ("(module (func (result i32) (i64.const 1)))", Reason::Operand),
        ("(module (func (i32.const 1)))", Reason::Height),
        ("(module (func (i32.add (i32.const 1) (f32.const 1)) (drop)))", Reason::Operand),
        ("(module (func (br 1)))", Reason::Index),
        ("(module (func (local.get 0) (drop)))", Reason::Index),
        ("(module (func (call 1)))", Reason::Index),
        ("(module (func (drop (i32.load (i32.const 0)))))", Reason::Index),
        ("(module (memory 1 1) (func (drop (i32.load align=8 (i32.const 0)))))", Reason::Alignment),
        (
            "(module (global i32 (i32.const 0)) (func (global.set 0 (i32.const 1))))",
            Reason::Immutable,
        ),
        ("(module (global i32 (i64.const 0)))", Reason::Constant),
        (
            "(module (func (result i32) (if (result i32) (i32.const 1) (then (i32.const 1)))))",
            Reason::Else,
        ),
        (
            "(module (func (select (i32.const 1) (i64.const 1) (i32.const 1)) (drop)))",
            Reason::Operand,
        ),
        ("(module (func (drop (i32.extend8_s (i32.const 1)))))", Reason::Operator),
        (
            "(module (memory 1 1) (func (memory.fill (i32.const 0) (i32.const 0) (i32.const 0))))",
            Reason::Operator,
        ),
        ("(module (func (result i32 i32) unreachable))", Reason::Type),
        ("(module (table 2000 2000 funcref))", Reason::TooMany),
        ("(module (memory 1 1) (memory 1 1))", Reason::TooMany),
    ] {
        assert_eq!(module(text).map(drop).map_err(|error| error.reason), Err(reason), "{text}");
    }
    // Behind a branch anything may stand, as it is never reached.
    assert!(module("(module (func (result i32) unreachable (i32.add) ))").is_ok());
    for bytes in [&b""[..], b"\0asm", b"\0asm\x02\0\0\0", b"MZ"] {
        assert_eq!(Module::load(bytes).unwrap_err().reason, Reason::NotAModule);
    }
}

#[test]
fn every_beginning_of_a_module_is_refused_without_a_panic() {
    let text = "(module (type (func (param i32) (result i32))) (table 1 1 funcref) (memory 1 1)
        (global (mut i32) (i32.const 70000)) (export \"run\" (func 0)) (elem (i32.const 0) 0)
        (func (type 0) (block (br_table 0 0 (local.get 0))) (i32.load offset=9 (i32.const -1)))
        (data (i32.const 8) \"data\"))";
    let wasm = wat::parse_str(text).unwrap();
    assert!(Module::load(&wasm[..]).is_ok());
    let loaded = (8..wasm.len()).filter(|&length| Module::load(&wasm[..length]).is_ok()).count();
    // Only what ends between two sections may be a module, and this one's are bound to each other.
    assert!(loaded <= 4, "{loaded} beginnings are modules");
    // Each byte altered in every way: loaded or not, and run if it is.
    for at in 8..wasm.len() {
        for bit in 0..8 {
            let mut altered = wasm.clone();
            altered[at] ^= 1 << bit;
            let Ok(module) = Module::load(altered) else { continue };
            let module = Arc::new(module);
            let Some(function) = module.exported_function("run") else { continue };
            if !module.has_signature(
                function,
                &[softplug_interpreter::ValueType::I32],
                Some(softplug_interpreter::ValueType::I32),
            ) {
                continue;
            }
            if let Ok(mut machine) = Machine::new(module, Room::default()) {
                let _ = machine.call(function, &[1], &mut 1_000);
            }
        }
    }
}
