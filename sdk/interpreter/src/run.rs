//! The loop that runs a module on its own bytes.

use crate::float;
use crate::opcode::*;
use crate::tables::{Body, Branch, Tables};
use crate::trap::Trap;
use alloc::vec::Vec;

/// Locals that a call clears for a unit of fuel: else a few operators would buy a long time.
const LOCALS_A_UNIT: u32 = 8;

/// What a module has while it runs.
#[derive(Debug)]
pub(crate) struct State {
    pub(crate) memory: Vec<u8>,
    pub(crate) globals: Vec<u64>,
    pub(crate) stack: Vec<u64>,
    /// Whoever called, the outermost first.
    pub(crate) callers: Vec<Caller>,
    pub(crate) call_depth: usize,
}

/// Where a call goes on when it has its answer.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Caller {
    function: u32,
    at: u32,
    branch: u32,
    frame: u32,
}

/// An unsigned number, and where it ends.
fn long_unsigned(code: &[u8], mut at: usize) -> (u32, usize) {
    let (mut value, mut shift) = (0, 0);
    loop {
        let byte = code[at];
        at += 1;
        value |= u32::from(byte & 0x7F) << shift;
        if byte < 0x80 {
            return (value, at);
        }
        shift += 7;
    }
}

/// A signed number, and where it ends.
fn long_signed(code: &[u8], mut at: usize) -> (i64, usize) {
    let (mut value, mut shift) = (0_i64, 0_u32);
    loop {
        let byte = code[at];
        at += 1;
        value |= i64::from(byte & 0x7F) << shift;
        shift += 7;
        if byte < 0x80 {
            let unused = 64_u32.saturating_sub(shift);
            return ((value << unused) >> unused, at);
        }
    }
}

fn read<const N: usize>(memory: &[u8], base: u32, offset: u32) -> Result<[u8; N], Trap> {
    let at = base.checked_add(offset).ok_or(Trap::MemoryOutOfBounds)? as usize;
    let bytes = memory.get(at..).and_then(<[u8]>::first_chunk);
    bytes.copied().ok_or(Trap::MemoryOutOfBounds)
}

fn write<const N: usize>(
    memory: &mut [u8],
    base: u32,
    offset: u32,
    bytes: [u8; N],
) -> Result<(), Trap> {
    let at = base.checked_add(offset).ok_or(Trap::MemoryOutOfBounds)? as usize;
    let place = memory.get_mut(at..).and_then(<[u8]>::first_chunk_mut);
    *place.ok_or(Trap::MemoryOutOfBounds)? = bytes;
    Ok(())
}

