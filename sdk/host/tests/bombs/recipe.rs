//! Modules that are small and take long to compile: each made from a recipe, a few numbers that a
//! search can turn.

use std::fmt;
use std::str::FromStr;

use wasm_encoder::{
    BlockType, CodeSection, ConstExpr, CustomSection, ElementSection, Elements, ExportKind,
    ExportSection, Function, FunctionSection, GlobalSection, GlobalType, Instruction as I, MemArg,
    MemorySection, MemoryType, Module, RefType, TableSection, TableType, TypeSection, ValType,
};

const MANIFEST: &str = r#"{"abi":"1.0","name":"bomb","version":"9.0.0","description":"Takes long to compile.","protocol":"none","licence":"MIT OR Apache-2.0"}"#;

/// What the innermost code of a function is made of.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Piece {
    /// Copies a local into another.
    Copy,
    /// Adds two locals into a third.
    Add,
    /// Adds the results of short expressions, to a tree.
    Tree,
    /// Takes one of two locals.
    Select,
    /// Float to integer and back: checks and traps.
    Convert,
    /// Division of 64 bits.
    Divide,
    /// Rounds a float.
    Round,
    /// Counts bits.
    Count,
    /// Loads and stores at far offsets.
    Memory,
    /// Reads and writes a global.
    Global,
    /// Sets a local in one of two branches.
    If,
    /// Sets a local and may leave a block around it.
    Join,
    /// Sets a local and may leave all loops.
    Leave,
    /// Sets a local and may begin the innermost loop again.
    Again,
    /// A table of jumps to all blocks around.
    Table,
    /// Calls a function.
    Call,
    /// Calls through the table.
    Indirect,
    /// Asks for more memory.
    Grow,
    /// An empty loop.
    Loop,
}

const PIECES: [(Piece, &str); 19] = [
    (Piece::Copy, "copy"),
    (Piece::Add, "add"),
    (Piece::Tree, "tree"),
    (Piece::Select, "select"),
    (Piece::Convert, "convert"),
    (Piece::Divide, "divide"),
    (Piece::Round, "round"),
    (Piece::Count, "count"),
    (Piece::Memory, "memory"),
    (Piece::Global, "global"),
    (Piece::If, "if"),
    (Piece::Join, "join"),
    (Piece::Leave, "leave"),
    (Piece::Again, "again"),
    (Piece::Table, "table"),
    (Piece::Call, "call"),
    (Piece::Indirect, "indirect"),
    (Piece::Grow, "grow"),
    (Piece::Loop, "loop"),
];

impl Piece {
    pub(crate) const ALL: [Self; 19] = {
        let mut all = [Self::Copy; 19];
        let mut at = 0;
        while at < all.len() {
            all[at] = PIECES[at].0;
            at += 1;
        }
        all
    };
}

/// How a bomb is made.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Recipe {
    /// Functions of this kind.
    pub(crate) functions: u32,
    /// Parameters of each.
    pub(crate) parameters: u32,
    /// Locals of each.
    pub(crate) locals: u32,
    /// Values that lie on the operand stack around all that follows.
    pub(crate) stack: u32,
    /// Loops within loops.
    pub(crate) loops: u32,
    /// Blocks within blocks, in the innermost loop.
    pub(crate) blocks: u32,
    /// How often the pieces stand there.
    pub(crate) times: u32,
    /// The pieces, one after the other.
    pub(crate) pieces: [Piece; 2],
    /// Entries of a table of jumps.
    pub(crate) targets: u32,
}

impl fmt::Display for Recipe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |piece| PIECES.iter().find(|known| known.0 == piece).map_or("", |known| known.1);
        write!(
            f,
            "{} {} {} {} {} {} {} {} {} {}",
            self.functions,
            self.parameters,
            self.locals,
            self.stack,
            self.loops,
            self.blocks,
            self.times,
            name(self.pieces[0]),
            name(self.pieces[1]),
            self.targets
        )
    }
}

impl FromStr for Recipe {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let words: Vec<_> = text.split_whitespace().collect();
        let [functions, parameters, locals, stack, loops, blocks, times, one, two, targets] =
            words[..]
        else {
            return Err(format!("\"{text}\" has not ten words"));
        };
        let number = |word: &str| word.parse().map_err(|_| format!("\"{word}\" is no number"));
        let piece = |word: &str| {
            let known = PIECES.iter().find(|known| known.1 == word);
            known.map(|known| known.0).ok_or_else(|| format!("\"{word}\" is no piece"))
        };
        Ok(Self {
            functions: number(functions)?,
            parameters: number(parameters)?,
            locals: number(locals)?,
            stack: number(stack)?,
            loops: number(loops)?,
            blocks: number(blocks)?,
            times: number(times)?,
            pieces: [piece(one)?, piece(two)?],
            targets: number(targets)?,
        })
    }
}

