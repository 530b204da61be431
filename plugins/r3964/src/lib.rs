//! 3964R and 3964, with RK512.
//!
//! All behaviour is in `softplug-procedure-3964`; here are the settings and the
//! manifest. The protocol's page is `docs/protocols/3964r.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod settings;

use softplug_procedure_3964::{Options, Procedure, Variant};

/// The converter.
pub type R3964 = Procedure<Standard>;

/// What this plug-in adds to the procedure.
#[derive(Debug)]
pub struct Standard;

softplug_plugin::export!(R3964);

impl Variant for Standard {
    type Settings = Options;
    const MANIFEST: &'static str = settings::MANIFEST;
}
