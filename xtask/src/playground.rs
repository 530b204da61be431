//! Builds the playground: one page that has everything in it, so that it opens from a
//! disk without a server.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;

use crate::Error;
use crate::run::{cargo, succeed};
use crate::toolchain::{PAGE_TARGET, ensure_target};
use crate::workspace::Workspace;

/// Where the page's sources are.
const SOURCES: &str = "docs/playground";

/// Its engine is built as for development, so that macros and what builds them are there already;
/// but without names and checks of overflow. What runs plug-ins and cases is optimised as far as
/// somebody who looks at steps notices.
const PROFILE: &[&str] = &[
    "debug=false",
    "strip=true",
    "debug-assertions=false",
    "overflow-checks=false",
    "incremental=false",
    "package.softplug-abi.opt-level=1",
    "package.softplug-conformance.opt-level=1",
    "package.softplug-host.opt-level=1",
    "package.softplug-link.opt-level=1",
    "package.softplug-machines.opt-level=1",
    "package.softplug-models.opt-level=1",
    "package.softplug-trace.opt-level=1",
    "package.softplug-trial.opt-level=1",
    "package.wasmparser.opt-level=1",
];

/// The page cannot be put together.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlaygroundError {
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("{SOURCES}/index.html has no line <!-- {0} -->: put it back")]
    Place(&'static str),
    #[error("{SOURCES}/{0} has \"</\" and a tag's name in it, which would end it: write \"<\\/\"")]
    Tag(&'static str),
}

/// Builds the engine and writes `target/playground.html`, with the plug-ins that were built
/// before.
pub(crate) fn build(workspace: &Workspace) -> Result<(), Error> {
    ensure_target(PAGE_TARGET)?;
    succeed(
        cargo()
            .current_dir(workspace.root())
            .args(["build", "--package", "softplug-playground", "--lib"])
            .args(["--target", PAGE_TARGET])
            .args(
                PROFILE.iter().flat_map(|of| ["--config".to_owned(), format!("profile.dev.{of}")]),
            ),
    )?;
    let built = workspace.target().join(PAGE_TARGET).join("debug/softplug_playground.wasm");
    let engine = read(&built)?;
    let mut modules = BTreeMap::new();
    for plugin in workspace.plugins() {
        let file = workspace.plugin_folder().join(format!("{}.wasm", plugin.name));
        modules.insert(plugin.name, BASE64.encode(read(&file)?));
    }
    let data = serde_json::json!({ "engine": BASE64.encode(engine), "plugins": modules });
    let source = |name: &str| read_text(&workspace.root().join(SOURCES).join(name));
    let page = assemble(
        &source("index.html")?,
        &source("style.css")?,
        &source("playground.js")?,
        &data.to_string(),
    )?;
    let out = workspace.playground();
    fs::write(&out, &page).map_err(|cause| PlaygroundError::File { path: out.clone(), cause })?;
    eprintln!("{} has {} bytes", out.display(), page.len());
    Ok(())
}

fn read(path: &Path) -> Result<Vec<u8>, PlaygroundError> {
    fs::read(path).map_err(|cause| PlaygroundError::File { path: path.to_owned(), cause })
}

fn read_text(path: &Path) -> Result<String, PlaygroundError> {
    fs::read_to_string(path).map_err(|cause| PlaygroundError::File { path: path.to_owned(), cause })
}

/// Puts style, script and data into their places.
fn assemble(page: &str, style: &str, script: &str, data: &str) -> Result<String, PlaygroundError> {
    for (name, text, tag) in
        [("style.css", style, "</style"), ("playground.js", script, "</script")]
    {
        if text.to_ascii_lowercase().contains(tag) {
            return Err(PlaygroundError::Tag(name));
        }
    }
    let parts = [
        ("style", format!("<style>\n{style}</style>")),
        ("data", format!("<script type=\"application/json\" id=\"data\">{data}</script>")),
        ("script", format!("<script>\n{script}</script>")),
    ];
    let mut whole = page.to_owned();
    for (name, part) in parts {
        let place = format!("<!-- {name} -->");
        let (before, after) = whole.split_once(&place).ok_or(PlaygroundError::Place(name))?;
        whole = [before, &part, after].concat();
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "<!-- style --><p>$&</p><!-- data --><!-- script -->";

    #[test]
    fn everything_is_in_its_place() {
        let page = assemble(PAGE, "p { color: red }\n", "f(\"<!-- style -->\");\n", "{}").unwrap();
        assert_eq!(
            page,
            "<style>\np { color: red }\n</style><p>$&</p><script type=\"application/json\" \
             id=\"data\">{}</script><script>\nf(\"<!-- style -->\");\n</script>"
        );
    }

    #[test]
    fn a_page_without_a_place_and_a_script_that_ends_early_are_refused() {
        let of = |page, script| assemble(page, "", script, "{}").unwrap_err().to_string();
        assert!(of("<!-- style -->", "").contains("<!-- data -->"));
        assert!(of(PAGE, "'</SCRIPT>'").contains("playground.js"));
    }
}
