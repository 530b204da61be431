//! A module whose state can be read and written: its globals are exported.

use crate::ExploreError;
use std::convert::Infallible;
use std::ops::Range;
use wasm_encoder::reencode::{Error, Reencode, utils};
use wasm_encoder::{ExportKind, ExportSection, Module};
use wasmparser::{DataKind, ExternalKind, Operator, Parser, Payload, ValType};

/// A module with the globals that can change as exports.
#[derive(Debug)]
pub(crate) struct Opened {
    pub(crate) wasm: Vec<u8>,
    /// The names of the exports.
    pub(crate) globals: Vec<String>,
    pub(crate) stack: Option<Stack>,
}

/// The stack in memory, of which nothing is alive between two events.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Stack {
    /// Place of its pointer in the globals.
    pub(crate) pointer: usize,
    /// It grows down from the end.
    pub(crate) range: Range<usize>,
}

/// Opens a module that the lint has let through. What it exports under the names of `marks` is no
/// part of its state.
pub(crate) fn opened(module: &[u8], marks: &[String]) -> Result<Opened, ExploreError> {
    let unreadable = |reason: String| ExploreError::Module { reason };
    let globals = changing(module, marks).map_err(|error| unreadable(error.to_string()))?;
    if let Some(other) = globals.iter().find(|global| !global.is_integer) {
        let reason = format!("global {} changes and is no integer", other.index);
        return Err(ExploreError::Module { reason });
    }
    let stack = stack(module, &globals).map_err(|error| unreadable(error.to_string()))?;
    let mut writer = Writer { globals: &globals };
    let mut written = Module::new();
    writer
        .parse_core_module(&mut written, Parser::new(0), module)
        .map_err(|error| unreadable(error.to_string()))?;
    let globals = globals.iter().map(Global::name).collect();
    Ok(Opened { wasm: written.finish(), globals, stack })
}

/// A global that can change.
struct Global {
    index: u32,
    is_integer: bool,
    /// Of one of 32 bits that begins as a constant.
    initial: Option<i32>,
}

impl Global {
    /// No export of a plug-in has a dot in its name.
    fn name(&self) -> String {
        format!("softplug.global.{}", self.index)
    }
}

fn changing(module: &[u8], marks: &[String]) -> Result<Vec<Global>, wasmparser::BinaryReaderError> {
    let mut globals = Vec::new();
    for payload in Parser::new(0).parse_all(module) {
        let section = match payload? {
            Payload::GlobalSection(section) => section,
            // It stands behind the globals.
            Payload::ExportSection(section) if !marks.is_empty() => {
                for export in section {
                    let export = export?;
                    if export.kind == ExternalKind::Global
                        && marks.iter().any(|mark| mark == export.name)
                    {
                        globals.retain(|global: &Global| global.index != export.index);
                    }
                }
                continue;
            }
            _ => continue,
        };
        for (index, global) in section.into_iter().enumerate() {
            let global = global?;
            if global.ty.mutable {
                let initial = match global.init_expr.get_operators_reader().read()? {
                    Operator::I32Const { value } => Some(value),
                    _ => None,
                };
                let is_integer = matches!(global.ty.content_type, ValType::I32 | ValType::I64);
                globals.push(Global { index: index as u32, is_integer, initial });
            }
        }
    }
    Ok(globals)
}

/// The stack, where it lies below all data: linkers put it first so that its overflow traps. The
/// first global is its pointer.
fn stack(
    module: &[u8],
    globals: &[Global],
) -> Result<Option<Stack>, wasmparser::BinaryReaderError> {
    let pointer = globals.iter().position(|global| global.index == 0);
    let end = pointer.and_then(|at| globals[at].initial).and_then(|end| usize::try_from(end).ok());
    let (Some(pointer), Some(end)) = (pointer, end.filter(|end| *end > 0)) else {
        return Ok(None);
    };
    let mut has_data = false;
    for payload in Parser::new(0).parse_all(module) {
        let Payload::DataSection(section) = payload? else { continue };
        for data in section {
            let DataKind::Active { offset_expr, .. } = data?.kind else { return Ok(None) };
            let Operator::I32Const { value } = offset_expr.get_operators_reader().read()? else {
                return Ok(None);
            };
            if (value as u32 as usize) < end {
                return Ok(None);
            }
            has_data = true;
        }
    }
    Ok(has_data.then_some(Stack { pointer, range: 0..end }))
}

struct Writer<'a> {
    globals: &'a [Global],
}

impl Reencode for Writer<'_> {
    type Error = Infallible;

    fn parse_export_section(
        &mut self,
        exports: &mut ExportSection,
        section: wasmparser::ExportSectionReader<'_>,
    ) -> Result<(), Error> {
        utils::parse_export_section(self, exports, section)?;
        for global in self.globals {
            exports.export(&global.name(), ExportKind::Global, global.index);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened_text(text: &str) -> Opened {
        opened(&wat::parse_str(text).unwrap(), &[]).unwrap()
    }

    #[test]
    fn a_stack_below_all_data_is_found() {
        let opened = opened_text(
            r#"(module
                (memory (export "memory") 1)
                (global (mut i32) (i32.const 4096))
                (global i32 (i32.const 7))
                (global (mut i64) (i64.const 1))
                (data (i32.const 4096) "x"))"#,
        );
        assert_eq!(opened.globals, ["softplug.global.0", "softplug.global.2"]);
        assert_eq!(opened.stack, Some(Stack { pointer: 0, range: 0..4_096 }));
    }

    #[test]
    fn a_first_global_that_begins_at_0_points_to_no_stack() {
        let opened = opened_text(
            r#"(module
                (memory (export "memory") 1)
                (global (mut i32) (i32.const 0))
                (data (i32.const 16) "x"))"#,
        );
        assert_eq!(opened.stack, None);
    }

    #[test]
    fn a_stack_behind_data_may_be_anything() {
        let opened = opened_text(
            r#"(module
                (memory (export "memory") 1)
                (global (mut i32) (i32.const 4096))
                (data (i32.const 1024) "x"))"#,
        );
        assert_eq!(opened.stack, None);
    }

    #[test]
    fn marks_are_no_part_of_a_state() {
        let module = wat::parse_str(
            r#"(module
                (memory (export "memory") 1)
                (global (mut i32) (i32.const 4096))
                (global (mut i64) (i64.const 0))
                (global (mut i64) (i64.const 0))
                (export "mark" (global 1)))"#,
        );
        let opened = opened(&module.unwrap(), &["mark".to_owned()]).unwrap();
        assert_eq!(opened.globals, ["softplug.global.0", "softplug.global.2"]);
    }

    #[test]
    fn globals_of_another_kind_are_refused() {
        let module = wat::parse_str(
            r#"(module (memory (export "memory") 1) (global (mut f32) (f32.const 0)))"#,
        );
        assert!(matches!(opened(&module.unwrap(), &[]), Err(ExploreError::Module { .. })));
    }
}
