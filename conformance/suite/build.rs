//! The corpus is compiled in: a new file in it is a reason to compile again.

fn main() {
    for folder in ["requirements", "traces", "mutants"] {
        println!("cargo:rerun-if-changed=../../fixtures/{folder}");
    }
}
