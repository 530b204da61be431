//! The lines of source around the place at which a plug-in panicked, where its source is at
//! hand.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Component, Path, PathBuf};

/// Lines before and behind the place.
const AROUND: u32 = 2;
/// The longest file that is looked into, in lines.
const LINES: u32 = 100_000;
/// Bytes of a line that are shown.
const WIDTH: usize = 160;

/// Where sources are looked for.
pub(super) struct Source {
    folder: Option<PathBuf>,
}

/// In this folder and in those above it.
pub(super) fn near(folder: Option<PathBuf>) -> Source {
    Source { folder }
}

impl Source {
    /// The lines around the place in `words`, `MESSAGE, at FILE:LINE`, with their numbers. Words come
    /// from the plug-in: only a relative path to a file of source is followed.
    pub(super) fn around(&self, words: &str) -> Option<Vec<(u32, String)>> {
        let (_, place) = words.rsplit_once(", at ")?;
        let (file, line) = place.rsplit_once(':')?;
        let line: u32 = line.parse().ok().filter(|line| (1..LINES).contains(line))?;
        let file = Path::new(file);
        let is_plain = file.components().all(|part| matches!(part, Component::Normal(_)));
        let is_source = file
            .extension()
            .and_then(|extension| extension.to_str())
            .is_some_and(|extension| matches!(extension, "rs" | "c" | "h" | "ts" | "zig"));
        if !is_plain || !is_source {
            return None;
        }
        let folders = self.folder.as_deref()?.ancestors();
        let found = folders.map(|folder| folder.join(file)).find(|path| path.is_file())?;
        Some(read(&found, line)).filter(|lines| !lines.is_empty())
    }
}

fn read(path: &Path, line: u32) -> Vec<(u32, String)> {
    let Ok(file) = File::open(path) else { return Vec::new() };
    let lines = BufReader::new(file).split(b'\n').map_while(Result::ok);
    let numbered = (1..).zip(lines);
    let near = numbered.skip_while(|(number, _)| number + AROUND < line);
    let near = near.take_while(|(number, _)| *number <= line + AROUND);
    near.map(|(number, text)| {
        let text = &text[..text.len().min(WIDTH)];
        let text = String::from_utf8_lossy(text).replace('\t', "    ");
        (number, text.chars().filter(|c| !c.is_control()).collect())
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lines_around_a_panic_are_found_from_below() {
        let top = tempfile::tempdir().unwrap();
        let below = top.path().join("a/b");
        std::fs::create_dir_all(top.path().join("src")).unwrap();
        std::fs::create_dir_all(&below).unwrap();
        let lines: Vec<String> = (1..=9).map(|n| format!("\tline {n}\u{1b}\n")).collect();
        std::fs::write(top.path().join("src/lib.rs"), lines.concat()).unwrap();
        let source = near(Some(below));
        let lines = source.around("index out of range, at least, at src/lib.rs:4").unwrap();
        let numbers: Vec<_> = lines.iter().map(|(number, _)| *number).collect();
        assert_eq!(numbers, [2, 3, 4, 5, 6]);
        assert_eq!(lines[2].1, "    line 4");
        assert_eq!(source.around("x, at src/lib.rs:1").unwrap().len(), 3);
        assert_eq!(source.around("x, at src/lib.rs:99"), None);
    }

    #[test]
    fn a_plug_in_cannot_have_other_files_shown() {
        let top = tempfile::tempdir().unwrap();
        std::fs::write(top.path().join("secret.rs"), "x\n").unwrap();
        std::fs::write(top.path().join("secret.txt"), "x\n").unwrap();
        std::fs::create_dir(top.path().join("a")).unwrap();
        let source = near(Some(top.path().join("a")));
        assert!(source.around("x, at secret.rs:1").is_some());
        let absolute = format!("x, at {}:1", top.path().join("secret.rs").display());
        for words in
            ["x, at ../secret.rs:1", "x, at secret.txt:1", "x", "x, at secret.rs", &absolute]
        {
            assert_eq!(source.around(words), None, "{words}");
        }
    }
}
