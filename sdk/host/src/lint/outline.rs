//! The parts of a module that the rules look at, gathered in one pass.

use softplug_abi::MANIFEST_SECTION;
use wasmparser::{
    CompositeInnerType, DataKind, ExternalKind, FuncType, MemoryType, Operator, Parser, Payload,
    Result, TypeRef, WasmFeatures,
};

/// Imports that a message names.
const IMPORTS_NAMED: usize = 8;

/// What a module declares. Its counts are within the [bounds](super::bounds).
#[derive(Default)]
pub(super) struct Outline<'a> {
    pub(super) import_count: usize,
    /// The first of them, as `module.name`.
    pub(super) imports: Vec<String>,
    pub(super) exports: Vec<(String, Export)>,
    pub(super) memories: Vec<MemoryType>,
    pub(super) has_start: bool,
    pub(super) manifests: Vec<&'a [u8]>,
    /// Where the data ends that the memory begins with.
    pub(super) data_end: u64,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Export {
    Function(Signature),
    Table,
    Memory,
    ImmutableGlobal,
    MutableGlobal,
    Tag,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Signature {
    pub(super) parameters: Vec<String>,
    pub(super) results: Vec<String>,
}

/// The index spaces that exports point into.
#[derive(Default)]
struct Spaces {
    types: Vec<Option<FuncType>>,
    functions: Vec<u32>,
    globals_mutable: Vec<bool>,
}

impl<'a> Outline<'a> {
    pub(super) fn read(wasm: &'a [u8]) -> Result<Self> {
        let mut outline = Self::default();
        let mut spaces = Spaces::default();
        let mut parser = Parser::new(0);
        parser.set_features(WasmFeatures::all());
        for payload in parser.parse_all(wasm) {
            outline.take(payload?, &mut spaces)?;
        }
        Ok(outline)
    }

    fn take(&mut self, payload: Payload<'a>, spaces: &mut Spaces) -> Result<()> {
        match payload {
            Payload::TypeSection(section) => {
                for group in section {
                    for ty in group?.into_types() {
                        spaces.types.push(match ty.composite_type.inner {
                            CompositeInnerType::Func(signature) => Some(signature),
                            _ => None,
                        });
                    }
                }
            }
            Payload::ImportSection(section) => {
                for import in section.into_imports() {
                    let import = import?;
                    self.import_count += 1;
                    if self.imports.len() < IMPORTS_NAMED {
                        let name = format!("{}.{}", import.module, import.name);
                        self.imports.push(crate::words::printable(name.as_bytes()));
                    }
                    match import.ty {
                        TypeRef::Func(ty) | TypeRef::FuncExact(ty) => spaces.functions.push(ty),
                        TypeRef::Global(ty) => spaces.globals_mutable.push(ty.mutable),
                        TypeRef::Memory(ty) => self.memories.push(ty),
                        TypeRef::Table(_) | TypeRef::Tag(_) => {}
                    }
                }
            }
            Payload::FunctionSection(section) => {
                for ty in section {
                    spaces.functions.push(ty?);
                }
            }
            Payload::MemorySection(section) => {
                for memory in section {
                    self.memories.push(memory?);
                }
            }
            Payload::GlobalSection(section) => {
                for global in section {
                    spaces.globals_mutable.push(global?.ty.mutable);
                }
            }
            Payload::DataSection(section) => {
                for data in section {
                    let data = data?;
                    if let DataKind::Active { offset_expr, .. } = data.kind
                        && let Operator::I32Const { value } =
                            offset_expr.get_operators_reader().read()?
                    {
                        let end = u64::from(value as u32) + data.data.len() as u64;
                        self.data_end = self.data_end.max(end);
                    }
                }
            }
            Payload::ExportSection(section) => {
                for export in section {
                    let export = export?;
                    let kind = spaces.export(export.kind, export.index);
                    self.exports.push((export.name.to_owned(), kind));
                }
            }
            Payload::StartSection { .. } => self.has_start = true,
            Payload::CustomSection(section) if section.name() == MANIFEST_SECTION => {
                self.manifests.push(section.data());
            }
            _ => {}
        }
        Ok(())
    }
}

impl Spaces {
    fn export(&self, kind: ExternalKind, index: u32) -> Export {
        let index = index as usize;
        match kind {
            ExternalKind::Func | ExternalKind::FuncExact => Export::Function(self.signature(index)),
            ExternalKind::Table => Export::Table,
            ExternalKind::Memory => Export::Memory,
            ExternalKind::Global if self.globals_mutable.get(index) == Some(&false) => {
                Export::ImmutableGlobal
            }
            ExternalKind::Global => Export::MutableGlobal,
            ExternalKind::Tag => Export::Tag,
        }
    }

    fn signature(&self, function: usize) -> Signature {
        let ty = self.functions.get(function).and_then(|ty| self.types.get(*ty as usize));
        let names = |types: &[wasmparser::ValType]| types.iter().map(ToString::to_string).collect();
        match ty {
            Some(Some(ty)) => {
                Signature { parameters: names(ty.params()), results: names(ty.results()) }
            }
            _ => Signature { parameters: Vec::new(), results: Vec::new() },
        }
    }
}