/// The one loop. Its variables are what a processor would have in registers: they are written back to the
/// state for calls only.
///
/// The module was validated: each operand is there and of its type, each index and each branch leads
/// somewhere. That no unsafe code relies on it keeps a mistake in the validation from becoming more than a panic.
pub(crate) fn run(
    code: &[u8],
    tables: &Tables,
    state: &mut State,
    function: u32,
    fuel_left: &mut u32,
) -> Result<(), Trap> {
    let State { memory, globals, stack, callers, call_depth } = state;
    let (memory, globals, stack) = (&mut memory[..], &mut globals[..], &mut stack[..]);
    let branches = &tables.branches[..];
    let mut fuel = *fuel_left;
    let mut function = function;
    let mut body: &Body = &tables.functions[function as usize];
    // The frame's first slot, and the first one behind the operands.
    let mut frame = 0_usize;
    let mut top = enter(stack, body, frame)?;
    let mut at = body.start as usize;
    let mut branch = body.branches as usize;

    macro_rules! unsigned {
        () => {{
            let byte = code[at];
            if byte < 0x80 {
                at += 1;
                u32::from(byte)
            } else {
                let (value, end) = long_unsigned(code, at);
                at = end;
                value
            }
        }};
    }
    macro_rules! pop {
        () => {{
            top -= 1;
            stack[top]
        }};
    }
    macro_rules! push {
        ($value:expr) => {{
            stack[top] = $value;
            top += 1;
        }};
    }
    macro_rules! two_i32 {
        (|$a:ident, $b:ident| $result:expr) => {{
            let $b = stack[top - 1] as u32;
            let $a = stack[top - 2] as u32;
            top -= 1;
            stack[top - 1] = u64::from($result);
        }};
    }
    macro_rules! two_i64 {
        (|$a:ident, $b:ident| $result:expr) => {{
            let $b = stack[top - 1];
            let $a = stack[top - 2];
            top -= 1;
            stack[top - 1] = $result;
        }};
    }
    macro_rules! one {
        (|$a:ident| $result:expr) => {{
            let $a = stack[top - 1];
            stack[top - 1] = $result;
        }};
    }
    macro_rules! skip_alignment {
        () => {{
            at += 1;
            while code[at - 1] >= 0x80 {
                at += 1;
            }
        }};
    }
    macro_rules! load {
        ($bytes:literal, |$found:ident| $result:expr) => {{
            skip_alignment!();
            let offset = unsigned!();
            match read::<$bytes>(memory, stack[top - 1] as u32, offset) {
                Ok($found) => stack[top - 1] = $result,
                Err(trap) => break Err(trap),
            }
        }};
    }
    macro_rules! store {
        (|$value:ident| $bytes:expr) => {{
            skip_alignment!();
            let offset = unsigned!();
            let $value = stack[top - 1];
            let base = stack[top - 2] as u32;
            top -= 2;
            if let Err(trap) = write(memory, base, offset, $bytes) {
                break Err(trap);
            }
        }};
    }
    macro_rules! spend {
        ($units:expr) => {
            match fuel.checked_sub($units) {
                Some(left) => fuel = left,
                None => {
                    fuel = 0;
                    break Err(Trap::OutOfFuel);
                }
            }
        };
    }
    macro_rules! jump {
        ($branch:expr) => {{
            let to: Branch = $branch;
            let bottom = frame + to.height();
            if to.keeps() {
                stack[bottom] = stack[top - 1];
                top = bottom + 1;
            } else {
                top = bottom;
            }
            at = to.target();
            branch = to.next();
        }};
    }
    macro_rules! call {
        ($callee:expr) => {{
            let callee: u32 = $callee;
            if callers.len() == *call_depth {
                break Err(Trap::StackExhausted);
            }
            let caller =
                Caller { function, at: at as u32, branch: branch as u32, frame: frame as u32 };
            function = callee;
            body = &tables.functions[function as usize];
            spend!(u32::from(body.locals) / LOCALS_A_UNIT);
            let bottom = top - usize::from(body.parameters);
            match enter(stack, body, bottom) {
                Ok(new_top) => top = new_top,
                Err(trap) => break Err(trap),
            }
            callers.push(caller);
            frame = bottom;
            at = body.start as usize;
            branch = body.branches as usize;
        }};
    }
    macro_rules! leave {
        () => {{
            if body.has_result {
                stack[frame] = stack[top - 1];
                top = frame + 1;
            } else {
                top = frame;
            }
            let Some(caller) = callers.pop() else { break Ok(()) };
            function = caller.function;
            body = &tables.functions[function as usize];
            frame = caller.frame as usize;
            at = caller.at as usize;
            branch = caller.branch as usize;
        }};
    }

    let result = loop {
        spend!(1);
        let operator = code[at];
        at += 1;
        match operator {
            LOCAL_GET => {
                let index = unsigned!() as usize;
                push!(stack[frame + index]);
            }
            LOCAL_SET => {
                let index = unsigned!() as usize;
                let value = pop!();
                stack[frame + index] = value;
            }
            LOCAL_TEE => {
                let index = unsigned!() as usize;
                stack[frame + index] = stack[top - 1];
            }
            I32_CONST => {
                let byte = code[at];
                if byte < 0x80 {
                    at += 1;
                    // Seven bits with a sign.
                    push!(u64::from((i32::from((byte << 1).cast_signed()) >> 1) as u32));
                } else {
                    let (value, end) = long_signed(code, at);
                    at = end;
                    push!(u64::from(value as u32));
                }
            }
            UNREACHABLE => break Err(Trap::Unreachable),
            NOP => {}
            BLOCK | LOOP => at += 1,
            IF => {
                if pop!() as u32 == 0 {
                    let to = branches[branch];
                    at = to.target();
                    branch = to.next();
                } else {
                    at += 1;
                    branch += 1;
                }
            }
            ELSE => {
                let to = branches[branch];
                at = to.target();
                branch = to.next();
            }
            END => {
                if at > body.end as usize {
                    leave!();
                }
            }
            BR => jump!(branches[branch]),
            BR_IF => {
                if pop!() as u32 == 0 {
                    // The depth is known; only where it ends has to be found.
                    unsigned!();
                    branch += 1;
                } else {
                    jump!(branches[branch]);
                }
            }
            BR_TABLE => {
                let (count, _) = long_unsigned(code, at);
                let chosen = (pop!() as u32).min(count);
                jump!(branches[branch + chosen as usize]);
            }
            RETURN => leave!(),
            CALL => {
                let callee = unsigned!();
                call!(callee);
            }
            CALL_INDIRECT => {
                spend!(3);
                let ty = unsigned!() as usize;
                at += 1;
                let place = pop!() as u32 as usize;
                let callee = match tables.elements.get(place) {
                    None => break Err(Trap::TableOutOfBounds),
                    Some(0) => break Err(Trap::UninitializedElement),
                    Some(&callee) => u32::from(callee) - 1,
                };
                let found = usize::from(tables.functions[callee as usize].ty);
                if tables.types[found].same_as != tables.types[ty].same_as {
                    break Err(Trap::IndirectCallType);
                }
                call!(callee);
            }
            DROP => top -= 1,
            SELECT => {
                let condition = pop!() as u32;
                let other = pop!();
                if condition == 0 {
                    stack[top - 1] = other;
                }
            }
            GLOBAL_GET => {
                let index = unsigned!() as usize;
                push!(globals[index]);
            }
            GLOBAL_SET => {
                let index = unsigned!() as usize;
                globals[index] = pop!();
            }
            I32_LOAD | F32_LOAD | I64_LOAD32_U => {
                load!(4, |bytes| u64::from(u32::from_le_bytes(bytes)));
            }
            I64_LOAD | F64_LOAD => load!(8, |bytes| u64::from_le_bytes(bytes)),
            I32_LOAD8_U | I64_LOAD8_U => load!(1, |bytes| u64::from(bytes[0])),
            I32_LOAD16_U | I64_LOAD16_U => {
                load!(2, |bytes| u64::from(u16::from_le_bytes(bytes)));
            }
            I32_LOAD8_S => load!(1, |bytes| u64::from(i32::from(bytes[0] as i8) as u32)),
            I32_LOAD16_S => {
                load!(2, |bytes| u64::from(i32::from(i16::from_le_bytes(bytes)) as u32));
            }
            I64_LOAD8_S => load!(1, |bytes| i64::from(bytes[0] as i8) as u64),
            I64_LOAD16_S => load!(2, |bytes| i64::from(i16::from_le_bytes(bytes)) as u64),
            I64_LOAD32_S => load!(4, |bytes| i64::from(i32::from_le_bytes(bytes)) as u64),
            I32_STORE | F32_STORE | I64_STORE32 => store!(|value| (value as u32).to_le_bytes()),
            I64_STORE | F64_STORE => store!(|value| value.to_le_bytes()),
            I32_STORE8 | I64_STORE8 => store!(|value| [value as u8]),
            I32_STORE16 | I64_STORE16 => store!(|value| (value as u16).to_le_bytes()),
            MEMORY_SIZE => {
                at += 1;
                push!(u64::from(tables.memory_pages));
            }
            MEMORY_GROW => {
                spend!(99);
                at += 1;
                one!(|pages| if pages as u32 == 0 {
                    u64::from(tables.memory_pages)
                } else {
                    u64::from(u32::MAX)
                });
            }
            I64_CONST => {
                let (value, end) = long_signed(code, at);
                at = end;
                push!(value as u64);
            }
            F32_CONST => {
                let bytes = code[at..].first_chunk().expect("it was validated");
                push!(u64::from(u32::from_le_bytes(*bytes)));
                at += 4;
            }
            F64_CONST => {
                let bytes = code[at..].first_chunk().expect("it was validated");
                push!(u64::from_le_bytes(*bytes));
                at += 8;
            }
            I32_EQZ => one!(|a| u64::from(a as u32 == 0)),
            I32_EQ => two_i32!(|a, b| a == b),
            I32_NE => two_i32!(|a, b| a != b),
            I32_LT_S => two_i32!(|a, b| a.cast_signed() < b.cast_signed()),
            I32_LT_U => two_i32!(|a, b| a < b),
            I32_GT_S => two_i32!(|a, b| a.cast_signed() > b.cast_signed()),
            I32_GT_U => two_i32!(|a, b| a > b),
            I32_LE_S => two_i32!(|a, b| a.cast_signed() <= b.cast_signed()),
            I32_LE_U => two_i32!(|a, b| a <= b),
            I32_GE_S => two_i32!(|a, b| a.cast_signed() >= b.cast_signed()),
            I32_GE_U => two_i32!(|a, b| a >= b),
            I64_EQZ => one!(|a| u64::from(a == 0)),
            I64_EQ => two_i64!(|a, b| u64::from(a == b)),
            I64_NE => two_i64!(|a, b| u64::from(a != b)),
            I64_LT_S => two_i64!(|a, b| u64::from(a.cast_signed() < b.cast_signed())),
            I64_LT_U => two_i64!(|a, b| u64::from(a < b)),
            I64_GT_S => two_i64!(|a, b| u64::from(a.cast_signed() > b.cast_signed())),
            I64_GT_U => two_i64!(|a, b| u64::from(a > b)),
            I64_LE_S => two_i64!(|a, b| u64::from(a.cast_signed() <= b.cast_signed())),
            I64_LE_U => two_i64!(|a, b| u64::from(a <= b)),
            I64_GE_S => two_i64!(|a, b| u64::from(a.cast_signed() >= b.cast_signed())),
            I64_GE_U => two_i64!(|a, b| u64::from(a >= b)),
            I32_CLZ => one!(|a| u64::from((a as u32).leading_zeros())),
            I32_CTZ => one!(|a| u64::from((a as u32).trailing_zeros())),
            I32_POPCNT => one!(|a| u64::from((a as u32).count_ones())),
            I32_ADD => two_i32!(|a, b| a.wrapping_add(b)),
            I32_SUB => two_i32!(|a, b| a.wrapping_sub(b)),
            I32_MUL => two_i32!(|a, b| a.wrapping_mul(b)),
            I32_AND => two_i32!(|a, b| a & b),
            I32_OR => two_i32!(|a, b| a | b),
            I32_XOR => two_i32!(|a, b| a ^ b),
            I32_SHL => two_i32!(|a, b| a.wrapping_shl(b)),
            I32_SHR_S => two_i32!(|a, b| a.cast_signed().wrapping_shr(b).cast_unsigned()),
            I32_SHR_U => two_i32!(|a, b| a.wrapping_shr(b)),
            I32_ROTL => two_i32!(|a, b| a.rotate_left(b & 31)),
            I32_ROTR => two_i32!(|a, b| a.rotate_right(b & 31)),
            I64_CLZ => one!(|a| u64::from(a.leading_zeros())),
            I64_CTZ => one!(|a| u64::from(a.trailing_zeros())),
            I64_POPCNT => one!(|a| u64::from(a.count_ones())),
            I64_ADD => two_i64!(|a, b| a.wrapping_add(b)),
            I64_SUB => two_i64!(|a, b| a.wrapping_sub(b)),
            I64_MUL => two_i64!(|a, b| a.wrapping_mul(b)),
            I64_AND => two_i64!(|a, b| a & b),
            I64_OR => two_i64!(|a, b| a | b),
            I64_XOR => two_i64!(|a, b| a ^ b),
            I64_SHL => two_i64!(|a, b| a.wrapping_shl(b as u32)),
            I64_SHR_S => two_i64!(|a, b| a.cast_signed().wrapping_shr(b as u32).cast_unsigned()),
            I64_SHR_U => two_i64!(|a, b| a.wrapping_shr(b as u32)),
            I64_ROTL => two_i64!(|a, b| a.rotate_left(b as u32 & 63)),
            I64_ROTR => two_i64!(|a, b| a.rotate_right(b as u32 & 63)),
            I32_DIV_S..=I32_REM_U | I64_DIV_S..=I64_REM_U => {
                spend!(7);
                let right = pop!();
                match divide(operator, stack[top - 1], right) {
                    Ok(value) => stack[top - 1] = value,
                    Err(trap) => break Err(trap),
                }
            }
            I32_WRAP_I64 | I64_EXTEND_I32_U => one!(|a| u64::from(a as u32)),
            I64_EXTEND_I32_S => one!(|a| i64::from(a as i32) as u64),
            F32_DIV | F64_DIV | F32_SQRT | F64_SQRT => {
                spend!(7);
                if operator == F32_DIV || operator == F64_DIV {
                    two_i64!(|a, b| float::two(operator, a, b));
                } else {
                    match float::one(operator, stack[top - 1]) {
                        Ok(value) => stack[top - 1] = value,
                        Err(trap) => break Err(trap),
                    }
                }
            }
            _ if float::takes_two(operator) => two_i64!(|a, b| float::two(operator, a, b)),
            _ => match float::one(operator, stack[top - 1]) {
                Ok(value) => stack[top - 1] = value,
                Err(trap) => break Err(trap),
            },
        }
    };
    *fuel_left = fuel;
    result
}

