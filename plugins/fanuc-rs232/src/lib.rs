//! FANUC-style RS-232: the reader/punch interface and the remote buffer.
//!
//! The protocol's page is `docs/protocols/fanuc-rs232.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod settings;

pub use settings::{
    BlockNumbers, Eob, LineEnd, Mode, OnLineError, OutputFlow, PacketEnd, ParityMode, Programs,
    ReceiveCode, ResumeCode, SendCode, Settings, Unsupported,
};

use softplug_plugin::Converter;

/// The converter.
#[derive(Debug)]
pub struct FanucRs232 {
    settings: Settings,
}

softplug_plugin::export!(FanucRs232);

impl Converter for FanucRs232 {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(1);

    fn check_settings(settings: &Settings) -> Result<(), &'static str> {
        settings.check()
    }

    fn new(settings: Settings) -> Self {
        Self { settings }
    }
}
