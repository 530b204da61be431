//! Links lead to files that are there, and to headings that are in them.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use crate::page::{Page, repository};

/// What is wrong with the links of a page.
pub(crate) fn check(page: &Page) -> Vec<String> {
    let mut others = BTreeMap::new();
    let wrong = |link: &crate::page::Link| {
        let why = follow(page, &link.target, &mut others).err()?;
        Some(format!("{}:{}: {}: {why}", page.path, link.line, link.target))
    };
    page.links.iter().filter_map(wrong).collect()
}

fn follow(
    page: &Page,
    target: &str,
    others: &mut BTreeMap<PathBuf, Page>,
) -> Result<(), &'static str> {
    if target.starts_with("https://") || target.starts_with("http://127.0.0.1") {
        return Ok(());
    }
    let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
    if file.is_empty() {
        let is_there = page.anchors.iter().any(|is| is == anchor);
        return is_there.then_some(()).ok_or("there is no such heading");
    }
    let folder = Path::new(&page.path).parent().unwrap_or(Path::new(""));
    let path = plain(&folder.join(file)).ok_or("it leads out of the repository")?;
    if !repository().join(&path).exists() {
        return Err("there is no such file");
    }
    if anchor.is_empty() || path.extension().is_none_or(|extension| extension != "md") {
        return Ok(());
    }
    let other = others.entry(path.clone()).or_insert_with(|| Page::read(path.to_str().unwrap()));
    let is_there = other.anchors.iter().any(|is| is == anchor);
    is_there.then_some(()).ok_or("there is no such heading in it")
}

/// The path without `..`.
fn plain(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir if !plain.pop() => return None,
            Component::ParentDir | Component::CurDir => {}
            part => plain.push(part),
        }
    }
    Some(plain)
}
