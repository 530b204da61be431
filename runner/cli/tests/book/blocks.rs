//! Blocks that are no commands: each language is held to what reads it.

use std::fs;
use std::process::Command;

use softplug_trace::Trace;

use crate::bench::{Bench, plugins};
use crate::page::Block;

/// Says what is wrong with a block.
pub(crate) fn check(block: &Block) -> Result<(), String> {
    match block.language.as_str() {
        // The page's commands read what is in a file.
        "toml" if block.value("file").is_some() => {
            parsed(toml::from_str::<toml::Table>(&block.text))
        }
        "toml" => toml(&block.text),
        "json" => parsed(serde_json::from_str::<serde_json::Value>(&block.text)),
        "yaml" => parsed(serde_saphyr::from_str::<serde_json::Value>(&block.text)),
        "wat" => parsed(wat::parse_str(&block.text)),
        "spt" => trace(&block.text),
        // Compiled, or applied, by the commands of the page that it stands on.
        "rust" | "diff" if block.value("file").or(block.value("append")).is_some() => Ok(()),
        // Pictures: `cargo xtask book` draws them. Text: layouts, grammars, wiring.
        "mermaid" | "text" => Ok(()),
        other => Err(format!("nobody checks blocks of the language \"{other}\"")),
    }
}

fn parsed<T, E: std::fmt::Display>(result: Result<T, E>) -> Result<(), String> {
    result.map(|_| ()).map_err(|error| error.to_string())
}

/// A configuration of the gateway passes its check; else it is TOML.
fn toml(text: &str) -> Result<(), String> {
    let table: toml::Table = toml::from_str(text).map_err(|error| error.to_string())?;
    let is_gateway = ["gateway", "http", "supervision", "defaults", "link"];
    if !is_gateway.iter().any(|key| table.contains_key(*key)) {
        return Ok(());
    }
    let bench = Bench::new();
    let mut modules = Vec::new();
    for entry in fs::read_dir(plugins()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "wasm") {
            modules.push(path.to_str().unwrap().to_owned());
        }
    }
    let library = ["plugin", "add", "--library", "state/plugins"].map(str::to_owned);
    bench.run(&[&library[..], &modules].concat()).with_code(0);
    bench.write("gateway.toml", text);
    let ran = bench.run(&["gateway", "check", "gateway.toml"]);
    if ran.code == 0 { Ok(()) } else { Err(ran.err) }
}

/// A whole trace, or lines of a body.
fn trace(text: &str) -> Result<(), String> {
    const FRONT: &str = "id: book.part\ntitle: Part of a case\nprofile: book\nclauses: book.part\n\
        level: must\nline: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n---\n";
    // Of a part all lines are events, or stand before one.
    const END: &str = ". 999999999.000000\n";
    let is_whole = text.starts_with("id:");
    let whole = if is_whole { text.to_owned() } else { format!("{FRONT}{text}{END}") };
    let trace = Trace::parse(&whole).map_err(|error| error.report("trace"))?;
    if trace.format() == whole { Ok(()) } else { Err(format!("its form is\n{}", trace.format())) }
}

/// The options of a command line that cannot run here exist, and so do its verbs.
pub(crate) fn check_options(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let is_verb = |word: &&&str| word.chars().all(|c| c.is_ascii_lowercase() || c == '-');
    let verbs: Vec<&str> = words
        .iter()
        .skip(1)
        .take_while(is_verb)
        .take_while(|w| !w.starts_with('-'))
        .copied()
        .collect();
    let help = (0..=verbs.len()).rev().find_map(|count| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_softplug"));
        let output = command.args(&verbs[..count]).arg("--help").output().unwrap();
        let is_it = output.status.success() && (count > 0 || verbs.is_empty());
        is_it.then(|| String::from_utf8(output.stdout).unwrap())
    });
    let help = help.ok_or_else(|| format!("there is no verb {}: `{line}`", verbs.join(" ")))?;
    let options = words.iter().filter(|word| word.starts_with("--") && word.len() > 2);
    for option in options {
        let name = option.split(['=', '`']).next().unwrap_or_default();
        let is_there = help.split([' ', '\n', ',', '=']).any(|word| word == name);
        if !is_there {
            return Err(format!("there is no {name} in `{line}`"));
        }
    }
    Ok(())
}

#[test]
fn wrong_blocks_are_noticed() {
    assert!(toml("[[link]]\nname = \"a\"\nport = \"pty:\"\nplugin = \"xon-xoff\"\n").is_ok());
    assert!(toml("[[link]]\nname = \"a\"\nport = \"pty:\"\nplugin = \"xon-xof\"\n").is_err());
    assert!(toml("[other]\nkey = 1\n").is_ok());
    assert!(trace("> 0.000000 41 42          ; 'AB'\n").is_ok());
    assert!(trace("> 0.000000 41 42\n").is_err());
    assert!(check_options("softplug send --port /dev/ttyUSB0 --dry-run").is_ok());
    assert!(check_options("softplug send --dry-walk").is_err());
    assert!(check_options("softplug job submit lathe-1 O1234.nc --wait").is_ok());
    assert!(check_options("softplug jub submit").is_err());
}
