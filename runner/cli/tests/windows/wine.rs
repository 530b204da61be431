//! A folder, and the command for Windows in it.

use std::env;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use tempfile::TempDir;

pub(crate) struct Wine {
    folder: TempDir,
}

impl Wine {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The command for Windows with these words, not started. Paths are those of Linux: wine's
    /// current drive begins at the root.
    pub(crate) fn command(&self, words: &str) -> Command {
        let mut command = Command::new("wine");
        command
            .arg(variable("SOFTPLUG_WINDOWS"))
            .args(words.split_whitespace().map(|word| word.replace('~', " ")))
            .current_dir(self.folder.path())
            .env("WINEPREFIX", prefix())
            .env("WINEDEBUG", "-all")
            .env("SOFTPLUG_PLUGINS", variable("SOFTPLUG_PLUGINS"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    pub(crate) fn run(&self, words: &str) -> Ran {
        self.command(words).output().unwrap().into()
    }

    /// Starts a simulated machine, which says where it is to be found.
    pub(crate) fn simulate(&self, words: &str) -> Machine {
        let listen = "--listen 127.0.0.1:0 --once";
        Machine::new(self.command(&format!("simulate {words} {listen}")))
    }
}

/// What runs in the background and has said its port; it is ended with the test.
pub(crate) struct Machine {
    child: Child,
    out: BufReader<std::process::ChildStdout>,
    pub(crate) port: String,
}

impl Machine {
    pub(crate) fn new(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut port = String::new();
        out.read_line(&mut port).unwrap();
        Self { child, out, port: port.trim_end().to_owned() }
    }

    /// What it says until its end.
    pub(crate) fn end(mut self) -> Ran {
        let out = self.out.by_ref().lines().map(|line| line.unwrap() + "\n").collect();
        let mut err = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        Ran { code: self.child.wait().unwrap().code(), out, err }
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// How a run ended.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Ran {
    pub(crate) fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        self
    }
}

/// The folder that wine takes for a computer.
pub(crate) fn prefix() -> PathBuf {
    variable("WINEPREFIX")
}

/// The command for this system.
pub(crate) fn native() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_softplug"));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").canonicalize().unwrap()
}

fn variable(name: &str) -> PathBuf {
    let value = env::var_os(name);
    value.unwrap_or_else(|| panic!("{name} is not set: run `cargo xtask test --windows`")).into()
}
