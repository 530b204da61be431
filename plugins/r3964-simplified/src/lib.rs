//! Simplified 3964R.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::Converter;

/// The converter.
#[derive(Debug, Default)]
pub struct R3964Simplified;

softplug_plugin::export!(R3964Simplified);

impl Converter for R3964Simplified {
    type Settings = ();
    const MANIFEST: &'static str = concat!(
        r#"{"abi":"1.0","name":"r3964-simplified","version":""#,
        env!("CARGO_PKG_VERSION"),
        r#"","licence":"MIT OR Apache-2.0","protocol":"simplified 3964R","description":"Simplified 3964R."}"#,
    );

    fn new((): ()) -> Self {
        Self
    }
}
