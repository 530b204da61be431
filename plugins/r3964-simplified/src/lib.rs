//! Simplified 3964R, with RK512.
//!
//! All behaviour is in `softplug-procedure-3964`; here are the settings and the
//! manifest. The protocol's page is `docs/protocols/3964r.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod settings;

pub use settings::Settings;

use softplug_procedure_3964::{Procedure, Variant};

/// The converter.
pub type R3964Simplified = Procedure<Simplified>;

/// What this plug-in adds to the procedure.
#[derive(Debug)]
pub struct Simplified;

softplug_plugin::export!(R3964Simplified);

impl Variant for Simplified {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
}
