//! A module that runs, from outside: the room that it has, its start, and calls of its functions.

use crate::load;
use crate::module::{Function, Module};
use crate::reader::Reader;
use crate::run::{State, run};
use crate::tables::{Tables, ValueType};
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
    /// of fuel, a division 8, a call through the table 4, growing memory (which always fails) 100, and each eight locals
    /// of a function that is called one more.
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
