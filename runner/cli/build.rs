//! A file that is new among the templates, or gone, makes another command.

fn main() {
    println!("cargo::rerun-if-changed=templates");
}
