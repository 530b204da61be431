//! `softplug new`: a plug-in's project, which builds and passes at once.

mod files;
mod like;
mod name;
mod origin;
mod sdk;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use self::files::{Beginning, Plan, ProjectFile};
use self::like::Like;
use self::name::Name;
use self::origin::Origin;
use self::sdk::Sdk;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::unwritable;
use crate::screen::Screen;

/// Makes a project for a plug-in: a converter that works, its requirements, traces and tests.
///
/// The converter speaks a small protocol, to be replaced by yours; --like says which kind is nearest
/// to it. The folder is a corpus of its own: requirements/NAME.toml says what the protocol demands,
/// and traces/NAME shows it.
///
/// With --from it begins as a copy of a profile's reference plug-in, with the ledger and the
/// traces of that profile, for a machine that speaks nearly the same.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug new my-machine
  softplug new my-machine --like block
  softplug new my-machine --like request-reply
  softplug new my-machine --lang c
  softplug new my-machine --from xon-xoff
  softplug new my-machine --sdk ~/softplug

Then, in the new folder:
  softplug build
  softplug replay my-machine traces
  softplug certify my-machine --profile my-machine --corpus .")]
pub(crate) struct Arguments {
    /// Name of folder, plug-in and profile: a to z, 0 to 9 and single hyphens
    #[arg(value_name = "NAME")]
    name: String,
    /// The language
    #[arg(long, value_enum, default_value_t)]
    lang: Language,
    /// Kind of protocol to begin like; in C: line [default: line]
    #[arg(long, value_enum, value_name = "KIND", conflicts_with = "from")]
    like: Option<Like>,
    /// Profile whose reference plug-in to begin from; in C: xon-xoff
    #[arg(long, value_name = "PROFILE")]
    from: Option<String>,
    /// Clone of Softplug to take the Rust SDK from, instead of crates.io [env: SOFTPLUG_SDK]
    #[arg(long, value_name = "DIR")]
    sdk: Option<PathBuf>,
}

/// What a plug-in is written in.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
enum Language {
    #[default]
    Rust,
    C,
}

/// What machines get.
#[derive(Serialize)]
struct Document<'a> {
    name: &'a str,
    folder: &'a str,
    files: Vec<&'a str>,
    /// Where the SDK comes from: a folder, or a version.
    #[serde(skip_serializing_if = "Option::is_none")]
    sdk: Option<String>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let name = Name::parse(&arguments.name)?;
    let sdk = match arguments.lang {
        Language::Rust => Some(Sdk::find(arguments.sdk.as_deref())?),
        // The header comes along.
        Language::C => None,
    };
    let beginning = match (&arguments.from, arguments.lang) {
        (Some(profile), language) => {
            let (origin, profile) = Origin::of(profile, language)?;
            Beginning::From(origin, profile)
        }
        (None, Language::Rust) => Beginning::Rust(arguments.like.unwrap_or_default()),
        (None, Language::C) if arguments.like.is_none_or(|like| like == Like::Line) => Beginning::C,
        (None, Language::C) => {
            return Err(Failure::usage("in C a project begins like a line protocol alone")
                .hint("leave --like out, or write it in Rust"));
        }
    };
    let folder = Path::new(name.as_str());
    if fs::symlink_metadata(folder).is_ok() {
        return Err(Failure::usage(format_args!("{} is there already", folder.display()))
            .hint("choose another name; nothing was touched"));
    }
    let plan = Plan { name: &name, sdk: sdk.as_ref(), beginning };
    let files = plan.files();
    make(folder, &files)?;

    let sdk_text = sdk.as_ref().map(ToString::to_string);
    if let Some(sdk) = &sdk_text {
        screen.note(format_args!("the SDK is {sdk}"));
    }
    let profile = match beginning {
        Beginning::From(_, profile) => profile,
        Beginning::Rust(_) | Beginning::C => name.as_str(),
    };
    screen.say(format_args!("{name}: {} files; next:\n{}", files.len(), next(&name, profile)));
    screen.document(&Document {
        name: name.as_str(),
        folder: name.as_str(),
        files: files.iter().map(|(path, _)| path.as_str()).collect(),
        sdk: sdk_text,
    });
    Ok(Exit::Done)
}

fn next(name: &Name, profile: &str) -> String {
    format!(
        "  cd {name}\n  softplug build\n  softplug replay {name} traces\n  \
         softplug certify {name} --profile {profile} --corpus ."
    )
}

/// Makes the folder with all files, or nothing.
fn make(folder: &Path, files: &[ProjectFile]) -> Result<(), Failure> {
    let part = PathBuf::from(format!(".{}.{}.part", folder.display(), std::process::id()));
    let made = fs::create_dir(&part).and_then(|()| {
        let filled = fill(&part, files).and_then(|()| fs::rename(&part, folder));
        filled.inspect_err(|_| drop(fs::remove_dir_all(&part)))
    });
    made.map_err(|error| unwritable(folder, &error))
}

fn fill(folder: &Path, files: &[ProjectFile]) -> io::Result<()> {
    for (path, content) in files {
        let path = folder.join(path);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::write(path, content)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_made_whole_is_not_made() {
        let bench = tempfile::tempdir().unwrap();
        let files = [("a/b".to_owned(), Vec::new()), ("a/b/c".to_owned(), Vec::new())];
        fill(bench.path(), &files).unwrap_err();

        // In the working folder, as the command does it: a file cannot be a folder too.
        let name = format!("softplug-new-test-{}", std::process::id());
        make(Path::new(&name), &files).unwrap_err();
        let entries = fs::read_dir(".").unwrap().map(|entry| entry.unwrap().file_name());
        let left: Vec<_> = entries.filter(|left| left.to_string_lossy().contains(&name)).collect();
        assert_eq!(left, Vec::<std::ffi::OsString>::new());
    }
}
