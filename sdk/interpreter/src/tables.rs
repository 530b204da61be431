//! What has to be known of a module beside its bytes.

use alloc::vec::Vec;
use core::ops::Range;

/// What is known of a module beside its bytes. Places are bytes from its start.
#[derive(Default, Debug)]
pub(crate) struct Tables {
    pub(crate) types: Vec<Type>,
    pub(crate) functions: Vec<Body>,
    pub(crate) branches: Vec<Branch>,
    /// Functions of the table, each with 1 added; 0 where none was set.
    pub(crate) elements: Vec<u16>,
    /// Where the elements end that the module has for it.
    pub(crate) elements_end: usize,
    pub(crate) globals: Vec<Global>,
    pub(crate) memory_pages: u32,
    pub(crate) has_memory: bool,
    pub(crate) exports: Range<usize>,
    pub(crate) data: Range<usize>,
}

/// A function type.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Type {
    /// Its parameters, a byte each.
    pub(crate) at: u32,
    pub(crate) parameters: u16,
    pub(crate) result: Option<ValueType>,
    /// The first type that is the same.
    pub(crate) same_as: u16,
}

/// A function's code.
#[derive(Copy, Clone, Default, Debug)]
pub(crate) struct Body {
    /// Its first operator, behind the locals.
    pub(crate) start: u32,
    /// Its last operator, an `end`.
    pub(crate) end: u32,
    /// Its first branch.
    pub(crate) branches: u32,
    /// Slots of parameters, locals and operands together.
    pub(crate) slots: u32,
    pub(crate) ty: u16,
    pub(crate) parameters: u16,
    /// Without the parameters.
    pub(crate) locals: u16,
    pub(crate) has_result: bool,
}

#[derive(Copy, Clone, Debug)]
pub(crate) struct Global {
    pub(crate) ty: ValueType,
    pub(crate) is_mutable: bool,
    /// Its initial value.
    pub(crate) value: u64,
}

/// What a value is.
///
/// [`Module::has_signature`](crate::Module::has_signature) has an example.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum ValueType {
    /// An integer of 32 bits.
    I32,
    /// An integer of 64 bits.
    I64,
    /// A float of 32 bits.
    F32,
    /// A float of 64 bits.
    F64,
}

impl ValueType {
    pub(crate) fn of(byte: u8) -> Option<Self> {
        Some(match byte {
            0x7F => Self::I32,
            0x7E => Self::I64,
            0x7D => Self::F32,
            0x7C => Self::F64,
            _ => return None,
        })
    }
}

/// Where a branch goes: packed into eight bytes, as there are many.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Branch {
    /// Place in the module, and in the top bit whether a value is kept.
    target: u32,
    /// Which branch comes next there (17 bits), and the frame's slots that stay (15 bits).
    next_and_height: u32,
}

impl Branch {
    pub(crate) const MOST_BRANCHES: usize = 1 << 17;
    pub(crate) const MOST_HEIGHT: u32 = (1 << 15) - 1;

    pub(crate) fn new(target: u32, next: u32, height: u32, keeps: bool) -> Self {
        Self { target: target | u32::from(keeps) << 31, next_and_height: next | height << 17 }
    }

    pub(crate) fn target(self) -> usize {
        (self.target & 0x7FFF_FFFF) as usize
    }

    pub(crate) fn keeps(self) -> bool {
        self.target >> 31 != 0
    }

    pub(crate) fn next(self) -> usize {
        (self.next_and_height & 0x1_FFFF) as usize
    }

    pub(crate) fn height(self) -> usize {
        (self.next_and_height >> 17) as usize
    }
}
