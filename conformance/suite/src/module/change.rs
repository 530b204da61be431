//! Changes of a module, one instruction each, whatever language it was written in.

use wasm_encoder::{CodeSection, Encode, Section};
use wasmparser::{
    BinaryReaderError, CompositeInnerType, FuncType, FunctionBody, MemArg, Operator, Parser,
    Payload, Validator,
};

/// A module with its functions, ready to be changed.
#[derive(Debug)]
pub(crate) struct Changeable<'a> {
    module: &'a [u8],
    /// Where the code section begins and ends, its header included.
    section: (usize, usize),
    /// Where each function's body begins and ends, without its size.
    bodies: Vec<(usize, usize)>,
    changes: Vec<Change>,
}

/// One instruction becomes another, or none.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Change {
    /// The function's number.
    pub(crate) function: u32,
    /// Where the instruction stands in the module.
    pub(crate) at: usize,
    end: usize,
    becomes: Vec<u8>,
    /// For people: `i32.lt_u becomes i32.le_u`.
    pub(crate) what: String,
}

/// Types of the module's functions.
#[derive(Default)]
struct Types {
    types: Vec<Option<FuncType>>,
    /// The type of each function.
    functions: Vec<u32>,
}

impl<'a> Changeable<'a> {
    /// Finds every change that there is, those that make no valid module left out
    /// later.
    pub(crate) fn new(module: &'a [u8]) -> Result<Self, BinaryReaderError> {
        let mut types = Types::default();
        let mut changeable =
            Self { module, section: (0, 0), bodies: Vec::new(), changes: Vec::new() };
        let mut before = 0;
        for payload in Parser::new(0).parse_all(module) {
            let payload = payload?;
            match &payload {
                Payload::TypeSection(section) => {
                    for group in section.clone() {
                        types.types.extend(group?.into_types().map(|kind| {
                            match kind.composite_type.inner {
                                CompositeInnerType::Func(function) => Some(function),
                                _ => None,
                            }
                        }));
                    }
                }
                Payload::FunctionSection(section) => {
                    types.functions = section.clone().into_iter().collect::<Result<_, _>>()?;
                }
                Payload::CodeSectionStart { range, .. } => {
                    changeable.section = (before, range.end);
                }
                Payload::CodeSectionEntry(body) => changeable.add(body, &types)?,
                _ => {}
            }
            if let Some((_, range)) = payload.as_section() {
                before = range.end;
            }
        }
        Ok(changeable)
    }

    pub(crate) fn changes(&self) -> &[Change] {
        &self.changes
    }

    /// The module with this change; `None` if that is no valid one.
    pub(crate) fn apply(&self, change: &Change) -> Option<Vec<u8>> {
        let mut code = CodeSection::new();
        for (number, (start, end)) in self.bodies.iter().enumerate() {
            if number == change.function as usize {
                let before = &self.module[*start..change.at];
                let behind = &self.module[change.end..*end];
                code.raw(&[before, &change.becomes, behind].concat());
            } else {
                code.raw(&self.module[*start..*end]);
            }
        }
        let mut module = self.module[..self.section.0].to_vec();
        code.append_to(&mut module);
        module.extend_from_slice(&self.module[self.section.1..]);
        Validator::new().validate_all(&module).ok().map(|_| module)
    }

    fn add(&mut self, body: &FunctionBody<'_>, types: &Types) -> Result<(), BinaryReaderError> {
        let function = self.bodies.len() as u32;
        let range = body.range();
        self.bodies.push((range.start, range.end));
        let mut operators = body.get_operators_reader()?;
        while !operators.eof() {
            let (operator, at) = operators.read_with_offset()?;
            let end = operators.original_position();
            let written = &self.module[at..end];
            for (becomes, what) in others(&operator, written, types) {
                self.changes.push(Change { function, at, end, becomes, what });
            }
        }
        Ok(())
    }
}

// Opcodes of the WebAssembly core specification, section "Instructions".
const DROP: u8 = 0x1A;
const I32_CONST: u8 = 0x41;
const I64_CONST: u8 = 0x42;
const I32_EQZ: u8 = 0x45;
const I32_NE: u8 = 0x47;
const I64_NE: u8 = 0x52;

