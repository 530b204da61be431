//! The settings, and the manifest with them in it.

softplug_procedure_3964::procedure_settings! {
    /// The settings of simplified 3964R.
    pub struct Settings {
    priority: "none",
    qvz: 2000,
    bwz: 0,
    buffer_wait: 0,
    setup_attempts: 3,
    transmission_attempts: 1,
    block_size: 128,
    nak_at_start: false,
    nak_on_garbage: false,
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"r3964-simplified","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"simplified 3964R","description":"The subset of 3964R that small devices speak, with RK512.""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"no-handshake","text":"STX, data and end in one go.","values":{"handshake":false}},"#,
        r#"{"name":"no-bcc","text":"No block check.","values":{"bcc":false}}],"#,
        r#""line":"8E1","profiles":[{"name":"r3964-simplified","features":["no-doubling","no-check","no-handshake","values"]},{"name":"rk512","features":["active","passive","no-doubling"]}],"#,
        softplug_procedure_3964::procedure_manifest!(),
    ),
};
