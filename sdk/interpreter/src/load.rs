//! Loading: the sections of a module are read and validated.

use crate::invalid::{Invalid, InvalidReason as Reason};
use crate::opcode;
use crate::reader::Reader;
use crate::tables::{Body, Branch, Global, Tables, Type, ValueType};
use crate::validate::{self, Scratch};
use alloc::vec::Vec;
use softplug_abi::limits::{ELEMENTS, EXPORTS, FUNCTIONS, GLOBALS, LOCALS, PARAMETERS, TYPES};

pub(crate) const SECTION_CUSTOM: u8 = 0;
const SECTION_TYPE: u8 = 1;
const SECTION_IMPORT: u8 = 2;
const SECTION_FUNCTION: u8 = 3;
const SECTION_TABLE: u8 = 4;
const SECTION_MEMORY: u8 = 5;
const SECTION_GLOBAL: u8 = 6;
const SECTION_EXPORT: u8 = 7;
const SECTION_START: u8 = 8;
const SECTION_ELEMENT: u8 = 9;
const SECTION_CODE: u8 = 10;
const SECTION_DATA: u8 = 11;

pub(crate) const EXPORT_FUNCTION: u8 = 0;
const EXPORT_TABLE: u8 = 1;
const EXPORT_MEMORY: u8 = 2;
pub(crate) const EXPORT_GLOBAL: u8 = 3;

/// Most pages of memory that WebAssembly knows.
const MOST_PAGES: u32 = 65_536;

pub(crate) fn load(bytes: &[u8]) -> Result<Tables, Invalid> {
    if !bytes.starts_with(b"\0asm\x01\0\0\0") {
        return Err(Invalid { at: 0, reason: Reason::NotAModule });
    }
    let mut loading = Loading { bytes, tables: Tables::default(), has_table: false, bodies: 0 };
    let mut module = Reader::new(bytes, 8..bytes.len());
    let mut last = 0;
    while !module.is_at_end() {
        let id = module.byte()?;
        let length = module.u32()? as usize;
        let mut section = module.part(length)?;
        if id == SECTION_CUSTOM {
            section.name()?;
            continue;
        }
        if id <= last {
            return Err(section.invalid(Reason::Section));
        }
        last = id;
        loading.section(id, &mut section)?;
        if !section.is_at_end() {
            return Err(section.invalid(Reason::Surplus));
        }
    }
    if loading.bodies != loading.tables.functions.len() {
        return Err(module.invalid(Reason::Section));
    }
    Ok(loading.tables)
}

struct Loading<'a> {
    bytes: &'a [u8],
    tables: Tables,
    has_table: bool,
    bodies: usize,
}

