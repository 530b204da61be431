//! What a plug-in's bytes are spent on.

use serde::Serialize;

use crate::MANIFEST;
use crate::sections::{Kind, memory, sections};

/// Bytes of a module by what they hold.
///
/// ```
/// use softplug_build::Size;
///
/// let module = wat::parse_str(r#"(module (memory 2 2) (func $f) (data (i32.const 0) "four"))"#)?;
/// let size = Size::of("small", &module);
/// // Each with the head of its section.
/// assert_eq!((size.code, size.data, size.manifest, size.pages), (6, 12, 0, 2));
/// assert!(Size::table(&[size]).starts_with("plug-in    code   data  names manifest   total pages\n"));
/// # Ok::<(), wat::Error>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Size {
    /// The plug-in.
    pub name: String,
    /// The functions.
    pub code: usize,
    /// What memory holds at the start.
    pub data: usize,
    /// Names of functions, for backtraces.
    pub names: usize,
    /// The manifest.
    pub manifest: usize,
    /// The whole module.
    pub total: usize,
    /// Pages of memory at the start.
    pub pages: u64,
}

impl Size {
    /// All zeros but the total where it is no module.
    pub fn of(name: &str, module: &[u8]) -> Self {
        let mut size = Self { name: name.to_owned(), total: module.len(), ..Self::default() };
        size.pages = memory(module).map_or(0, |memory| memory.least);
        for section in sections(module).unwrap_or_default() {
            let place = match section.kind {
                Kind::Code => &mut size.code,
                Kind::Data => &mut size.data,
                Kind::Custom("name") => &mut size.names,
                Kind::Custom(MANIFEST) => &mut size.manifest,
                _ => continue,
            };
            *place += section.whole.len();
        }
        size
    }

    /// For people: a head and a line for each, in bytes and in pages of memory.
    pub fn table(sizes: &[Self]) -> String {
        let width =
            sizes.iter().map(|size| size.name.len()).max().unwrap_or(0).max("plug-in".len());
        let mut lines = vec![format!(
            "{:width$} {:>7} {:>6} {:>6} {:>8} {:>7} {:>5}",
            "plug-in", "code", "data", "names", "manifest", "total", "pages"
        )];
        lines.extend(sizes.iter().map(|size| {
            format!(
                "{:width$} {:>7} {:>6} {:>6} {:>8} {:>7} {:>5}",
                size.name, size.code, size.data, size.names, size.manifest, size.total, size.pages
            )
        }));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Size {
        let module = wat::parse_str(
            r#"(module (memory 2 2) (func $f) (data (i32.const 0) "four")
                (@custom "softplug.manifest" "{}"))"#,
        );
        Size::of("x", &module.unwrap())
    }

    #[test]
    fn each_section_has_its_column() {
        let size = example();
        assert_eq!((size.code, size.data, size.pages), (6, 12, 2));
        assert_eq!(size.manifest, 2 + 1 + 17 + 2);
        assert!(size.names > 0);
        assert!(size.total > size.code + size.data + size.names + size.manifest);
        let nothing = Size { name: "y".into(), total: 2, ..Size::default() };
        assert_eq!(Size::of("y", b"MZ"), nothing);
    }

    #[test]
    fn people_and_machines_read_the_same() {
        let sizes = [example()];
        let table = Size::table(&sizes);
        let list = serde_json::to_value(&sizes).unwrap();
        let (head, row) = table.split_once('\n').unwrap();
        let head: Vec<_> = head.split_whitespace().skip(1).collect();
        let row: Vec<_> = row.split_whitespace().skip(1).collect();
        assert_eq!(head.len(), 6);
        for (name, figure) in head.iter().zip(row) {
            assert_eq!(list[0][name].to_string(), figure);
        }
    }
}
