//! Running a module on its own bytes.

use crate::float;
use crate::load;
use crate::module::{Body, Branch, Function, Module, Tables, ValueType};
use crate::opcode::*;
use crate::reader::Reader;
use crate::trap::Trap;
use alloc::sync::Arc;
use alloc::vec::Vec;
use thiserror::Error;

const PAGE: u64 = 65_536;

/// How much there is for a module to run in.
///
/// ```
/// use softplug_interpreter::{Machine, Module, Room, Trap};
/// use std::sync::Arc;
///
/// let wasm = wat::parse_str(
///     "(module (memory 1 1)
///         (func (export \"touch\") (param i32) (i32.store8 (local.get 0) (i32.const 1))))",
/// )?;
/// let module = Arc::new(Module::load(wasm)?);
/// let touch = module.exported_function("touch").expect("it is exported");
/// // It declares 65,536 bytes, and is given 1,000.
/// let mut machine = Machine::new(module, Room { memory_bytes: 1_000, ..Room::default() })?;
/// assert_eq!(machine.call(touch, &[999], &mut 100), Ok(None));
/// assert_eq!(machine.call(touch, &[1_000], &mut 100), Err(Trap::MemoryOutOfBounds));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Room {
    /// Bytes of memory that are there, of those that the module declares; at most these. An access above
    /// is a trap. What the module asks for (`memory.size`) stays what it declares.
    pub memory_bytes: u32,
    /// Parameters, locals and operands of all calls within each other, eight bytes each. Past it: a trap.
    pub stack_slots: u32,
    /// Calls within calls. Past it: a trap.
    pub call_depth: u32,
}

impl Default for Room {
    /// All of the declared memory; 8,192 slots, 64 KiB; 1,024 calls.
    fn default() -> Self {
        Self { memory_bytes: u32::MAX, stack_slots: 8_192, call_depth: 1_024 }
    }
}

/// Why a module does not start.
///
/// ```
/// use softplug_interpreter::{Machine, Module, Room, StartError};
/// use std::sync::Arc;
///
/// let wasm = wat::parse_str("(module (memory 1 1) (data (i32.const 0xFFFF) \"G1\"))")?;
/// let error = Machine::new(Arc::new(Module::load(wasm)?), Room::default()).unwrap_err();
/// assert_eq!(error, StartError::Data { end: 0x10001, memory: 0x10000 });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum StartError {
    /// Its data lies outside the memory that is there.
    #[error("its data reaches to byte {end}, and the memory has {memory}")]
    Data {
        /// Where the data ends.
        end: u64,
        /// The memory that is there, in bytes.
        memory: u64,
    },
    /// Its elements do not fit into its table.
    #[error("its elements reach to place {end}, and the table has {table}")]
    Elements {
        /// Where they end.
        end: u64,
        /// Places of the table.
        table: u64,
    },
    /// There is not as much memory for it.
    #[error("there are no {bytes} bytes for it")]
    OutOfMemory {
        /// What it would take.
        bytes: u64,
    },
}

/// A module that runs: its memory, its globals, its stack.
///
/// The example of the [crate](crate) shows one.
#[derive(Debug)]
pub struct Machine<B> {
    module: Arc<Module<B>>,
    state: State,
}

#[derive(Debug)]
struct State {
    memory: Vec<u8>,
    globals: Vec<u64>,
    stack: Vec<u64>,
    /// Whoever called, the outermost first.
    callers: Vec<Caller>,
    call_depth: usize,
}

/// Where a call goes on when it has its answer.
#[derive(Copy, Clone, Debug)]
struct Caller {
    function: u32,
    at: u32,
    branch: u32,
    frame: u32,
}

impl<B: AsRef<[u8]>> Machine<B> {
    /// Sets up memory, globals and stack. Nothing of the module runs.
    ///
    /// # Errors
    /// Its data lies outside the memory, or there is not as much memory.
    pub fn new(module: Arc<Module<B>>, room: Room) -> Result<Self, StartError> {
        let tables = &module.tables;
        let (end, table) = (tables.elements_end as u64, tables.elements.len() as u64);
        if end > table {
            return Err(StartError::Elements { end, table });
        }
        let declared = u64::from(tables.memory_pages) * PAGE;
        let mut memory = zeros(declared.min(u64::from(room.memory_bytes)) as usize)?;
        let mut globals = reserved(tables.globals.len())?;
        globals.extend(tables.globals.iter().map(|global| global.value));
        let stack = zeros(room.stack_slots as usize)?;
        let callers = reserved(room.call_depth as usize)?;
        fill(module.bytes(), tables, &mut memory)?;
        let call_depth = room.call_depth as usize;
        Ok(Self { module, state: State { memory, globals, stack, callers, call_depth } })
    }

