//! Parts of the protocol pages that come from a plug-in's manifest.

use softplug_abi::manifest::{Manifest, Setting, ValueType};
use std::fmt::Write as _;

/// The settings as a Markdown table.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::page::settings_table;
///
/// let manifest = Manifest::parse(br#"{"abi": "1.0", "name": "x", "version": "1",
///     "licence": "MIT", "protocol": "x", "description": "x", "settings": [
///     {"name": "wait", "type": "int", "default": 5, "min": 0, "max": 9, "unit": "ms", "text": "How long."}]}"#)?;
/// assert!(settings_table(&manifest).ends_with("| `wait` | int | 5 | 0 to 9 ms | How long. |\n"));
/// # Ok::<(), softplug_abi::manifest::ManifestError>(())
/// ```
pub fn settings_table(manifest: &Manifest) -> String {
    let mut table =
        "| setting | type | default | range | meaning |\n|---|---|---|---|---|\n".to_owned();
    for setting in &manifest.settings {
        let _ = writeln!(
            table,
            "| `{}` | {} | {} | {} | {} |",
            setting.name,
            setting.kind.name(),
            default(setting),
            range(setting),
            setting.text
        );
    }
    table
}

/// The presets as a Markdown table.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::page::presets_table;
///
/// let manifest = Manifest::parse(br#"{"abi": "1.0", "name": "x", "version": "1",
///     "licence": "MIT", "protocol": "x", "description": "x", "settings": [
///     {"name": "wait", "type": "int", "default": 5, "min": 0, "max": 9, "unit": "ms", "text": "How long."}],
///     "presets": [{"name": "slow", "text": "For old machines.", "values": {"wait": 9}}]}"#)?;
/// assert!(presets_table(&manifest).ends_with("| `slow` | `wait=9` | For old machines. |\n"));
/// # Ok::<(), softplug_abi::manifest::ManifestError>(())
/// ```
pub fn presets_table(manifest: &Manifest) -> String {
    let mut table = "| preset | sets | meaning |\n|---|---|---|\n".to_owned();
    for preset in &manifest.presets {
        let values = preset.values.iter().map(|(name, value)| match value.as_str() {
            Some(text) => format!("`{name}={text}`"),
            None => format!("`{name}={value}`"),
        });
        let values = values.collect::<Vec<_>>().join(" ");
        let _ = writeln!(table, "| `{}` | {values} | {} |", preset.name, preset.text);
    }
    table
}

fn default(setting: &Setting) -> String {
    let text = match setting.default.as_str() {
        Some(text) => text.to_owned(),
        None => setting.default.to_string(),
    };
    match (setting.kind, text.as_str()) {
        (ValueType::Bool, "true") => "on".to_owned(),
        (ValueType::Bool, _) => "off".to_owned(),
        (_, "") => "none".to_owned(),
        _ => text,
    }
}

fn range(setting: &Setting) -> String {
    if !setting.choices.is_empty() {
        return setting.choices.join(", ");
    }
    let unit = match setting.kind {
        ValueType::Text | ValueType::Bytes => "bytes",
        _ => setting.unit.as_str(),
    };
    match (setting.min, setting.max) {
        (Some(min), Some(max)) => format!("{min} to {max} {unit}").trim_end().to_owned(),
        (None, Some(max)) => format!("at most {max} {unit}").trim_end().to_owned(),
        (Some(min), None) => format!("at least {min} {unit}").trim_end().to_owned(),
        (None, None) if setting.kind == ValueType::Bool => "on, off".to_owned(),
        (None, None) => "any".to_owned(),
    }
}
