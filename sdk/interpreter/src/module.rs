//! A module that was validated, and what has to be known of it beside its bytes.

use crate::invalid::Invalid;
use crate::load;
use crate::reader::Reader;
use crate::tables::{Tables, ValueType};

/// A validated module: its bytes, wherever they are, and small tables.
///
/// ```
/// use softplug_interpreter::Module;
///
/// // In a unit, these bytes are in flash.
/// static BYTES: &[u8] = b"\0asm\x01\0\0\0";
/// let module = Module::load(BYTES)?;
/// assert_eq!(module.exported_function("softplug_v1"), None);
/// assert_eq!(module.custom_section("softplug.manifest"), None);
/// assert_eq!(module.table_bytes(), 0);
/// # Ok::<(), softplug_interpreter::Invalid>(())
/// ```
#[derive(Debug)]
pub struct Module<B> {
    bytes: B,
    pub(crate) tables: Tables,
}

/// A function of a module, by its place in it.
///
/// ```
/// # let wasm = wat::parse_str("(module (func) (func (export \"second\")))")?;
/// let module = softplug_interpreter::Module::load(wasm)?;
/// let second = module.exported_function("second").expect("it is exported");
/// assert_eq!(second.index(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Function(pub(crate) u32);

impl Function {
    /// Its place among the module's functions.
    pub fn index(self) -> u32 {
        self.0
    }
}

impl<B: AsRef<[u8]>> Module<B> {
    /// Validates a module: WebAssembly 1.0 with mutable globals, without imports and without a start
    /// function. Takes memory for its tables only.
    ///
    /// # Errors
    /// It is not such a module.
    pub fn load(bytes: B) -> Result<Self, Invalid> {
        let tables = load::load(bytes.as_ref())?;
        Ok(Self { bytes, tables })
    }

    /// The module's bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.as_ref()
    }

    /// Bytes that the tables beside the module take.
    pub fn table_bytes(&self) -> usize {
        let Tables { types, functions, branches, elements, globals, .. } = &self.tables;
        size_of_val(&types[..])
            + size_of_val(&functions[..])
            + size_of_val(&branches[..])
            + size_of_val(&elements[..])
            + size_of_val(&globals[..])
    }

    /// The memory that it declares, in pages of 64 KiB.
    pub fn memory_pages(&self) -> u32 {
        self.tables.memory_pages
    }

    /// A function that is exported under this name.
    pub fn exported_function(&self, name: &str) -> Option<Function> {
        self.export(name, load::EXPORT_FUNCTION).map(Function)
    }

    /// Whether a function has these parameters and this result.
    ///
    /// ```
    /// use softplug_interpreter::{Module, ValueType};
    ///
    /// let wasm = wat::parse_str("(module (func (export \"f\") (param i64) (result i32) unreachable))")?;
    /// let module = Module::load(wasm)?;
    /// let f = module.exported_function("f").expect("it is exported");
    /// assert!(module.has_signature(f, &[ValueType::I64], Some(ValueType::I32)));
    /// assert!(!module.has_signature(f, &[ValueType::I32], Some(ValueType::I32)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn has_signature(
        &self,
        function: Function,
        parameters: &[ValueType],
        result: Option<ValueType>,
    ) -> bool {
        let Some(body) = self.tables.functions.get(function.0 as usize) else { return false };
        let ty = self.tables.types[usize::from(body.ty)];
        let at = ty.at as usize;
        let its = &self.bytes()[at..at + usize::from(ty.parameters)];
        let is_same = |(&byte, &wanted)| ValueType::of(byte) == Some(wanted);
        ty.result == result
            && its.len() == parameters.len()
            && its.iter().zip(parameters).all(is_same)
    }

    pub(crate) fn exported_global(&self, name: &str) -> Option<usize> {
        self.export(name, load::EXPORT_GLOBAL).map(|index| index as usize)
    }

    fn export(&self, name: &str, kind: u8) -> Option<u32> {
        let mut exports = Reader::new(self.bytes(), self.tables.exports.clone());
        // The section was read once: nothing in it is cut off.
        let count = exports.u32().ok()?;
        for _ in 0..count {
            let found = exports.name().ok()?;
            let (its_kind, index) = (exports.byte().ok()?, exports.u32().ok()?);
            if found == name && its_kind == kind {
                return Some(index);
            }
        }
        None
    }

    /// What is in the first custom section of this name.
    pub fn custom_section(&self, name: &str) -> Option<&[u8]> {
        custom_section(self.bytes(), name)
    }
}

/// What is in the first custom section of this name, of a module that was not loaded: to see what it says
/// of itself before there is room made for it.
///
/// ```
/// use softplug_interpreter::custom_section;
///
/// let wasm = wat::parse_str("(module (@custom \"note\" \"read me\"))")?;
/// assert_eq!(custom_section(&wasm, "note"), Some(&b"read me"[..]));
/// assert_eq!(custom_section(&wasm[..20], "note"), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn custom_section<'a>(module: &'a [u8], name: &str) -> Option<&'a [u8]> {
    let mut sections = Reader::new(module, 8.min(module.len())..module.len());
    while !sections.is_at_end() {
        let id = sections.byte().ok()?;
        let length = sections.u32().ok()? as usize;
        let mut section = sections.part(length).ok()?;
        if id == load::SECTION_CUSTOM && section.name().ok()? == name {
            return Some(&module[section.at()..sections.at()]);
        }
    }
    None
}