/// What an instruction can become.
fn others(operator: &Operator<'_>, written: &[u8], types: &Types) -> Vec<(Vec<u8>, String)> {
    let negated = || [&[I32_EQZ], written].concat();
    let change = |becomes: Vec<u8>, what: &str| (becomes, what.to_owned());
    match operator {
        Operator::I32Const { value } => constants(i64::from(*value), I32_CONST),
        Operator::I64Const { value } => constants(*value, I64_CONST),
        Operator::I32Eqz => vec![change(vec![I32_CONST, 0, I32_NE], "i32.eqz is turned")],
        Operator::I64Eqz => vec![change(vec![I64_CONST, 0, I64_NE], "i64.eqz is turned")],
        Operator::BrIf { .. } => vec![
            change(negated(), "a branch is taken where it was not"),
            change(vec![DROP], "a branch is never taken"),
        ],
        Operator::If { .. } => vec![change(negated(), "if is turned")],
        Operator::Select => vec![change(negated(), "select takes the other")],
        Operator::Br { .. } | Operator::Return => vec![change(Vec::new(), "a branch is left out")],
        Operator::LocalSet { .. } => vec![change(vec![DROP], "a local is not set")],
        Operator::LocalTee { .. } => vec![change(Vec::new(), "a local is not set")],
        Operator::Call { function_index } => {
            let left_out = types.without_call(*function_index);
            left_out.map(|becomes| change(becomes, "a call is left out")).into_iter().collect()
        }
        Operator::I32Load8U { memarg } => vec![access(0x2C, 0, memarg, "load8_u sees a sign")],
        Operator::I32Load8S { memarg } => vec![access(0x2D, 0, memarg, "load8_s sees no sign")],
        Operator::I32Load16U { memarg } => {
            vec![access(0x2D, 0, memarg, "load16_u becomes load8_u")]
        }
        Operator::I32Load { memarg } => vec![access(0x2F, 1, memarg, "load becomes load16_u")],
        Operator::I64Load { memarg } => vec![access(0x35, 2, memarg, "load becomes load32_u")],
        Operator::I32Store { memarg } => stores(Some((0x3B, 1)), memarg),
        Operator::I32Store16 { memarg } => stores(Some((0x3A, 0)), memarg),
        Operator::I64Store { memarg } => stores(Some((0x3E, 2)), memarg),
        Operator::I32Store8 { memarg }
        | Operator::I64Store8 { memarg }
        | Operator::I64Store16 { memarg }
        | Operator::I64Store32 { memarg } => stores(None, memarg),
        _ => match written {
            [opcode] => swapped(*opcode),
            _ => Vec::new(),
        },
    }
}

fn constants(value: i64, opcode: u8) -> Vec<(Vec<u8>, String)> {
    let mut others = vec![value.wrapping_add(1), value.wrapping_sub(1)];
    if !(-1..=1).contains(&value) {
        others.push(0);
    }
    let is_small = |other: &i64| opcode == I64_CONST || i32::try_from(*other).is_ok();
    let change = |other: i64| {
        let mut becomes = vec![opcode];
        other.encode(&mut becomes);
        (becomes, format!("{value} becomes {other}"))
    };
    others.into_iter().filter(is_small).map(change).collect()
}

/// An access of the same place in another width.
fn access(opcode: u8, align: u8, memarg: &MemArg, what: &str) -> (Vec<u8>, String) {
    let mut becomes = vec![opcode, align];
    memarg.offset.encode(&mut becomes);
    (becomes, what.to_owned())
}

fn stores(narrow: Option<(u8, u8)>, memarg: &MemArg) -> Vec<(Vec<u8>, String)> {
    let mut others = vec![(vec![DROP, DROP], "a store is left out".to_owned())];
    others
        .extend(narrow.map(|(opcode, align)| access(opcode, align, memarg, "a store is narrower")));
    others
}

