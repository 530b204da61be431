//! `softplug inspect`: whether a module is a plug-in, and what it says of itself.

use std::fmt::Write as _;

use clap::Args;
use serde::Serialize;
use serde_json::Value;
use softplug_abi::manifest::{Manifest, Setting, ValueType};
use softplug_host::{Host, HostOptions, Inspection};
use softplug_live::plain_text;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::plugin::{Library, load_failure};
use crate::screen::{HEADING, Screen};
use crate::table::Table;

/// Checks a plug-in and shows its manifest: settings, presets, jobs, profiles.
///
/// Nothing of the plug-in runs but the question for its mailbox.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug inspect target/plugins/xon-xoff.wasm
  softplug inspect xon-xoff --json")]
pub(crate) struct Arguments {
    /// The plug-in: a .wasm file, or a name to look up
    plugin: String,
    #[command(flatten)]
    library: Library,
}

/// What machines get.
#[derive(Serialize)]
struct Document<'a> {
    file: String,
    abi: &'a str,
    imports: usize,
    exports: &'a [String],
    sha256: String,
    size: usize,
    memory_pages: u64,
    manifest: &'a Manifest,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    if arguments.plugin.starts_with("native:") {
        return Err(Failure::usage("a native plug-in is no module to inspect")
            .hint("give the .wasm file that is built from the same code"));
    }
    let file = arguments.library.find(&arguments.plugin)?;
    let host = Host::new(HostOptions::default()).map_err(Failure::plug_in)?;
    // Loaded and not only linted: a module that cannot start is no plug-in.
    let plugin = host.load(&file).map_err(|error| load_failure(&file, &error))?;
    plugin.instantiate().map_err(|error| load_failure(&file, &error))?;
    let inspection = plugin.inspection();
    screen.document(&Document {
        file: file.display().to_string(),
        abi: &inspection.manifest.abi,
        imports: inspection.imports,
        exports: &inspection.exports,
        sha256: inspection.digest.to_string(),
        size: inspection.size,
        memory_pages: inspection.memory_pages,
        manifest: &inspection.manifest,
    });
    screen.say(describe(inspection));
    Ok(Exit::Done)
}

fn describe(inspection: &Inspection) -> String {
    let manifest = &inspection.manifest;
    let named = plain_text(&format!("{} {}", manifest.name, manifest.version));
    let mut text = format!("{HEADING}{named}{HEADING:#}");
    // What a module says of itself could else look like a line of ours.
    let mut line = |line: &str| {
        let _ = write!(text, "\n{}", plain_text(line));
    };
    line(&manifest.description);
    line("");
    line(&format!("protocol  {}", manifest.protocol));
    line(&format!("licence   {}", manifest.licence));
    line(&format!("abi       {}, {} imports", manifest.abi, inspection.imports));
    line(&format!("size      {}", numbers::bytes(inspection.size as u64)));
    line(&format!("memory    {}", numbers::things(inspection.memory_pages, "page")));
    line(&format!("sha256    {}", inspection.digest));
    if let Some(named) = manifest.line {
        let others = manifest.line_when.iter().map(|case| {
            let when = case.when.iter().map(|(name, value)| assignment(name, value));
            format!(", {} with {}", case.line, when.collect::<Vec<_>>().join(" "))
        });
        line(&format!("line      {named}{}", others.collect::<String>()));
    }
    for profile in &manifest.profiles {
        let features = profile.features.join(", ");
        let with = if features.is_empty() { String::new() } else { format!(", with {features}") };
        line(&format!("profile   {}{with}", profile.name));
    }
    if let Some(saves) = manifest.state.saves {
        let accepts = manifest.state.accepts.iter().map(ToString::to_string);
        let accepts = accepts.collect::<Vec<_>>().join(", ");
        line(&format!("state     saves format {saves}, takes {accepts}"));
    }
    let tables = [settings(manifest), presets(manifest), kinds(manifest), status(manifest)];
    for table in tables.into_iter().flatten() {
        let _ = write!(text, "\n\n{table}");
    }
    text
}

fn settings(manifest: &Manifest) -> Option<Table> {
    let mut table = Table::new(["SETTING", "TYPE", "DEFAULT", "RANGE", "MEANING"]);
    for setting in &manifest.settings {
        table.row(plain([
            &setting.name,
            setting.kind.name(),
            &default(setting),
            &range(setting),
            &setting.text,
        ]));
    }
    (!manifest.settings.is_empty()).then_some(table)
}

/// As it would be written on the command line.
fn default(setting: &Setting) -> String {
    let unit = if setting.unit.is_empty() { String::new() } else { format!(" {}", setting.unit) };
    match &setting.default {
        Value::Bool(true) => "on".to_owned(),
        Value::Bool(false) => "off".to_owned(),
        Value::String(text) if text.is_empty() => "\"\"".to_owned(),
        Value::String(text) => text.clone(),
        other => format!("{other}{unit}"),
    }
}

fn range(setting: &Setting) -> String {
    let unit = match setting.kind {
        ValueType::Bool => return "on, off".to_owned(),
        ValueType::Choice => return setting.choices.join(", "),
        ValueType::Int => setting.unit.as_str(),
        ValueType::Text | ValueType::Bytes => "bytes",
    };
    let range = match (setting.min, setting.max) {
        (Some(min), Some(max)) => format!("{min} to {max}"),
        (Some(min), None) => format!("from {min}"),
        (None, Some(max)) => format!("up to {max}"),
        (None, None) => return "any".to_owned(),
    };
    format!("{range} {unit}").trim_end().to_owned()
}

fn presets(manifest: &Manifest) -> Option<Table> {
    let mut table = Table::new(["PRESET", "SETS", "MEANING"]);
    for preset in &manifest.presets {
        let sets = preset.values.iter().map(|(name, value)| assignment(name, value));
        let sets = sets.collect::<Vec<_>>().join(" ");
        table.row(plain([&preset.name, &sets, &preset.text]));
    }
    (!manifest.presets.is_empty()).then_some(table)
}

/// A setting with its value, as it would be written on the command line.
fn assignment(name: &str, value: &Value) -> String {
    match value {
        Value::Bool(true) => format!("{name}=on"),
        Value::Bool(false) => format!("{name}=off"),
        Value::String(text) if text.contains(' ') => format!("{name}=\"{text}\""),
        Value::String(text) => format!("{name}={text}"),
        other => format!("{name}={other}"),
    }
}

fn kinds(manifest: &Manifest) -> Option<Table> {
    let mut table = Table::new(["JOB", "FIELDS", "MEANING"]);
    for kind in &manifest.jobs {
        let fields = kind.fields.iter().map(|field| {
            if field.required { field.name.clone() } else { format!("[{}]", field.name) }
        });
        let fields = fields.collect::<Vec<_>>().join(" ");
        let fields = if fields.is_empty() { "none".to_owned() } else { fields };
        table.row(plain([&kind.name, &fields, &kind.text]));
    }
    (!manifest.jobs.is_empty()).then_some(table)
}

fn status(manifest: &Manifest) -> Option<Table> {
    let mut table = Table::new(["STATUS", "NAME", "MEANING"]);
    for status in &manifest.status {
        table.row(plain([&format!("{:04X}", status.code), &status.name, &status.text]));
    }
    (!manifest.status.is_empty()).then_some(table)
}

/// What a module says, so that it cannot look like a line of ours.
fn plain<const N: usize>(cells: [&str; N]) -> [String; N] {
    cells.map(plain_text)
}
