//! Validation of a function's code, as the appendix of WebAssembly's specification has it, and the list
//! of where its branches go.

use crate::invalid::{Invalid, InvalidReason as Reason};
use crate::opcode::*;
use crate::reader::Reader;
use crate::tables::{Branch, Tables, ValueType};
use ValueType::{F32, F64, I32, I64};
use alloc::vec::Vec;
use softplug_abi::limits::NESTING;

/// What validating takes, used again for each function.
#[derive(Default)]
pub(crate) struct Scratch {
    pub(crate) locals: Vec<ValueType>,
    pub(crate) branches: Branches,
    operands: Vec<Operand>,
    blocks: Vec<Block>,
}

/// None: any type, in code that is never reached.
type Operand = Option<ValueType>;

#[derive(Copy, Clone, PartialEq, Eq)]
enum Kind {
    Function,
    Block,
    Loop,
    If,
    Else,
}

struct Block {
    kind: Kind,
    result: Option<ValueType>,
    /// Operands below it.
    height: u32,
    is_unreachable: bool,
    /// Place and next branch of a loop's start.
    start: (u32, u32),
    /// The last of the branches to its end, which names the one before.
    to_end: Chain,
    /// The branch of an `if` to its `else`.
    to_else: Chain,
}

/// A branch whose target is not known yet, by its place in the list.
type Chain = Option<u32>;

/// The list of branches: in a first round only counted.
#[derive(Default)]
pub(crate) struct Branches {
    list: Vec<Branch>,
    count: usize,
    keeps: bool,
}

/// For a chain's first one.
const NO_BRANCH: u32 = 0x7FFF_FFFF;

impl Branches {
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    pub(crate) fn into_list(self) -> Vec<Branch> {
        self.list
    }

    fn push(&mut self, branch: Branch) {
        self.count += 1;
        if self.keeps {
            self.list.push(branch);
        }
    }

    /// The branches of a chain go here.
    fn close(&mut self, chain: Chain, target: u32) {
        let next = self.count as u32;
        let mut open = chain;
        while let Some(at) = open.filter(|_| self.keeps) {
            let branch = &mut self.list[at as usize];
            let before = branch.target() as u32;
            open = (before != NO_BRANCH).then_some(before);
            *branch = Branch::new(target, next, branch.height() as u32, branch.keeps());
        }
    }
}

impl Scratch {
    pub(crate) fn begin(&mut self, keeps: bool) {
        let list = Vec::with_capacity(if keeps { self.branches.count } else { 0 });
        self.branches = Branches { list, count: 0, keeps };
    }
}

/// Validates a body behind its locals: the place of its last operator, and how many operands there are
/// at most.
pub(crate) fn body(
    code: &mut Reader<'_>,
    tables: &Tables,
    has_table: bool,
    result: Option<ValueType>,
    scratch: &mut Scratch,
) -> Result<(u32, u32), Invalid> {
    scratch.operands.clear();
    scratch.blocks.clear();
    let mut body = Body { code, tables, has_table, scratch, most: 0 };
    body.open(Kind::Function, result)?;
    let end = loop {
        let at = body.code.at() as u32;
        body.operator()?;
        if body.scratch.blocks.is_empty() {
            break at;
        }
    };
    if !body.code.is_at_end() {
        return Err(body.code.invalid(Reason::Surplus));
    }
    Ok((end, body.most))
}

struct Body<'a, 'b> {
    code: &'a mut Reader<'b>,
    tables: &'a Tables,
    has_table: bool,
    scratch: &'a mut Scratch,
    most: u32,
}

impl Body<'_, '_> {
    fn fail<T>(&self, reason: Reason) -> Result<T, Invalid> {
        Err(self.code.invalid(reason))
    }

    fn push(&mut self, operand: Operand) -> Result<(), Invalid> {
        self.scratch.operands.push(operand);
        self.most = self.most.max(self.scratch.operands.len() as u32);
        // A branch's height counts the locals too.
        if self.most + self.scratch.locals.len() as u32 > Branch::MOST_HEIGHT {
            return self.fail(Reason::TooMany);
        }
        Ok(())
    }

    fn pop_any(&mut self) -> Result<Operand, Invalid> {
        let block = self.block();
        if self.scratch.operands.len() == block.height as usize {
            return if block.is_unreachable { Ok(None) } else { self.fail(Reason::Operand) };
        }
        Ok(self.scratch.operands.pop().flatten())
    }

    fn pop(&mut self, wanted: ValueType) -> Result<(), Invalid> {
        match self.pop_any()? {
            Some(found) if found != wanted => self.fail(Reason::Operand),
            _ => Ok(()),
        }
    }

