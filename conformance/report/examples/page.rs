//! Writes the page of a report: `cargo run --example page -- conformance.json report.html`.

use softplug_report::{html, json};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(report), Some(page)) = (arguments.next(), arguments.next()) else {
        return Err("two arguments are expected: the report, and the page to write".into());
    };
    let text = std::fs::read_to_string(&report)?;
    std::fs::write(page, html::write(&json::read(Path::new(&report), &text)?))?;
    Ok(())
}
