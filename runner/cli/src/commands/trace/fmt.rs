//! `softplug trace fmt`: traces in their one canonical form.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_trace::Trace;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::screen::Screen;

/// Writes traces in their canonical form, or checks that they are in it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug trace fmt my-case.spt
  softplug trace fmt --check fixtures/traces

A file that cannot be parsed is reported with line and column, and left as it is; the others are
done all the same, and the exit code is 2.")]
pub(super) struct Arguments {
    /// Change nothing; list the files that are in another form and exit with 1
    #[arg(long)]
    check: bool,
    /// Trace files, or folders to search for .spt files
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

#[derive(Default, Serialize)]
struct Document {
    files: usize,
    /// Files in another form, or rewritten.
    changed: Vec<String>,
    errors: Vec<Fault>,
}

#[derive(Serialize)]
struct Fault {
    file: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    column: Option<u32>,
    message: String,
}

pub(super) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let files = files::gather(&arguments.files, "spt")?;
    if files.is_empty() {
        return Err(Failure::new(Exit::NothingSelected, "there is no .spt file in these folders"));
    }
    let mut document = Document { files: files.len(), ..Document::default() };
    for path in &files {
        let file = path.display().to_string();
        let text = match files::read_text(path) {
            Ok(text) => text,
            Err(failure) => {
                screen.error(&failure.message);
                let message = failure.message;
                document.errors.push(Fault { file, line: None, column: None, message });
                continue;
            }
        };
        let formatted = match Trace::parse(&text) {
            Ok(trace) => trace.format(),
            Err(error) => {
                screen.report(error.report(&file));
                let (line, column) = (Some(error.line), Some(error.column));
                let message = error.kind.to_string();
                document.errors.push(Fault { file, line, column, message });
                continue;
            }
        };
        if formatted != text {
            if !arguments.check {
                files::replace(path, formatted.as_bytes())?;
            }
            screen.say(&file);
            document.changed.push(file);
        }
    }
    screen.document(&document);
    Ok(match document {
        Document { errors, .. } if !errors.is_empty() => Exit::Usage,
        Document { changed, .. } if arguments.check && !changed.is_empty() => Exit::Failed,
        _ => Exit::Done,
    })
}
