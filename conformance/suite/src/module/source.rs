//! Source lines of a module's instructions, where it has debug information.

use addr2line::Context;
use addr2line::gimli::{Dwarf, EndianSlice, Error, LittleEndian, SectionId};
use std::collections::BTreeMap;
use wasmparser::{Parser, Payload};

/// Most characters of a file's name that are told.
const NAME: usize = 120;

/// Where the instructions of a module come from.
pub(crate) struct Source<'a> {
    /// Knows addresses: bytes from the code section's contents on.
    context: Context<EndianSlice<'a, LittleEndian>>,
    code: usize,
}

impl<'a> Source<'a> {
    /// `None`: the module has no debug information, or none that can be read.
    pub(crate) fn of(module: &'a [u8]) -> Option<Self> {
        let (mut code, mut sections) = (None, BTreeMap::new());
        for payload in Parser::new(0).parse_all(module) {
            match payload.ok()? {
                Payload::CodeSectionStart { range, .. } => code = Some(range.start),
                Payload::CustomSection(section) => {
                    sections.insert(section.name(), section.data());
                }
                _ => {}
            }
        }
        sections.get(SectionId::DebugLine.name())?;
        let section = |id: SectionId| {
            let data = sections.get(id.name()).copied().unwrap_or_default();
            Ok::<_, Error>(EndianSlice::new(data, LittleEndian))
        };
        let context = Context::from_dwarf(Dwarf::load(section).ok()?).ok()?;
        Some(Self { context, code: code? })
    }

    /// File and line of the instruction at this place of the module.
    pub(crate) fn line(&self, at: usize) -> Option<String> {
        let address = at.checked_sub(self.code)? as u64;
        let location = self.context.find_location(address).ok()??;
        Some(format!("{}:{}", short(location.file?), location.line?))
    }
}

/// A file's name without the folders of the machine that it was built on: the folder of its
/// `src` and what is below, else the file alone.
fn short(file: &str) -> String {
    let parts: Vec<&str> = file.split(['/', '\\']).collect();
    let from = match parts.iter().rposition(|part| *part == "src") {
        Some(source) => source.saturating_sub(1),
        None => parts.len() - 1,
    };
    parts[from..].join("/").chars().filter(|c| !c.is_control()).take(NAME).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_short() {
        assert_eq!(
            short("/home/anna/xon-xoff/src/machine/hold.rs"),
            "xon-xoff/src/machine/hold.rs"
        );
        assert_eq!(short("src/lib.rs"), "src/lib.rs");
        assert_eq!(short(r"C:\work\df1.c"), "df1.c");
        assert_eq!(short(""), "");
    }

    #[test]
    fn a_module_without_debug_information_has_no_lines() {
        assert!(Source::of(b"\0asm\x01\0\0\0").is_none());
        assert!(Source::of(b"no module").is_none());
    }
}
