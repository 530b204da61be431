//! 3964R and 3964.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::Converter;

/// The converter.
#[derive(Debug, Default)]
pub struct R3964;

softplug_plugin::export!(R3964);

impl Converter for R3964 {
    type Settings = ();
    const MANIFEST: &'static str = concat!(
        r#"{"abi":"1.0","name":"r3964","version":""#,
        env!("CARGO_PKG_VERSION"),
        r#"","licence":"MIT OR Apache-2.0","protocol":"3964R","description":"3964R and 3964."}"#,
    );

    fn new((): ()) -> Self {
        Self
    }
}