/// Makes room for a call whose parameters are at the frame's bottom: where its operands begin.
fn enter(stack: &mut [u64], body: &Body, frame: usize) -> Result<usize, Trap> {
    let locals = frame + usize::from(body.parameters);
    if stack.len() - locals.min(stack.len()) < body.slots as usize - usize::from(body.parameters) {
        return Err(Trap::StackExhausted);
    }
    let top = locals + usize::from(body.locals);
    stack[locals..top].fill(0);
    Ok(top)
}

fn divide(operator: u8, left: u64, right: u64) -> Result<u64, Trap> {
    let (a, b) = (left as u32, right as u32);
    let is_zero = if operator <= I32_REM_U { b == 0 } else { right == 0 };
    if is_zero {
        return Err(Trap::DivisionByZero);
    }
    let (signed, by) = (a.cast_signed(), b.cast_signed());
    let (long, long_by) = (left.cast_signed(), right.cast_signed());
    Ok(match operator {
        I32_DIV_S => {
            u64::from(signed.checked_div(by).ok_or(Trap::IntegerOverflow)?.cast_unsigned())
        }
        I32_DIV_U => u64::from(a / b),
        I32_REM_S => u64::from(signed.wrapping_rem(by).cast_unsigned()),
        I32_REM_U => u64::from(a % b),
        I64_DIV_S => long.checked_div(long_by).ok_or(Trap::IntegerOverflow)?.cast_unsigned(),
        I64_DIV_U => left / right,
        I64_REM_S => long.wrapping_rem(long_by).cast_unsigned(),
        _ => left % right,
    })
}
