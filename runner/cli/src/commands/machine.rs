//! `softplug machine`: the catalogue of machines.

use std::fmt::Write as _;

use clap::{Args, Subcommand};
use softplug_catalogue::{Flow, Machine, ProgramNames};

use crate::exit::Exit;
use crate::failure::Failure;
use crate::machine::{Machines, find};
use crate::screen::{HEADING, Screen};
use crate::table::Table;

/// Lists machines and shows how each is spoken to.
///
/// A machine is a file: plug-in, line, settings, and what is set at the control, each with its
/// source. --machine of `send`, `receive` and `check` takes one. Files of your own go into a folder; one
/// with the name of a machine that is known takes its place.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug machine list
  softplug machine show haas-vf
  softplug machine show old-mill --machines our-machines --json")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    #[command(after_help = "Examples:
  softplug machine list
  softplug machine list --machines my-machines --json")]
    List(List),
    #[command(after_help = "Examples:
  softplug machine show haas-vf
  softplug machine show fanuc-0m --json")]
    Show(Show),
}

/// Lists the machines
#[derive(Debug, Args)]
struct List {
    #[command(flatten)]
    machines: Machines,
}

/// Shows one machine: what to give here, and what to set there
#[derive(Debug, Args)]
struct Show {
    /// Which
    #[arg(value_name = "MACHINE")]
    name: String,
    #[command(flatten)]
    machines: Machines,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    match &arguments.verb {
        Verb::List(List { machines }) => {
            let catalogue = machines.load()?;
            screen.document(&catalogue.machines());
            let mut table = Table::new(["MACHINE", "PLUG-IN", "LINE", "WHAT"]);
            for machine in catalogue.machines() {
                let Machine { name, plugin, line, title, .. } = machine.clone();
                table.row([name, plugin, line.unwrap_or_default(), title]);
            }
            screen.say(table);
        }
        Verb::Show(Show { name, machines }) => {
            let catalogue = machines.load()?;
            let machine = find(&catalogue, name)?;
            screen.document(machine);
            screen.say(describe(machine));
        }
    }
    Ok(Exit::Done)
}

fn describe(machine: &Machine) -> String {
    let mut text = format!("{HEADING}{}{HEADING:#}", machine.name);
    let mut line = |line: &str| {
        let _ = write!(text, "\n{line}");
    };
    line(&machine.title);
    line("");
    line(&format!("plug-in   {}", machine.plugin));
    if let Some(usual) = &machine.line {
        let others = machine.lines.iter().map(|other| format!(", or {other}"));
        line(&format!("line      {usual}{}", others.collect::<String>()));
    }
    if let Some(flow) = machine.flow {
        line(&format!("holds by  {}", held_by(flow)));
    }
    if let Some(tape) = &machine.tape {
        line(&format!("tape      {tape}"));
    }
    for (name, value) in &machine.settings {
        line(&format!("setting   {name}={value}"));
    }
    if let Some(names) = &machine.names {
        line(&format!("programs  {}", described(names)));
    }
    if !machine.at_control.is_empty() {
        let mut table = Table::new(["AT THE CONTROL", "", "SET", "NOTE"]);
        for set in machine.at_control.clone() {
            let note = set.note.unwrap_or_default();
            table.row([set.place, set.name.unwrap_or_default(), set.value, note]);
        }
        line("");
        line(&table.to_string());
    }
    for (title, remarks) in [("CABLE", &machine.cable), ("UNSURE", &machine.unsure)] {
        if !remarks.is_empty() {
            line("");
            line(&format!("{HEADING}{title}{HEADING:#}"));
        }
        for remark in remarks {
            line(&remark.note);
        }
    }
    if !machine.sources.is_empty() {
        line("");
        line(&format!("{HEADING}SOURCES{HEADING:#}"));
    }
    for source in &machine.sources {
        let says = source.says.iter().map(|says| format!(": {says}"));
        line(&format!("{}{}", source.title, says.collect::<String>()));
        if let Some(url) = &source.url {
            line(&format!("  {url}"));
        }
    }
    text
}

fn held_by(flow: Flow) -> &'static str {
    match flow {
        Flow::XonXoff => "XON/XOFF",
        Flow::RtsCts => "RTS/CTS",
        Flow::Both => "XON/XOFF and RTS/CTS",
    }
}

fn described(names: &ProgramNames) -> String {
    let mut text = names.form.clone();
    for form in &names.also {
        let _ = write!(text, " or {form}");
    }
    if let Some(digits) = names.digits {
        let _ = write!(text, ", {digits} digits");
    }
    if let Some(characters) = &names.characters {
        let _ = write!(text, ", of {characters}");
    }
    if let Some(longest) = names.longest {
        let _ = write!(text, ", at most {longest} characters");
    }
    text
}
