//! Simplified 3964R, with RK512.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod settings;

pub use settings::Settings;

use softplug_plugin::Converter;

/// The converter.
#[derive(Debug)]
pub struct R3964Simplified;

softplug_plugin::export!(R3964Simplified);

impl Converter for R3964Simplified {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(1);

    fn new(_settings: Settings) -> Self {
        Self
    }
}
