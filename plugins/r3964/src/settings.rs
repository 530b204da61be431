//! The settings, and the manifest with them in it.

use softplug_procedure_3964::Options;

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"r3964","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"3964R","description":"3964R and 3964, with RK512.""#,
    ),
    settings: Options,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"3964","text":"No block check.","values":{"bcc":false}},"#,
        r#"{"name":"cp440","text":"Siemens CP 440.","values":{"block_size":400}},"#,
        r#"{"name":"sinumerik","text":"SINUMERIK 840/880.","values":{"block_size":128,"buffer_wait":0}},"#,
        r#"{"name":"buderus","text":"Buderus Logamatic.","values":{"qvz":2000,"setup_attempts":3}},"#,
        r#"{"name":"vipa-cp240","text":"VIPA CP 240.","values":{"qvz":500,"bwz":2000,"setup_attempts":3,"priority":"low","block_size":250}},"#,
        r#"{"name":"vipa-cp040","text":"VIPA CP 040.","values":{"qvz":200,"zvz":200,"bwz":200,"setup_attempts":5,"priority":"low"}},"#,
        r#"{"name":"euchner","text":"Euchner HBA.","values":{"qvz":500,"zvz":128,"setup_attempts":3,"transmission_attempts":3}},"#,
        r#"{"name":"ifm","text":"ifm efector 190.","values":{"qvz":3000,"zvz":200,"priority":"high"}},"#,
        r#"{"name":"wago","text":"WAGO.","values":{"qvz":2000,"priority":"low","block_size":128,"nak_on_garbage":false}}],"#,
        r#""line":"8E1","line_when":[{"when":{"preset":"buderus"},"line":"2400 8N1"},"#,
        r#"{"when":{"preset":"vipa-cp040"},"line":"8N1"}],"#,
        r#""profiles":[{"name":"r3964","features":["split","presets"]},{"name":"3964"},{"name":"rk512","features":["active","passive","no-doubling"]}],"#,
        softplug_procedure_3964::procedure_manifest!(),
    ),
};
