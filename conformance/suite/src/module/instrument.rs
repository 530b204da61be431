//! A module with a bit for each block and each way of a branch, set when it is executed.

use super::flow::{Branch, BranchKind, Flow};
use std::convert::Infallible;
use wasm_encoder::reencode::{Error, Reencode, utils};
use wasm_encoder::{
    CodeSection, ConstExpr, ExportKind, ExportSection, Function, GlobalSection, GlobalType,
    Instruction, Module, SectionId, ValType,
};
use wasmparser::{CompositeInnerType, FunctionBody, Parser, Payload};

/// Bits in a counter.
const WORD: usize = u64::BITS as usize;

/// Where the bits are.
#[derive(Debug, Default)]
pub(super) struct Layout {
    /// Of each function, of each block.
    pub(super) blocks: Vec<Vec<usize>>,
    /// Of each function, of each branch: the first way's; the others follow. Ways of a
    /// table behind the last bit share it.
    pub(super) branches: Vec<Vec<usize>>,
    bits: usize,
    /// In the names of the globals.
    mark: String,
}

impl Layout {
    pub(super) fn of(flows: &[Flow]) -> Self {
        let mut layout = Self::default();
        for flow in flows {
            let blocks = flow.blocks.iter().map(|_| layout.take(1)).collect();
            let branches = flow.branches.iter().map(|branch| layout.take(bits_of(branch)));
            let branches = branches.collect();
            layout.blocks.push(blocks);
            layout.branches.push(branches);
        }
        layout
    }

    /// All in one word.
    fn take(&mut self, bits: usize) -> usize {
        if self.bits % WORD + bits > WORD {
            self.bits = self.bits.next_multiple_of(WORD);
        }
        self.bits += bits;
        self.bits - bits
    }

    pub(super) fn words(&self) -> usize {
        self.bits.div_ceil(WORD)
    }

    /// The name of the global that is the word of this number.
    pub(super) fn name_of(&self, word: usize) -> String {
        format!("softplug.executed{}.{word}", self.mark)
    }

    /// Changes the names until none is that of a module's own export.
    pub(super) fn avoid(&mut self, exports: &[&str]) {
        let is_taken = |layout: &Self| {
            (0..layout.words()).any(|word| exports.contains(&&*layout.name_of(word)))
        };
        while is_taken(self) {
            self.mark.push('+');
        }
    }
}

/// Bits for the ways of a branch.
pub(super) fn bits_of(branch: &Branch) -> usize {
    branch.ways.len().min(WORD)
}

/// The module with its bits. Its custom sections are left out.
pub(super) fn instrumented(
    module: &[u8],
    flows: &[Flow],
    layout: &Layout,
) -> Result<Vec<u8>, Error> {
    let mut writer =
        Writer { flows, layout, parameters: Vec::new(), globals: 0, has_globals: false, next: 0 };
    let mut types = Vec::new();
    for payload in Parser::new(0).parse_all(module) {
        match payload? {
            Payload::TypeSection(section) => {
                for group in section {
                    types.extend(group?.into_types().map(|kind| match kind.composite_type.inner {
                        CompositeInnerType::Func(function) => function.params().len() as u32,
                        _ => 0,
                    }));
                }
            }
            Payload::FunctionSection(section) => {
                for kind in section {
                    let parameters = types.get(kind? as usize).copied().unwrap_or(0);
                    writer.parameters.push(parameters);
                }
            }
            Payload::GlobalSection(section) => writer.globals = section.count(),
            _ => {}
        }
    }
    let mut written = Module::new();
    writer.parse_core_module(&mut written, Parser::new(0), module)?;
    Ok(written.finish())
}

struct Writer<'a> {
    flows: &'a [Flow],
    layout: &'a Layout,
    /// Of each function, how many it has.
    parameters: Vec<u32>,
    /// The module's own.
    globals: u32,
    has_globals: bool,
    /// The function that comes next.
    next: usize,
}