    fn pop_result(&mut self, result: Option<ValueType>) -> Result<(), Invalid> {
        result.map_or(Ok(()), |wanted| self.pop(wanted))
    }

    /// Operands off, one result on.
    fn op(&mut self, operands: &[ValueType], result: ValueType) -> Result<(), Invalid> {
        for &operand in operands.iter().rev() {
            self.pop(operand)?;
        }
        self.push(Some(result))
    }

    fn block(&self) -> &Block {
        self.scratch.blocks.last().expect("the function's own block ends last")
    }

    fn block_mut(&mut self) -> &mut Block {
        self.scratch.blocks.last_mut().expect("the function's own block ends last")
    }

    fn open(&mut self, kind: Kind, result: Option<ValueType>) -> Result<(), Invalid> {
        if self.scratch.blocks.len() as u64 > NESTING {
            return self.fail(Reason::TooMany);
        }
        self.scratch.blocks.push(Block {
            kind,
            result,
            height: self.scratch.operands.len() as u32,
            is_unreachable: false,
            start: (self.code.at() as u32, self.scratch.branches.len() as u32),
            to_end: None,
            to_else: None,
        });
        Ok(())
    }

    /// Takes the innermost block's result; nothing else may be left in it.
    fn finish(&mut self) -> Result<(), Invalid> {
        self.pop_result(self.block().result)?;
        if self.scratch.operands.len() != self.block().height as usize {
            return self.fail(Reason::Height);
        }
        Ok(())
    }

    fn unreachable(&mut self) {
        let height = self.block().height as usize;
        self.scratch.operands.truncate(height);
        self.block_mut().is_unreachable = true;
    }

    /// What a branch to this block takes along.
    fn label(&self, depth: u32) -> Result<(usize, Option<ValueType>), Invalid> {
        let Some(at) = self.scratch.blocks.len().checked_sub(depth as usize + 1) else {
            return self.fail(Reason::Index);
        };
        let block = &self.scratch.blocks[at];
        Ok((at, if block.kind == Kind::Loop { None } else { block.result }))
    }

    fn branch(&mut self, depth: u32) -> Result<(), Invalid> {
        let (at, kept) = self.label(depth)?;
        let Scratch { blocks, branches, locals, .. } = &mut *self.scratch;
        let block = &mut blocks[at];
        let height = locals.len() as u32 + block.height;
        if block.kind == Kind::Loop {
            let (target, next) = block.start;
            branches.push(Branch::new(target, next, height, false));
        } else {
            let before = block.to_end.replace(branches.len() as u32).unwrap_or(NO_BRANCH);
            branches.push(Branch::new(before, 0, height, kept.is_some()));
        }
        Ok(())
    }

    fn block_type(&mut self) -> Result<Option<ValueType>, Invalid> {
        match self.code.byte()? {
            0x40 => Ok(None),
            byte => match ValueType::of(byte) {
                Some(ty) => Ok(Some(ty)),
                None => self.fail(Reason::Type),
            },
        }
    }

    fn local(&mut self) -> Result<ValueType, Invalid> {
        let index = self.code.u32()? as usize;
        match self.scratch.locals.get(index) {
            Some(&ty) => Ok(ty),
            None => self.fail(Reason::Index),
        }
    }

    /// An address, then the access: alignment as a power of two, at most `most`.
    fn access(&mut self, most: u32) -> Result<(), Invalid> {
        let alignment = self.code.u32()?;
        self.code.u32()?;
        if !self.tables.has_memory {
            return self.fail(Reason::Index);
        }
        if alignment > most { self.fail(Reason::Alignment) } else { Ok(()) }
    }

    fn load(&mut self, ty: ValueType, most: u32) -> Result<(), Invalid> {
        self.access(most)?;
        self.op(&[I32], ty)
    }

    fn store(&mut self, ty: ValueType, most: u32) -> Result<(), Invalid> {
        self.access(most)?;
        self.pop(ty)?;
        self.pop(I32)
    }

    fn call(&mut self, ty: usize) -> Result<(), Invalid> {
        let ty = self.tables.types[ty];
        // The parameters' types were read when the types were: each is one.
        for nth in (0..usize::from(ty.parameters)).rev() {
            if let Some(parameter) = ValueType::of(self.code.byte_at(ty.at as usize + nth)) {
                self.pop(parameter)?;
            }
        }
        ty.result.map_or(Ok(()), |result| self.push(Some(result)))
    }

