//! FANUC-style RS-232.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::Converter;

/// The converter.
#[derive(Debug, Default)]
pub struct FanucRs232;

softplug_plugin::export!(FanucRs232);

impl Converter for FanucRs232 {
    type Settings = ();
    const MANIFEST: &'static str = concat!(
        r#"{"abi":"1.0","name":"fanuc-rs232","version":""#,
        env!("CARGO_PKG_VERSION"),
        r#"","licence":"MIT OR Apache-2.0","protocol":"FANUC RS-232","description":"FANUC-style RS-232."}"#,
    );

    fn new((): ()) -> Self {
        Self
    }
}