impl Writer<'_> {
    fn add_globals(&mut self, section: &mut GlobalSection) {
        self.has_globals = true;
        for _ in 0..self.layout.words() {
            let kind = GlobalType { val_type: ValType::I64, mutable: true, shared: false };
            section.global(kind, &ConstExpr::i64_const(0));
        }
    }

    /// Sets a bit.
    fn mark(&self, function: &mut Function, bit: usize) {
        function.instruction(&Instruction::I64Const(mask(bit)));
        self.add(function, bit);
    }

    /// Adds what is on top of the stack to the word of this bit.
    fn add(&self, function: &mut Function, bit: usize) {
        let word = self.globals + (bit / WORD) as u32;
        function
            .instruction(&Instruction::GlobalGet(word))
            .instruction(&Instruction::I64Or)
            .instruction(&Instruction::GlobalSet(word));
    }

    /// Sets the bit of the way that the branch goes, by what is on top of the stack, and
    /// leaves that there.
    fn mark_way(&self, function: &mut Function, branch: &Branch, first: usize, local: u32) {
        function.instruction(&Instruction::LocalSet(local));
        if branch.kind == BranchKind::BrTable {
            let last = bits_of(branch) as i32 - 1;
            function
                .instruction(&Instruction::I64Const(mask(first)))
                .instruction(&Instruction::LocalGet(local))
                .instruction(&Instruction::I32Const(last))
                .instruction(&Instruction::LocalGet(local))
                .instruction(&Instruction::I32Const(last))
                .instruction(&Instruction::I32LtU)
                .instruction(&Instruction::Select)
                .instruction(&Instruction::I64ExtendI32U)
                .instruction(&Instruction::I64Shl);
        } else {
            function
                .instruction(&Instruction::I64Const(mask(first)))
                .instruction(&Instruction::I64Const(mask(first + 1)))
                .instruction(&Instruction::LocalGet(local))
                .instruction(&Instruction::Select);
        }
        self.add(function, first);
        function.instruction(&Instruction::LocalGet(local));
    }
}

fn mask(bit: usize) -> i64 {
    (1_u64 << (bit % WORD)).cast_signed()
}

impl Reencode for Writer<'_> {
    type Error = Infallible;

    fn intersperse_section_hook(
        &mut self,
        module: &mut Module,
        _: Option<SectionId>,
        before: Option<SectionId>,
    ) -> Result<(), Error> {
        let is_behind = matches!(
            before,
            Some(SectionId::Export | SectionId::Element | SectionId::Code | SectionId::Data)
        );
        if is_behind && !self.has_globals {
            let mut section = GlobalSection::new();
            self.add_globals(&mut section);
            module.section(&section);
        }
        Ok(())
    }

    fn parse_global_section(
        &mut self,
        globals: &mut GlobalSection,
        section: wasmparser::GlobalSectionReader<'_>,
    ) -> Result<(), Error> {
        utils::parse_global_section(self, globals, section)?;
        self.add_globals(globals);
        Ok(())
    }

    fn parse_export_section(
        &mut self,
        exports: &mut ExportSection,
        section: wasmparser::ExportSectionReader<'_>,
    ) -> Result<(), Error> {
        utils::parse_export_section(self, exports, section)?;
        for word in 0..self.layout.words() {
            exports.export(
                &self.layout.name_of(word),
                ExportKind::Global,
                self.globals + word as u32,
            );
        }
        Ok(())
    }

    fn parse_custom_section(
        &mut self,
        _: &mut Module,
        _: wasmparser::CustomSectionReader<'_>,
    ) -> Result<(), Error> {
        Ok(())
    }

    fn parse_function_body(
        &mut self,
        code: &mut CodeSection,
        body: FunctionBody<'_>,
    ) -> Result<(), Error> {
        let number = self.next;
        self.next += 1;
        let (flow, blocks) = (&self.flows[number], &self.layout.blocks[number]);
        let mut branches = flow.branches.iter().zip(&self.layout.branches[number]).peekable();
        let mut locals = Vec::new();
        let mut local = self.parameters[number];
        for group in body.get_locals_reader()? {
            let (count, kind) = group?;
            local += count;
            locals.push((count, self.val_type(kind)?));
        }
        locals.push((1, ValType::I32));
        let mut function = Function::new(locals);
        let mut blocks = flow.blocks.iter().zip(blocks).peekable();
        let mut operators = body.get_operators_reader()?;
        while !operators.eof() {
            let at = operators.original_position();
            if let Some((_, bit)) = blocks.next_if(|(block, _)| block.at == at) {
                self.mark(&mut function, *bit);
            }
            if let Some((branch, first)) = branches.next_if(|(branch, _)| branch.at == at) {
                self.mark_way(&mut function, branch, *first, local);
            }
            function.instruction(&self.parse_instruction(&mut operators)?);
        }
        code.function(&function);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_global_is_named_like_an_export_of_the_module() {
        let mut layout = Layout { bits: 3 * WORD, ..Layout::default() };
        layout.avoid(&["softplug.executed.3", "memory"]);
        assert_eq!(layout.name_of(0), "softplug.executed.0");
        layout.avoid(&["softplug.executed.2", "softplug.executed+.0"]);
        assert_eq!(layout.name_of(0), "softplug.executed++.0");
    }
}