    fn operator(&mut self) -> Result<(), Invalid> {
        let operator = self.code.byte()?;
        match operator {
            UNREACHABLE => self.unreachable(),
            NOP => {}
            BLOCK | LOOP => {
                let result = self.block_type()?;
                let kind = if operator == LOOP { Kind::Loop } else { Kind::Block };
                self.open(kind, result)?;
            }
            IF => {
                self.pop(I32)?;
                let result = self.block_type()?;
                let branch = self.scratch.branches.len() as u32;
                self.scratch.branches.push(Branch::new(NO_BRANCH, 0, 0, false));
                self.open(Kind::If, result)?;
                self.block_mut().to_else = Some(branch);
            }
            ELSE => self.otherwise()?,
            END => self.end()?,
            BR => {
                let depth = self.code.u32()?;
                let (_, kept) = self.label(depth)?;
                self.pop_result(kept)?;
                self.branch(depth)?;
                self.unreachable();
            }
            BR_IF => {
                let depth = self.code.u32()?;
                self.pop(I32)?;
                let (_, kept) = self.label(depth)?;
                self.pop_result(kept)?;
                self.branch(depth)?;
                if let Some(kept) = kept {
                    self.push(Some(kept))?;
                }
            }
            BR_TABLE => self.branch_table()?,
            RETURN => {
                let result = self.scratch.blocks[0].result;
                self.pop_result(result)?;
                self.unreachable();
            }
            CALL => {
                let function = self.code.u32()? as usize;
                let Some(body) = self.tables.functions.get(function) else {
                    return self.fail(Reason::Index);
                };
                self.call(usize::from(body.ty))?;
            }
            CALL_INDIRECT => {
                let ty = self.code.u32()? as usize;
                if self.code.byte()? != 0 || !self.has_table || ty >= self.tables.types.len() {
                    return self.fail(Reason::Index);
                }
                self.pop(I32)?;
                self.call(ty)?;
            }
            DROP => {
                self.pop_any()?;
            }
            SELECT => {
                self.pop(I32)?;
                let (second, first) = (self.pop_any()?, self.pop_any()?);
                if first.is_some() && second.is_some() && first != second {
                    return self.fail(Reason::Operand);
                }
                self.push(first.or(second))?;
            }
            LOCAL_GET => {
                let ty = self.local()?;
                self.push(Some(ty))?;
            }
            LOCAL_SET => {
                let ty = self.local()?;
                self.pop(ty)?;
            }
            LOCAL_TEE => {
                let ty = self.local()?;
                self.op(&[ty], ty)?;
            }
            GLOBAL_GET | GLOBAL_SET => {
                let index = self.code.u32()? as usize;
                let Some(&global) = self.tables.globals.get(index) else {
                    return self.fail(Reason::Index);
                };
                if operator == GLOBAL_GET {
                    self.push(Some(global.ty))?;
                } else if global.is_mutable {
                    self.pop(global.ty)?;
                } else {
                    return self.fail(Reason::Immutable);
                }
            }
            I32_LOAD8_S | I32_LOAD8_U => self.load(I32, 0)?,
            I32_LOAD16_S | I32_LOAD16_U => self.load(I32, 1)?,
            I32_LOAD => self.load(I32, 2)?,
            I64_LOAD8_S | I64_LOAD8_U => self.load(I64, 0)?,
            I64_LOAD16_S | I64_LOAD16_U => self.load(I64, 1)?,
            I64_LOAD32_S | I64_LOAD32_U => self.load(I64, 2)?,
            I64_LOAD => self.load(I64, 3)?,
            F32_LOAD => self.load(F32, 2)?,
            F64_LOAD => self.load(F64, 3)?,
            I32_STORE8 => self.store(I32, 0)?,
            I32_STORE16 => self.store(I32, 1)?,
            I32_STORE => self.store(I32, 2)?,
            I64_STORE8 => self.store(I64, 0)?,
            I64_STORE16 => self.store(I64, 1)?,
            I64_STORE32 => self.store(I64, 2)?,
            I64_STORE => self.store(I64, 3)?,
            F32_STORE => self.store(F32, 2)?,
            F64_STORE => self.store(F64, 3)?,
            MEMORY_SIZE | MEMORY_GROW => {
                if self.code.byte()? != 0 || !self.tables.has_memory {
                    return self.fail(Reason::Index);
                }
                if operator == MEMORY_GROW {
                    self.pop(I32)?;
                }
                self.push(Some(I32))?;
            }
            I32_CONST => {
                self.code.signed(32)?;
                self.push(Some(I32))?;
            }
            I64_CONST => {
                self.code.signed(64)?;
                self.push(Some(I64))?;
            }
            F32_CONST => {
                self.code.skip(4)?;
                self.push(Some(F32))?;
            }
            F64_CONST => {
                self.code.skip(8)?;
                self.push(Some(F64))?;
            }
            _ => self.computes(operator)?,
        }
        Ok(())
    }