    /// The module that it runs.
    pub fn module(&self) -> &Arc<Module<B>> {
        &self.module
    }

    /// The memory that is there.
    pub fn memory(&self) -> &[u8] {
        &self.state.memory
    }

    /// The memory that is there, to write to.
    pub fn memory_mut(&mut self) -> &mut [u8] {
        &mut self.state.memory
    }

    /// What stands in an exported global that is an integer.
    ///
    /// ```
    /// use softplug_interpreter::{Machine, Module, Room};
    /// use std::sync::Arc;
    ///
    /// let wasm = wat::parse_str("(module (global (export \"count\") (mut i32) (i32.const -1)))")?;
    /// let mut machine = Machine::new(Arc::new(Module::load(wasm)?), Room::default())?;
    /// assert_eq!(machine.global("count"), Some(-1));
    /// assert!(machine.set_global("count", 7));
    /// assert_eq!(machine.global("count"), Some(7));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn global(&self, name: &str) -> Option<i64> {
        let at = self.module.exported_global(name)?;
        let bits = self.state.globals[at];
        match self.module.tables.globals[at].ty {
            ValueType::I32 => Some(i64::from(bits as i32)),
            ValueType::I64 => Some(bits as i64),
            ValueType::F32 | ValueType::F64 => None,
        }
    }

    /// Writes such a global; whether there is one that can be written.
    pub fn set_global(&mut self, name: &str, value: i64) -> bool {
        let Some(at) = self.module.exported_global(name) else { return false };
        let global = self.module.tables.globals[at];
        if !global.is_mutable || matches!(global.ty, ValueType::F32 | ValueType::F64) {
            return false;
        }
        self.state.globals[at] = value as u64;
        true
    }

    /// Calls a function; arguments and result are bits, those of an `i32` the lower half. An operator takes a unit
    /// of fuel, a division 8, a call through the table 4, growing memory (which always fails) 100.
    ///
    /// # Errors
    /// It trapped.
    ///
    /// # Panics
    /// If the function is of another module and has no place in this one, or has another number of parameters.
    pub fn call(
        &mut self,
        function: Function,
        arguments: &[u64],
        fuel: &mut u32,
    ) -> Result<Option<u64>, Trap> {
        let tables = &self.module.tables;
        let body = &tables.functions[function.0 as usize];
        assert_eq!(arguments.len(), usize::from(body.parameters), "a call has other parameters");
        let Some(slots) = self.state.stack.get_mut(..arguments.len()) else {
            return Err(Trap::StackExhausted);
        };
        slots.copy_from_slice(arguments);
        self.state.callers.clear();
        let has_result = body.has_result;
        run(self.module.bytes(), tables, &mut self.state, function.0, fuel)?;
        Ok(has_result.then(|| self.state.stack[0]))
    }
}

impl<B> Clone for Machine<B> {
    /// A second one in the same state.
    fn clone(&self) -> Self {
        let State { memory, globals, stack, callers: _, call_depth } = &self.state;
        let state = State {
            memory: memory.clone(),
            globals: globals.clone(),
            stack: stack.clone(),
            callers: Vec::with_capacity(*call_depth),
            call_depth: *call_depth,
        };
        Self { module: Arc::clone(&self.module), state }
    }
}

fn reserved<T>(count: usize) -> Result<Vec<T>, StartError> {
    let mut list = Vec::new();
    let bytes = count as u64 * size_of::<T>() as u64;
    list.try_reserve_exact(count).map_err(|_| StartError::OutOfMemory { bytes })?;
    Ok(list)
}

fn zeros<T: Clone + Default>(count: usize) -> Result<Vec<T>, StartError> {
    let mut list = reserved(count)?;
    list.resize(count, T::default());
    Ok(list)
}

fn fill(bytes: &[u8], tables: &Tables, memory: &mut [u8]) -> Result<(), StartError> {
    let mut section = Reader::new(bytes, tables.data.clone());
    // The section was read once: nothing in it is cut off. Without one there is no count either.
    for _ in 0..section.u32().unwrap_or(0) {
        let Ok((address, data)) = load::segment(&mut section) else { break };
        let end = u64::from(address) + data.len() as u64;
        let room = memory.len() as u64;
        let Some(place) = memory.get_mut(address as usize..end as usize) else {
            return Err(StartError::Data { end, memory: room });
        };
        place.copy_from_slice(&bytes[data]);
    }
    Ok(())
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
fn run(
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
        ($units:literal) => {
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
