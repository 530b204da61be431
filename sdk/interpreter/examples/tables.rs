//! What modules take of RAM beside their own bytes: `cargo run -p softplug-interpreter --example tables -- MODULE.wasm …`

use softplug_interpreter::Module;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        let module = Module::load(std::fs::read(&path)?)?;
        println!("{path}: {} bytes, {} of tables", module.bytes().len(), module.table_bytes());
    }
    Ok(())
}
