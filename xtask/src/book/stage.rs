//! A page of `docs/` as mdBook gets it: diagrams drawn, names of files above their blocks,
//! links out of `docs/` leading to the repository.

use super::diagram::{self, DiagramError};
use std::fmt::Write as _;

/// Where what is not in the book can be read.
const REPOSITORY: &str = "https://github.com/softplug/softplug/blob/main/";

/// Turns a page; `path` is its own below `docs/`.
pub(crate) fn page(path: &str, text: &str) -> Result<String, DiagramError> {
    let mut made = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let Some(info) = line.strip_prefix("```") else {
            made += &links(path, line);
            made.push('\n');
            continue;
        };
        let mut block = String::new();
        for line in lines.by_ref().take_while(|line| !line.starts_with("```")) {
            block += line;
            block.push('\n');
        }
        let mut marks = info.split(',');
        let language = marks.next().unwrap_or_default();
        if language == "mermaid" {
            made += &diagram::svg(&block)?;
            made += "\n\n";
            continue;
        }
        let file = marks.find_map(|mark| mark.split_once('=')).filter(|(name, _)| *name != "with");
        if let Some((_, file)) = file {
            let _ = writeln!(made, "<p class=\"file\">{file}</p>\n");
        }
        // Else mdBook would make a playground of it.
        let language = if language == "rust" { "rust,noplayground" } else { language };
        let _ = writeln!(made, "```{language}\n{block}```");
    }
    Ok(made)
}

/// Links of a line, outside of code.
fn links(path: &str, line: &str) -> String {
    let mut made = String::new();
    for (at, part) in line.split('`').enumerate() {
        if at > 0 {
            made.push('`');
        }
        // A link's text may have code in it: what follows belongs to no code then.
        made += &if at % 2 == 0 { targets(path, part) } else { part.to_owned() };
    }
    made
}

fn targets(path: &str, text: &str) -> String {
    let mut parts = text.split("](");
    let mut made = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (target, rest) = part.split_once(')').unwrap_or((part, ""));
        made += "](";
        // mdBook makes index.html of each README.md, and leaves links to it as they are.
        let inside = if path == "SUMMARY.md" { target.to_owned() } else { index(target) };
        made += &outside(path, target).unwrap_or(inside);
        made.push(')');
        made += rest;
    }
    made
}

fn index(target: &str) -> String {
    target.replace("README.md", "index.html")
}

/// The address of a target outside of `docs/`.
fn outside(path: &str, target: &str) -> Option<String> {
    if target.contains("://") || target.starts_with('#') {
        return None;
    }
    let mut folders: Vec<&str> = path.split('/').collect();
    folders.pop();
    let mut depth = folders.len();
    let mut rest = target;
    while let Some(up) = rest.strip_prefix("../") {
        rest = up;
        match depth.checked_sub(1) {
            Some(less) => depth = less,
            None => return Some(format!("{REPOSITORY}{rest}")),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_out_of_the_book_lead_to_the_repository() {
        let made = page(
            "a/b.md",
            "[x](../../plugins/y) [z](../c.md#d) [i](../d/README.md#e) `[q](../../r)`\n",
        )
        .unwrap();
        let plugin = format!("[x]({REPOSITORY}plugins/y)");
        assert_eq!(
            made,
            format!("{plugin} [z](../c.md#d) [i](../d/index.html#e) `[q](../../r)`\n")
        );
    }

    #[test]
    fn blocks_say_their_files_and_diagrams_are_drawn() {
        let made = page(
            "a.md",
            "```rust,file=src/a.rs\nfn a() {}\n```\n```mermaid\nsequenceDiagram\nA->>B: c\n```\n",
        );
        let made = made.unwrap();
        assert!(made.starts_with(
            "<p class=\"file\">src/a.rs</p>\n\n```rust,noplayground\nfn a() {}\n```\n<svg"
        ));
    }
}