impl Loading<'_> {
    fn section(&mut self, id: u8, section: &mut Reader<'_>) -> Result<(), Invalid> {
        match id {
            SECTION_TYPE => self.types(section),
            SECTION_IMPORT => match section.u32()? {
                0 => Ok(()),
                _ => Err(section.invalid(Reason::Imports)),
            },
            SECTION_FUNCTION => self.functions(section),
            SECTION_TABLE => self.table(section),
            SECTION_MEMORY => self.memory(section),
            SECTION_GLOBAL => self.globals(section),
            SECTION_EXPORT => self.exports(section),
            SECTION_START => Err(section.invalid(Reason::StartFunction)),
            SECTION_ELEMENT => self.elements(section),
            SECTION_CODE => self.code(section),
            SECTION_DATA => self.data(section),
            _ => Err(section.invalid(Reason::Section)),
        }
    }

    fn types(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        let types = count(section, TYPES)?;
        self.tables.types.reserve_exact(types);
        for nth in 0..types {
            if section.byte()? != 0x60 {
                return Err(section.invalid(Reason::Type));
            }
            let parameters = count(section, PARAMETERS)?;
            let at = section.at();
            for _ in 0..parameters {
                value_type(section)?;
            }
            let result = match section.u32()? {
                0 => None,
                1 => Some(value_type(section)?),
                _ => return Err(section.invalid(Reason::Type)),
            };
            let text = &self.bytes[at..at + parameters];
            let is_same = |other: &Type| {
                let other_at = other.at as usize;
                other.result == result
                    && &self.bytes[other_at..other_at + usize::from(other.parameters)] == text
            };
            let same_as = self.tables.types.iter().position(is_same).unwrap_or(nth) as u16;
            let ty = Type { at: at as u32, parameters: parameters as u16, result, same_as };
            self.tables.types.push(ty);
        }
        Ok(())
    }

    fn functions(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        let count = count(section, FUNCTIONS)?;
        self.tables.functions.reserve_exact(count);
        for _ in 0..count {
            let ty = section.u32()? as usize;
            let Some(&Type { parameters, result, .. }) = self.tables.types.get(ty) else {
                return Err(section.invalid(Reason::Index));
            };
            let has_result = result.is_some();
            let body = Body { ty: ty as u16, parameters, has_result, ..Body::default() };
            self.tables.functions.push(body);
        }
        Ok(())
    }

    fn table(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        match section.u32()? {
            0 => return Ok(()),
            1 => {}
            _ => return Err(section.invalid(Reason::TooMany)),
        }
        if section.byte()? != 0x70 {
            return Err(section.invalid(Reason::Type));
        }
        let elements = limits(section, u32::MAX)?;
        if u64::from(elements) > ELEMENTS {
            return Err(section.invalid(Reason::TooMany));
        }
        self.has_table = true;
        self.tables.elements = alloc::vec![0; elements as usize];
        Ok(())
    }

    fn memory(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        match section.u32()? {
            0 => return Ok(()),
            1 => {}
            _ => return Err(section.invalid(Reason::TooMany)),
        }
        self.tables.memory_pages = limits(section, MOST_PAGES)?;
        self.tables.has_memory = true;
        Ok(())
    }

    fn globals(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        let count = count(section, GLOBALS)?;
        self.tables.globals.reserve_exact(count);
        for _ in 0..count {
            let ty = value_type(section)?;
            let is_mutable = match section.byte()? {
                0 => false,
                1 => true,
                _ => return Err(section.invalid(Reason::Type)),
            };
            let value = constant(section, ty)?;
            self.tables.globals.push(Global { ty, is_mutable, value });
        }
        Ok(())
    }

    fn exports(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        let start = section.at();
        let mut names: Vec<&str> = Vec::new();
        for _ in 0..count(section, EXPORTS)? {
            let name = section.name()?;
            if names.contains(&name) {
                return Err(section.invalid(Reason::ExportedTwice));
            }
            names.push(name);
            let kind = section.byte()?;
            let index = section.u32()? as usize;
            let is_there = match kind {
                EXPORT_FUNCTION => index < self.tables.functions.len(),
                EXPORT_TABLE => index == 0 && self.has_table,
                EXPORT_MEMORY => index == 0 && self.tables.has_memory,
                EXPORT_GLOBAL => index < self.tables.globals.len(),
                _ => return Err(section.invalid(Reason::Type)),
            };
            if !is_there {
                return Err(section.invalid(Reason::Index));
            }
        }
        self.tables.exports = start..section.at();
        Ok(())
    }

    fn elements(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        for _ in 0..count(section, ELEMENTS)? {
            if section.u32()? != 0 || !self.has_table {
                return Err(section.invalid(Reason::Index));
            }
            let first = constant(section, ValueType::I32)? as usize;
            let count = count(section, ELEMENTS)?;
            let end = first.saturating_add(count);
            // The module is valid all the same: it does not start.
            self.tables.elements_end = self.tables.elements_end.max(end);
            for place in first..end {
                let function = section.u32()?;
                if function as usize >= self.tables.functions.len() {
                    return Err(section.invalid(Reason::Index));
                }
                if let Some(element) = self.tables.elements.get_mut(place) {
                    *element = function as u16 + 1;
                }
            }
        }
        Ok(())
    }

    /// The bodies are gone through twice, so that the list of branches has its size at once: where memory
    /// is little, a list that grows would be there twice for a moment.
    fn code(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        let count = count(section, FUNCTIONS)?;
        if count != self.tables.functions.len() {
            return Err(section.invalid(Reason::Section));
        }
        self.bodies = count;
        let mut scratch = Scratch::default();
        let bodies = section.clone();
        for keeps in [false, true] {
            *section = bodies.clone();
            scratch.begin(keeps);
            for nth in 0..count {
                let length = section.u32()? as usize;
                let mut body = section.part(length)?;
                self.body(nth, &mut body, &mut scratch)?;
            }
            if scratch.branches.len() > Branch::MOST_BRANCHES {
                return Err(section.invalid(Reason::TooMany));
            }
        }
        self.tables.branches = scratch.branches.into_list();
        Ok(())
    }

    fn body(
        &mut self,
        nth: usize,
        code: &mut Reader<'_>,
        scratch: &mut Scratch,
    ) -> Result<(), Invalid> {
        let ty = self.tables.types[usize::from(self.tables.functions[nth].ty)];
        let start = ty.at as usize;
        scratch.locals.clear();
        for &parameter in &self.bytes[start..start + usize::from(ty.parameters)] {
            scratch.locals.extend(ValueType::of(parameter));
        }
        for _ in 0..code.u32()? {
            let count = code.u32()? as usize;
            let ty = value_type(code)?;
            if count > LOCALS as usize - scratch.locals.len().min(LOCALS as usize) {
                return Err(code.invalid(Reason::TooMany));
            }
            scratch.locals.resize(scratch.locals.len() + count, ty);
        }
        let body = &mut self.tables.functions[nth];
        body.locals = scratch.locals.len() as u16 - ty.parameters;
        body.start = code.at() as u32;
        body.branches = scratch.branches.len() as u32;
        let (end, operands) =
            validate::body(code, &self.tables, self.has_table, ty.result, scratch)?;
        let body = &mut self.tables.functions[nth];
        body.end = end;
        body.slots = scratch.locals.len() as u32 + operands;
        Ok(())
    }

    fn data(&mut self, section: &mut Reader<'_>) -> Result<(), Invalid> {
        let start = section.at();
        for _ in 0..section.u32()? {
            segment(section)?;
            if !self.tables.has_memory {
                return Err(section.invalid(Reason::Index));
            }
        }
        self.tables.data = start..section.at();
        Ok(())
    }
}

