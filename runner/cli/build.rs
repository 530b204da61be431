//! A file that is new among the templates, or gone, makes another command.

#[expect(clippy::disallowed_macros, reason = "cargo reads what a build script prints")]
fn main() {
    println!("cargo::rerun-if-changed=templates");
}
