//! The parts of a module that the rules look at, gathered in one pass.

use softplug_abi::MANIFEST_SECTION;
use wasmparser::{
    CompositeInnerType, ElementItems, ExternalKind, FuncType, MemoryType, Parser, Payload, Result,
    TypeRef, WasmFeatures,
};

/// What a module declares.
#[derive(Default)]
pub(super) struct Outline<'a> {
    /// As `module.name`.
    pub(super) imports: Vec<String>,
    pub(super) exports: Vec<(String, Export)>,
    pub(super) memories: Vec<MemoryType>,
    pub(super) has_start: bool,
    /// The largest of: elements of a table, items of all element segments.
    pub(super) elements: u64,
    pub(super) globals: u64,
    /// Parameters and locals of all functions.
    pub(super) locals: u64,
    pub(super) manifests: Vec<&'a [u8]>,
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
                    let name = format!("{}.{}", import.module, import.name);
                    self.imports.push(crate::words::printable(name.as_bytes()));
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
                    let ty = ty?;
                    spaces.functions.push(ty);
                    let signature = spaces.types.get(ty as usize).and_then(Option::as_ref);
                    self.locals += signature.map_or(0, |signature| signature.params().len() as u64);
                }
            }
            Payload::TableSection(section) => {
                for table in section {
                    self.elements = self.elements.max(table?.ty.initial);
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
                    self.globals += 1;
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
            Payload::ElementSection(section) => {
                let mut items = 0;
                for element in section {
                    items += match element?.items {
                        ElementItems::Functions(items) => u64::from(items.count()),
                        ElementItems::Expressions(_, items) => u64::from(items.count()),
                    };
                }
                self.elements = self.elements.max(items);
            }
            Payload::CodeSectionEntry(body) => {
                for locals in body.get_locals_reader()? {
                    self.locals += u64::from(locals?.0);
                }
            }
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