/// Comparisons with their bound moved and turned, arithmetic by its neighbour.
fn swapped(opcode: u8) -> Vec<(Vec<u8>, String)> {
    /// eq, ne, lt_s, lt_u, gt_s, gt_u, le_s, le_u, ge_s, ge_u of i32 and of i64: what each
    /// becomes with its bound moved, and turned.
    const COMPARISONS: [(u8, &str); 2] = [(0x46, "i32"), (0x51, "i64")];
    const NAMES: [&str; 10] =
        ["eq", "ne", "lt_s", "lt_u", "gt_s", "gt_u", "le_s", "le_u", "ge_s", "ge_u"];
    const MOVED: [Option<usize>; 10] =
        [None, None, Some(6), Some(7), Some(8), Some(9), Some(2), Some(3), Some(4), Some(5)];
    const TURNED: [usize; 10] = [1, 0, 8, 9, 6, 7, 4, 5, 2, 3];
    /// add, sub, mul, div_s, div_u, rem_s, rem_u, and, or, xor, shl, shr_s, shr_u.
    const ARITHMETIC: [(u8, &str); 2] = [(0x6A, "i32"), (0x7C, "i64")];
    const OPERATIONS: [(&str, usize); 13] = [
        ("add", 1),
        ("sub", 0),
        ("mul", 0),
        ("div_s", 4),
        ("div_u", 6),
        ("rem_s", 6),
        ("rem_u", 4),
        ("and", 8),
        ("or", 7),
        ("xor", 8),
        ("shl", 12),
        ("shr_s", 12),
        ("shr_u", 10),
    ];
    for (first, kind) in COMPARISONS {
        let place = usize::from(opcode.wrapping_sub(first));
        if opcode >= first && place < NAMES.len() {
            let all = MOVED[place].into_iter().chain([TURNED[place]]);
            let change = |other: usize| {
                let what = format!("{kind}.{} becomes {}", NAMES[place], NAMES[other]);
                (vec![first + other as u8], what)
            };
            return all.map(change).collect();
        }
    }
    for (first, kind) in ARITHMETIC {
        let place = usize::from(opcode.wrapping_sub(first));
        if opcode >= first && place < OPERATIONS.len() {
            let (name, other) = OPERATIONS[place];
            let what = format!("{kind}.{name} becomes {}", OPERATIONS[other].0);
            return vec![(vec![first + other as u8], what)];
        }
    }
    Vec::new()
}

impl Types {
    /// What takes a call's parameters from the stack and leaves 0 as its result.
    fn without_call(&self, function: u32) -> Option<Vec<u8>> {
        let kind = *self.functions.get(function as usize)?;
        let kind = self.types.get(kind as usize)?.as_ref()?;
        let mut becomes = vec![DROP; kind.params().len()];
        match kind.results() {
            [] => {}
            [wasmparser::ValType::I32] => becomes.extend([I32_CONST, 0]),
            [wasmparser::ValType::I64] => becomes.extend([I64_CONST, 0]),
            _ => return None,
        }
        Some(becomes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODULE: &str = r#"(module
      (memory 1 1)
      (func $least (param i32 i32) (result i32)
        (if (result i32) (i32.lt_u (local.get 0) (local.get 1))
          (then (local.get 0))
          (else (local.get 1))))
      (func (export "keep") (param i32)
        (i32.store (i32.const 16) (call $least (local.get 0) (i32.const 200)))))"#;

    #[test]
    fn every_kind_of_instruction_is_changed_and_most_changes_are_modules() {
        let module = wat::parse_str(MODULE).unwrap();
        let changeable = Changeable::new(&module).unwrap();
        let whats: Vec<&str> =
            changeable.changes().iter().map(|change| change.what.as_str()).collect();
        assert_eq!(
            whats,
            [
                "i32.lt_u becomes le_u",
                "i32.lt_u becomes ge_u",
                "if is turned",
                "16 becomes 17",
                "16 becomes 15",
                "16 becomes 0",
                "200 becomes 201",
                "200 becomes 199",
                "200 becomes 0",
                "a call is left out",
                "a store is left out",
                "a store is narrower",
            ]
        );
        for change in changeable.changes() {
            let other = changeable.apply(change).expect("it is a valid module");
            assert_ne!(other, module, "{}", change.what);
        }
    }
}
