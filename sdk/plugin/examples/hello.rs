//! The smallest useful plug-in: greets whoever speaks, and repeats what was said.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::{Context, Converter, NoteLevel, Text, manifest, settings};

settings! {
    /// The settings.
    pub struct Settings {
        greeting: Text<40> = "HELLO ", "Said before what is repeated.";
    }
}

/// The converter.
#[derive(Debug)]
pub struct Hello(Settings);

softplug_plugin::export!(Hello);

impl Converter for Hello {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: r#""abi": "1.0", "name": "hello", "version": "1.0.0", "licence": "MIT",
            "protocol": "none", "description": "Repeats what it receives.""#,
        settings: Settings,
    };

    fn new(settings: Settings) -> Self {
        Self(settings)
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let greeting = self.0.greeting.as_str().as_bytes();
        if greeting.len() + bytes.len() > link.transmit_room() as usize {
            return link.note(NoteLevel::Warning, 0, "no room to answer");
        }
        link.transmit(greeting);
        link.transmit(bytes);
    }
}