impl Recipe {
    /// Whether it is worth making: no larger than any bound by far.
    pub(crate) fn is_small(&self) -> bool {
        let of_one = u64::from(self.stack)
            + u64::from(self.loops)
            + u64::from(self.blocks)
            + u64::from(self.times) * (4 + u64::from(self.targets));
        self.functions > 0
            && u64::from(self.functions) * (4 + of_one) < 1_000_000
            && self.locals < 100_000
            && self.parameters <= 1_000
    }

    /// The module, with all that the ABI asks for but a mailbox.
    pub(crate) fn module(&self) -> Vec<u8> {
        self.module_of("bomb")
    }

    /// The module of a plug-in of this name.
    pub(crate) fn module_of(&self, plugin: &str) -> Vec<u8> {
        let mut types = TypeSection::new();
        types.ty().function([], [ValType::I32]);
        types.ty().function([ValType::I32, ValType::I32, ValType::I64], [ValType::I32]);
        types.ty().function(vec![ValType::I32; self.parameters as usize], []);
        let mut functions = FunctionSection::new();
        functions.function(0);
        functions.function(1);
        for _ in 0..self.functions {
            functions.function(2);
        }
        let mut tables = TableSection::new();
        tables.table(TableType {
            element_type: RefType::FUNCREF,
            table64: false,
            minimum: 1,
            maximum: Some(1),
            shared: false,
        });
        let mut memories = MemorySection::new();
        memories.memory(MemoryType {
            minimum: 1,
            maximum: Some(1),
            memory64: false,
            shared: false,
            page_size_log2: None,
        });
        let mut globals = GlobalSection::new();
        globals.global(
            GlobalType { val_type: ValType::I32, mutable: true, shared: false },
            &ConstExpr::i32_const(0),
        );
        let mut exports = ExportSection::new();
        exports.export("memory", ExportKind::Memory, 0);
        exports.export("softplug_v1", ExportKind::Func, 0);
        exports.export("softplug_v1_step", ExportKind::Func, 1);
        let mut elements = ElementSection::new();
        let first = if self.functions == 0 { 0 } else { 2 };
        elements.active(None, &ConstExpr::i32_const(0), Elements::Functions([first][..].into()));
        let mut code = CodeSection::new();
        for _ in 0..2 {
            let mut function = Function::new([]);
            function.instruction(&I::I32Const(0)).instruction(&I::End);
            code.function(&function);
        }
        for at in 0..self.functions {
            code.function(&self.function(at));
        }
        let mut module = Module::new();
        module.section(&types).section(&functions).section(&tables).section(&memories);
        module.section(&globals).section(&exports).section(&elements).section(&code);
        let manifest = MANIFEST.replace("\"bomb\"", &format!("\"{plugin}\""));
        let name = "softplug.manifest".into();
        module.section(&CustomSection { name, data: manifest.as_bytes().into() });
        module.finish()
    }

    /// Locals and parameters; there is one at least.
    fn variables(&self) -> u32 {
        self.parameters + self.locals.max(1)
    }

    fn function(&self, at: u32) -> Function {
        let mut function = Function::new([(self.locals.max(1), ValType::I32)]);
        for nth in 0..self.stack {
            function.instruction(&I::LocalGet(nth % self.variables()));
        }
        for _ in 0..self.loops {
            function.instruction(&I::Loop(BlockType::Empty));
        }
        for _ in 0..self.blocks {
            function.instruction(&I::Block(BlockType::Empty));
        }
        let mut next = at;
        for _ in 0..self.times {
            for piece in self.pieces {
                self.piece(piece, &mut next, &mut function);
            }
        }
        for _ in 0..self.blocks {
            function.instruction(&I::End);
        }
        for _ in 0..self.loops {
            // A loop that is never begun again would be none.
            next += 1;
            function.instruction(&I::LocalGet(next % self.variables()));
            function.instruction(&I::BrIf(0)).instruction(&I::End);
        }
        for _ in 0..self.stack {
            function.instruction(&I::GlobalSet(0));
        }
        for nth in 0..self.variables().min(self.times) {
            function.instruction(&I::LocalGet(nth)).instruction(&I::GlobalSet(0));
        }
        function.instruction(&I::End);
        function
    }