/// One data segment: its address, and its bytes' places in the module.
pub(crate) fn segment(section: &mut Reader<'_>) -> Result<(u32, core::ops::Range<usize>), Invalid> {
    if section.u32()? != 0 {
        return Err(section.invalid(Reason::Index));
    }
    let address = constant(section, ValueType::I32)? as u32;
    let length = section.u32()? as usize;
    Ok((address, section.skip(length)?))
}

fn count(section: &mut Reader<'_>, most: u64) -> Result<usize, Invalid> {
    let count = section.u32()?;
    if u64::from(count) > most {
        return Err(section.invalid(Reason::TooMany));
    }
    Ok(count as usize)
}

fn value_type(section: &mut Reader<'_>) -> Result<ValueType, Invalid> {
    let byte = section.byte()?;
    ValueType::of(byte).ok_or_else(|| section.invalid(Reason::Type))
}

/// The least size, checked against the most.
fn limits(section: &mut Reader<'_>, most: u32) -> Result<u32, Invalid> {
    let has_maximum = match section.byte()? {
        0 => false,
        1 => true,
        _ => return Err(section.invalid(Reason::Limits)),
    };
    let least = section.u32()?;
    let maximum = if has_maximum { section.u32()? } else { most };
    if least > maximum || maximum > most {
        return Err(section.invalid(Reason::Limits));
    }
    Ok(least)
}

/// A constant of this type, as bits. Globals could be read only if they were imported.
fn constant(section: &mut Reader<'_>, ty: ValueType) -> Result<u64, Invalid> {
    let (found, bits) = match section.byte()? {
        opcode::I32_CONST => (ValueType::I32, u64::from(section.signed(32)? as u32)),
        opcode::I64_CONST => (ValueType::I64, section.signed(64)? as u64),
        opcode::F32_CONST => (ValueType::F32, little_endian(section, 4)?),
        opcode::F64_CONST => (ValueType::F64, little_endian(section, 8)?),
        _ => return Err(section.invalid(Reason::Constant)),
    };
    if found != ty || section.byte()? != opcode::END {
        return Err(section.invalid(Reason::Constant));
    }
    Ok(bits)
}

fn little_endian(section: &mut Reader<'_>, bytes: u32) -> Result<u64, Invalid> {
    (0..bytes).try_fold(0, |bits, nth| Ok(bits | u64::from(section.byte()?) << (8 * nth)))
}