    fn computes(&mut self, operator: u8) -> Result<(), Invalid> {
        match operator {
            I32_EQZ => self.op(&[I32], I32),
            I32_EQ..=I32_GE_U => self.op(&[I32, I32], I32),
            I64_EQZ => self.op(&[I64], I32),
            I64_EQ..=I64_GE_U => self.op(&[I64, I64], I32),
            F32_EQ..=F32_GE => self.op(&[F32, F32], I32),
            F64_EQ..=F64_GE => self.op(&[F64, F64], I32),
            I32_CLZ..=I32_POPCNT => self.op(&[I32], I32),
            I32_ADD..=I32_ROTR => self.op(&[I32, I32], I32),
            I64_CLZ..=I64_POPCNT => self.op(&[I64], I64),
            I64_ADD..=I64_ROTR => self.op(&[I64, I64], I64),
            F32_ABS..=F32_SQRT => self.op(&[F32], F32),
            F32_ADD..=F32_COPYSIGN => self.op(&[F32, F32], F32),
            F64_ABS..=F64_SQRT => self.op(&[F64], F64),
            F64_ADD..=F64_COPYSIGN => self.op(&[F64, F64], F64),
            I32_WRAP_I64 => self.op(&[I64], I32),
            I32_TRUNC_F32_S | I32_TRUNC_F32_U | I32_REINTERPRET_F32 => self.op(&[F32], I32),
            I32_TRUNC_F64_S | I32_TRUNC_F64_U => self.op(&[F64], I32),
            I64_EXTEND_I32_S | I64_EXTEND_I32_U => self.op(&[I32], I64),
            I64_TRUNC_F32_S | I64_TRUNC_F32_U => self.op(&[F32], I64),
            I64_TRUNC_F64_S | I64_TRUNC_F64_U | I64_REINTERPRET_F64 => self.op(&[F64], I64),
            F32_CONVERT_I32_S | F32_CONVERT_I32_U | F32_REINTERPRET_I32 => self.op(&[I32], F32),
            F32_CONVERT_I64_S | F32_CONVERT_I64_U => self.op(&[I64], F32),
            F32_DEMOTE_F64 => self.op(&[F64], F32),
            F64_CONVERT_I32_S | F64_CONVERT_I32_U => self.op(&[I32], F64),
            F64_CONVERT_I64_S | F64_CONVERT_I64_U | F64_REINTERPRET_I64 => self.op(&[I64], F64),
            F64_PROMOTE_F32 => self.op(&[F32], F64),
            _ => self.fail(Reason::Operator),
        }
    }

    /// The branch that leads behind the other half is the last of the first half.
    fn otherwise(&mut self) -> Result<(), Invalid> {
        if self.block().kind != Kind::If {
            return self.fail(Reason::Else);
        }
        self.finish()?;
        let at = self.code.at() as u32;
        let Scratch { blocks, branches, .. } = &mut *self.scratch;
        let block = blocks.last_mut().expect("it is an if");
        let before = block.to_end.replace(branches.len() as u32).unwrap_or(NO_BRANCH);
        // The height stays as it is: what is kept lies right.
        branches.push(Branch::new(before, 0, 0, false));
        branches.close(block.to_else.take(), at);
        (block.kind, block.is_unreachable) = (Kind::Else, false);
        Ok(())
    }

    fn end(&mut self) -> Result<(), Invalid> {
        self.finish()?;
        let Scratch { blocks, branches, .. } = &mut *self.scratch;
        let block = blocks.pop().expect("it has just been finished");
        if block.kind == Kind::If && block.result.is_some() {
            return self.fail(Reason::Else);
        }
        // A branch out of the function goes to this `end`, which returns.
        let at = self.code.at() as u32 - u32::from(block.kind == Kind::Function);
        branches.close(block.to_end, at);
        branches.close(block.to_else, at);
        match block.result {
            Some(result) if block.kind != Kind::Function => self.push(Some(result)),
            _ => Ok(()),
        }
    }

    fn branch_table(&mut self) -> Result<(), Invalid> {
        self.pop(I32)?;
        let count = self.code.u32()?;
        let mut kept = None;
        for _ in 0..=u64::from(count) {
            let depth = self.code.u32()?;
            let (_, its) = self.label(depth)?;
            if kept.is_some_and(|kept| kept != its) {
                return self.fail(Reason::Operand);
            }
            kept = Some(its);
            self.branch(depth)?;
        }
        self.pop_result(kept.flatten())?;
        self.unreachable();
        Ok(())
    }
}