    fn piece(&self, piece: Piece, next: &mut u32, f: &mut Function) {
        let count = self.variables();
        let mut local = || {
            *next = next.wrapping_add(1);
            *next % count
        };
        let far = MemArg { offset: 60_000, align: 0, memory_index: 0 };
        let depth = self.loops + self.blocks;
        match piece {
            Piece::Copy => {
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalSet(local()));
            }
            Piece::Add => {
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalGet(local()));
                f.instruction(&I::I32Add).instruction(&I::LocalSet(local()));
            }
            Piece::Tree => {
                let to = local();
                f.instruction(&I::LocalGet(to)).instruction(&I::LocalGet(to));
                f.instruction(&I::I32Xor).instruction(&I::LocalGet(local()));
                f.instruction(&I::I32Mul).instruction(&I::LocalTee(to));
                f.instruction(&I::LocalGet(to)).instruction(&I::I32Add);
                f.instruction(&I::LocalSet(to));
            }
            Piece::Select => {
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalGet(local()));
                f.instruction(&I::LocalGet(local())).instruction(&I::Select);
                f.instruction(&I::LocalSet(local()));
            }
            Piece::Convert => {
                let to = local();
                f.instruction(&I::LocalGet(to));
                for _ in 0..8 {
                    f.instruction(&I::F64ConvertI32S).instruction(&I::I32TruncF64S);
                }
                f.instruction(&I::LocalSet(to));
            }
            Piece::Divide => {
                let to = local();
                f.instruction(&I::LocalGet(to)).instruction(&I::I64ExtendI32U);
                for _ in 0..4 {
                    f.instruction(&I::LocalGet(to)).instruction(&I::I64ExtendI32S);
                    f.instruction(&I::I64RemS);
                }
                f.instruction(&I::I32WrapI64).instruction(&I::LocalSet(to));
            }
            Piece::Round => {
                let to = local();
                f.instruction(&I::LocalGet(to)).instruction(&I::F64ConvertI32U);
                for _ in 0..4 {
                    f.instruction(&I::F64Nearest).instruction(&I::F64Sqrt);
                }
                f.instruction(&I::I32TruncF64U).instruction(&I::LocalSet(to));
            }
            Piece::Count => {
                let to = local();
                f.instruction(&I::LocalGet(to));
                for _ in 0..4 {
                    f.instruction(&I::I32Popcnt).instruction(&I::I32Ctz);
                }
                f.instruction(&I::LocalSet(to));
            }
            Piece::Memory => {
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalGet(local()));
                f.instruction(&I::I32Load(far)).instruction(&I::I32Store(far));
            }
            Piece::Global => {
                f.instruction(&I::GlobalGet(0)).instruction(&I::LocalSet(local()));
                f.instruction(&I::LocalGet(local())).instruction(&I::GlobalSet(0));
            }
            Piece::If => {
                f.instruction(&I::LocalGet(local())).instruction(&I::If(BlockType::Empty));
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalSet(local()));
                f.instruction(&I::Else).instruction(&I::LocalGet(local()));
                f.instruction(&I::LocalSet(local())).instruction(&I::End);
            }
            Piece::Join => {
                f.instruction(&I::Block(BlockType::Empty)).instruction(&I::LocalGet(local()));
                f.instruction(&I::LocalTee(local())).instruction(&I::BrIf(0));
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalSet(local()));
                f.instruction(&I::End);
            }
            Piece::Leave => {
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalTee(local()));
                f.instruction(&I::BrIf(depth));
            }
            Piece::Again => {
                f.instruction(&I::LocalGet(local())).instruction(&I::LocalTee(local()));
                f.instruction(&I::BrIf(self.blocks));
            }
            Piece::Table => {
                f.instruction(&I::Block(BlockType::Empty)).instruction(&I::LocalGet(local()));
                let targets: Vec<_> = (0..self.targets).map(|at| at % (depth + 1)).collect();
                f.instruction(&I::BrTable(targets.into(), 0)).instruction(&I::End);
            }
            Piece::Call | Piece::Indirect => {
                for _ in 0..self.parameters {
                    f.instruction(&I::LocalGet(local()));
                }
                if piece == Piece::Call {
                    f.instruction(&I::Call(2));
                } else {
                    f.instruction(&I::I32Const(0));
                    f.instruction(&I::CallIndirect { type_index: 2, table_index: 0 });
                }
            }
            Piece::Grow => {
                f.instruction(&I::LocalGet(local())).instruction(&I::MemoryGrow(0));
                f.instruction(&I::LocalSet(local()));
            }
            Piece::Loop => {
                f.instruction(&I::Loop(BlockType::Empty)).instruction(&I::LocalGet(local()));
                f.instruction(&I::BrIf(0)).instruction(&I::End);
            }
        }
    }
}
