//! The verbs of a gateway's library.

use std::env;
use std::path::PathBuf;

use serde::Serialize;
use softplug_host::{Host, HostOptions};
use softplug_service::library::{BadReference, Entry, Library, LibraryError, Reference};

use super::{Add, Arguments, Gc, List, Remove, Verb};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::plugin::load_failure;
use crate::screen::Screen;
use crate::table::Table;

/// Where it is if nothing is said.
const FOLDER: &str = "plugins";
const VARIABLE: &str = "SOFTPLUG_LIBRARY";

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let variable = env::var_os(VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let folder = arguments.library.clone().or(variable).unwrap_or_else(|| FOLDER.into());
    let library = match arguments.verb {
        Verb::Add(_) => Library::open(&folder),
        _ => Library::existing(&folder),
    };
    let library = library.map_err(failure)?;
    match &arguments.verb {
        Verb::Add(asked) => add(&library, asked, screen),
        Verb::List(asked) => list(&library, asked, screen),
        Verb::Show(asked) => {
            let entry = library.resolve(&reference(&asked.plugin)?).map_err(failure)?;
            screen.document(&entry);
            screen.say(describe(&entry));
            Ok(Exit::Done)
        }
        Verb::Remove(asked) => remove(&library, asked, screen),
        Verb::Gc(asked) => collect(&library, asked, screen),
    }
}

/// What machines get of a plug-in that was added.
#[derive(Serialize)]
struct JsonAdded<'a> {
    #[serde(flatten)]
    entry: &'a Entry,
    was_there: bool,
    /// SHA-256 of the module that had this name and version before.
    replaced: Option<String>,
}

fn add(library: &Library, asked: &Add, screen: &Screen) -> Result<Exit, Failure> {
    let host = Host::new(HostOptions::default()).map_err(Failure::plug_in)?;
    for file in &asked.files {
        // Loaded and not only linted: a module that cannot start is no plug-in.
        let plugin = host.load(file).map_err(|error| load_failure(file, &error))?;
        plugin.instantiate().map_err(|error| load_failure(file, &error))?;
        let added = library.add_file(file).map_err(failure)?;
        let entry = &added.entry;
        screen.json_line(&JsonAdded {
            entry,
            was_there: added.was_there,
            replaced: added.replaced.map(|digest| digest.to_string()),
        });
        let news = match (added.was_there, added.replaced) {
            (true, _) => " was there already".to_owned(),
            (_, None) => " added".to_owned(),
            (_, Some(before)) => format!(" added, in place of sha256:{before}"),
        };
        screen.say(format_args!("{}@{}{news}", entry.name, entry.version));
    }
    Ok(Exit::Done)
}

fn list(library: &Library, asked: &List, screen: &Screen) -> Result<Exit, Failure> {
    let mut entries = library.entries().map_err(failure)?;
    entries.retain(|entry| {
        let is_asked = asked.name.as_ref().is_none_or(|name| entry.name == *name);
        is_asked && (asked.all || entry.is_named)
    });
    screen.document(&entries);
    if entries.is_empty() {
        screen.note("there are no such plug-ins");
        return Ok(Exit::NothingSelected);
    }
    let mut table = Table::new(["PLUG-IN", "VERSION", "SIZE", "SHA-256", "USED BY"]);
    for entry in &entries {
        let version = if entry.is_named { &*entry.version } else { "-" };
        table.row([
            entry.name.clone(),
            version.to_owned(),
            numbers::bytes(entry.size),
            entry.digest.to_string()[..12].to_owned(),
            entry.used_by.join(", "),
        ]);
    }
    screen.say(table);
    Ok(Exit::Done)
}

fn remove(library: &Library, asked: &Remove, screen: &Screen) -> Result<Exit, Failure> {
    let entry = library.remove(&reference(&asked.plugin)?, asked.force).map_err(failure)?;
    screen.document(&entry);
    screen.say(format_args!("{}@{} removed", entry.name, entry.version));
    if library.read(entry.digest).is_ok() {
        screen.note("the module stays until `softplug plugin gc`");
    }
    Ok(Exit::Done)
}

/// What machines get of what was collected.
#[derive(Serialize)]
struct JsonGarbage {
    sha256: Vec<String>,
    bytes: u64,
    removed: bool,
}

fn collect(library: &Library, asked: &Gc, screen: &Screen) -> Result<Exit, Failure> {
    let garbage = library.collect_garbage(asked.dry_run).map_err(failure)?;
    let sha256: Vec<_> = garbage.iter().map(|object| object.digest.to_string()).collect();
    let bytes = garbage.iter().map(|object| object.size).sum();
    for digest in &sha256 {
        screen.say(format_args!("sha256:{digest}"));
    }
    let done = if asked.dry_run { "would be removed" } else { "removed" };
    let things = numbers::things(garbage.len() as u64, "module");
    screen.say(format_args!("{things} {done}, {}", numbers::bytes(bytes)));
    screen.document(&JsonGarbage { sha256, bytes, removed: !asked.dry_run });
    Ok(Exit::Done)
}

fn describe(entry: &Entry) -> String {
    let used_by =
        if entry.used_by.is_empty() { "no link".to_owned() } else { entry.used_by.join(", ") };
    format!(
        "{}@{}\n{}\n\nprotocol  {}\nsize      {}\nsha256    {}\nused by   {used_by}",
        entry.name,
        entry.version,
        entry.description,
        entry.protocol,
        numbers::bytes(entry.size),
        entry.digest,
    )
}

fn reference(text: &str) -> Result<Reference, Failure> {
    text.parse().map_err(|error: BadReference| Failure::usage(error))
}

/// Who is to blame: a module that is no plug-in, or how the command was used.
fn failure(error: LibraryError) -> Failure {
    match error {
        LibraryError::NotAPlugin(_)
        | LibraryError::Unfit(_)
        | LibraryError::Version(_)
        | LibraryError::Damaged { .. } => Failure::plug_in(error),
        LibraryError::InUse { .. } => Failure::new(Exit::Failed, error),
        LibraryError::NoLibrary(_) => {
            Failure::usage(error).hint("name another folder with --library or SOFTPLUG_LIBRARY")
        }
        error => Failure::usage(error),
    }
}
