//! The book: `docs/` as HTML in `target/book`, by mdBook.

mod diagram;
mod stage;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::run::{self, RunError};
use crate::workspace::Workspace;

/// The version of mdBook that the book is made with.
const VERSION: &str = "0.5.4";

/// The book cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BookError {
    #[error(transparent)]
    Run(#[from] RunError),
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    #[error("{}: {source}", path.display())]
    Diagram { path: PathBuf, source: diagram::DiagramError },
    #[error("mdBook has warnings: they stand above")]
    Warned,
    #[error("links of the book lead nowhere:\n{}", .0.join("\n"))]
    Links(Vec<String>),
}

/// Makes the book; a warning is an error.
pub(crate) fn make(workspace: &Workspace) -> Result<(), BookError> {
    let target = workspace.root().join("target");
    let mdbook = mdbook(&target)?;
    let source = target.join("book-source");
    if source.exists() {
        fs::remove_dir_all(&source).map_err(|error| at(&source, error))?;
    }
    stage(&workspace.root().join("docs"), &source, "")?;
    let book = target.join("book");
    let mut command = Command::new(mdbook);
    let heard = run::overhear(command.arg("build").arg(&source).arg("--dest-dir").arg(&book))?;
    let said = heard.stdout + &heard.stderr;
    if !heard.status.success() || said.contains("WARN") || said.contains("ERROR") {
        return Err(BookError::Warned);
    }
    let mut broken = Vec::new();
    follow(&book, &mut broken)?;
    if !broken.is_empty() {
        return Err(BookError::Links(broken));
    }
    eprintln!("{}", book.join("index.html").display());
    Ok(())
}

/// The program, installed below `target` if it is not there.
fn mdbook(target: &Path) -> Result<PathBuf, BookError> {
    let tools = target.join("tools");
    let program = tools.join("bin/mdbook");
    let is_ours = program.exists()
        && run::output(Command::new(&program).arg("--version"))?.trim()
            == format!("mdbook v{VERSION}");
    if !is_ours {
        // Without optimisation: it is quicker built than used.
        let mut install = run::cargo();
        install.args(["install", "mdbook", "--locked", "--debug", "--force", "--version", VERSION]);
        install.args(["--no-default-features", "--features", "search", "--root"]).arg(&tools);
        run::succeed(install.arg("--target-dir").arg(target.join("mdbook")))?;
    }
    Ok(program)
}

/// Copies a folder; pages are turned into what mdBook understands.
fn stage(from: &Path, to: &Path, below: &str) -> Result<(), BookError> {
    fs::create_dir_all(to).map_err(|error| at(to, error))?;
    for path in entries(from)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let copy = to.join(&name);
        if path.is_dir() {
            stage(&path, &copy, &format!("{below}{name}/"))?;
        } else if Path::new(&name).extension().is_some_and(|end| end == "md") {
            let text = fs::read_to_string(&path).map_err(|error| at(&path, error))?;
            let page = stage::page(&format!("{below}{name}"), &text)
                .map_err(|source| BookError::Diagram { path: path.clone(), source })?;
            fs::write(&copy, page).map_err(|error| at(&copy, error))?;
        } else {
            fs::copy(&path, &copy).map_err(|error| at(&path, error))?;
        }
    }
    Ok(())
}

/// Follows the links of all pages in a folder to files of the book.
fn follow(folder: &Path, broken: &mut Vec<String>) -> Result<(), BookError> {
    for path in entries(folder)? {
        if path.is_dir() {
            follow(&path, broken)?;
            continue;
        }
        // That page is answered for any address, so its links have another base.
        let is_page =
            path.extension().is_some_and(|is| is == "html") && !path.ends_with("404.html");
        if !is_page {
            continue;
        }
        let text = fs::read_to_string(&path).map_err(|error| at(&path, error))?;
        for target in ["href=\"", "src=\""].iter().flat_map(|name| text.split(name).skip(1)) {
            let target = target.split('"').next().unwrap_or_default();
            let file = target.split('#').next().unwrap_or_default();
            let is_outside = target.contains(':') || file.is_empty();
            if !is_outside && !folder.join(file).exists() {
                broken.push(format!("{}: {target}", path.display()));
            }
        }
    }
    Ok(())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, BookError> {
    let entries = fs::read_dir(folder).map_err(|error| at(folder, error))?;
    entries
        .map(|entry| entry.map(|entry| entry.path()).map_err(|error| at(folder, error)))
        .collect()
}

fn at(path: &Path, source: io::Error) -> BookError {
    BookError::File { path: path.to_owned(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the book's own program would be told only when it is made.
    #[test]
    fn every_diagram_can_be_drawn() {
        let folder = folder_of_its_own();
        stage(&Workspace::read().unwrap().root().join("docs"), &folder, "").unwrap();
        let drawn = fs::read_to_string(folder.join("protocols/3964r.md")).unwrap();
        assert!(drawn.matches("<svg").count() >= 4, "{drawn}");
        fs::remove_dir_all(folder).unwrap();
    }

    fn folder_of_its_own() -> PathBuf {
        std::env::temp_dir().join(format!("softplug-book-{}", std::process::id()))
    }
}
