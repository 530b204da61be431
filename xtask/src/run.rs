//! Runs other programs: says what it runs, and what went wrong with it.

use std::ffi::OsStr;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::process::{Command, ExitStatus, Stdio};
use std::thread;

/// A program could not be run, or failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    #[error("`{program}` is not installed: put it into PATH and run this again")]
    Missing { program: String },
    #[error("`{program}` cannot be started: {cause}")]
    Start { program: String, cause: io::Error },
    #[error("`{line}` failed ({status}): its own message stands above")]
    Failed { line: String, status: ExitStatus },
    #[error("the output of `{program}` cannot be read: {cause}")]
    Output { program: String, cause: io::Error },
}

/// The cargo that runs this task, so that all is built by one toolchain.
pub(crate) fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Runs to the end with this terminal, whatever the exit status.
pub(crate) fn status(command: &mut Command) -> Result<ExitStatus, RunError> {
    eprintln!("$ {}", line(command));
    command.status().map_err(|cause| start_error(command, cause))
}

/// Runs to the end with this terminal; a status other than 0 is an error.
pub(crate) fn succeed(command: &mut Command) -> Result<(), RunError> {
    let status = status(command)?;
    if status.success() {
        return Ok(());
    }
    Err(RunError::Failed { line: line(command), status })
}

/// Standard output of a quiet program that must succeed.
pub(crate) fn output(command: &mut Command) -> Result<String, RunError> {
    let output =
        command.stderr(Stdio::inherit()).output().map_err(|cause| start_error(command, cause))?;
    if !output.status.success() {
        return Err(RunError::Failed { line: line(command), status: output.status });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What a program printed and how it ended.
pub(crate) struct Heard {
    pub(crate) status: ExitStatus,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// Runs to the end, passes on what it prints line by line, and keeps it.
pub(crate) fn overhear(command: &mut Command) -> Result<Heard, RunError> {
    eprintln!("$ {}", line(command));
    let program = program(command);
    let unreadable = |cause| RunError::Output { program: program.clone(), cause };
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|cause| start_error(command, cause))?;
    let errors = child.stderr.take().expect("stderr is piped");
    let errors = thread::spawn(move || pass_on(errors, &mut io::stderr()));
    let stdout = child.stdout.take().expect("stdout is piped");
    let stdout = pass_on(stdout, &mut io::stdout()).map_err(unreadable)?;
    let stderr = errors.join().expect("passing on does not panic").map_err(unreadable)?;
    let status = child.wait().map_err(unreadable)?;
    Ok(Heard { status, stdout, stderr })
}

/// Where PATH has a program of this name.
pub(crate) fn find(program: &str) -> Option<std::path::PathBuf> {
    let path = std::env::var_os("PATH")?;
    let name = format!("{program}{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&path).map(|folder| folder.join(&name)).find(|file| file.is_file())
}

fn pass_on(from: impl Read, to: &mut impl Write) -> io::Result<String> {
    let mut from = BufReader::new(from);
    let mut kept = String::new();
    let mut piece = Vec::new();
    while from.read_until(b'\n', &mut piece)? > 0 {
        // A closed terminal is no reason to lose the result.
        let _ = to.write_all(&piece).and_then(|()| to.flush());
        kept.push_str(&String::from_utf8_lossy(&piece));
        piece.clear();
    }
    Ok(kept)
}

fn start_error(command: &Command, cause: io::Error) -> RunError {
    let program = program(command);
    if cause.kind() == io::ErrorKind::NotFound {
        return RunError::Missing { program };
    }
    RunError::Start { program, cause }
}

fn program(command: &Command) -> String {
    command.get_program().to_string_lossy().into_owned()
}

/// The command as one would type it, with the program's bare name.
fn line(command: &Command) -> String {
    let name =
        std::path::Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    std::iter::once(name).chain(command.get_args()).map(quoted).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    if word.is_empty() || word.contains(|c: char| c.is_whitespace() || "'\"()&|$*".contains(c)) {
        return format!("'{}'", word.replace('\'', r"'\''"));
    }
    word.into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_named() {
        let error = succeed(&mut Command::new("softplug-no-such-program")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "`softplug-no-such-program` is not installed: put it into PATH and run this again"
        );
    }

    #[test]
    fn a_command_is_shown_as_typed() {
        let mut command = Command::new("/usr/bin/cargo");
        command.args(["run", "--", "a b", "it's", ""]);
        assert_eq!(line(&command), r"cargo run -- 'a b' 'it'\''s' ''");
    }

    #[test]
    fn both_streams_are_kept() {
        let mut command = cargo();
        command.arg("--softplug-no-such-option");
        let heard = overhear(&mut command).unwrap();
        assert!(!heard.status.success());
        assert!(heard.stderr.contains("--softplug-no-such-option"), "{}", heard.stderr);
        let heard = overhear(cargo().arg("--version")).unwrap();
        assert!(heard.status.success());
        assert!(heard.stdout.starts_with("cargo "), "{}", heard.stdout);
    }
}
