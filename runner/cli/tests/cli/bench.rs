//! A folder to run the command in, and what came of it.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use tempfile::TempDir;

/// A fresh folder, in which the command runs.
pub(crate) struct Bench {
    folder: TempDir,
}

/// How a run ended.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file, in folders that are made.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, content).unwrap();
        path
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// Names of all files in the folder.
    pub(crate) fn names(&self) -> Vec<String> {
        Self::names_in(self.folder.path())
    }

    /// The names in any folder.
    pub(crate) fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let name = |entry: std::io::Result<fs::DirEntry>| {
            entry.unwrap().file_name().into_string().unwrap()
        };
        let mut names: Vec<_> = entries.map(name).collect();
        names.sort();
        names
    }

    /// The command, not started.
    pub(crate) fn command<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_softplug"));
        command
            .args(arguments)
            .current_dir(self.folder.path())
            .env("SOFTPLUG_PLUGINS", plugins())
            .env_remove("SOFTPLUG_LOG")
            .env_remove("COLUMNS")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// The command where no file may have a byte, not started.
    #[cfg(unix)]
    pub(crate) fn without_room(&self, arguments: &[&str]) -> Command {
        let asked = self.command(arguments);
        let mut command = Command::new("sh");
        let script = "ulimit -f 0; exec \"$0\" \"$@\"";
        command.args(["-c", script]).arg(asked.get_program()).args(asked.get_args());
        command.current_dir(self.folder.path());
        command.envs(asked.get_envs().filter_map(|(name, value)| Some((name, value?))));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs the command to its end.
    pub(crate) fn run<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Ran {
        self.command(arguments).output().unwrap().into()
    }
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().expect("it was not killed"),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Ran {
    /// The only JSON document on standard output.
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    pub(crate) fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, code, "{self:#?}");
        self
    }
}

impl std::fmt::Display for Ran {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { code, out, err } = self;
        write!(f, "exit code {code}\n--- standard output\n{out}--- standard error\n{err}")
    }
}

/// Compares with the snapshot of this name; what differs between machines is
/// taken out.
pub(crate) fn snapshot(name: &str, text: impl std::fmt::Display) {
    let mut settings = insta::Settings::clone_current();
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.add_filter(r"\b[0-9a-f]{64}\b", "[sha256]");
    settings.add_filter(r"/dev/pts/\d+", "[pty]");
    settings.add_filter(r"process \d+", "process [pid]");
    settings.add_filter(r"(softplug|xon-xoff) \d+\.\d+\.\d+", "$1 [version]");
    settings.add_filter(r#"("version": )"[^"]*""#, "$1[version]");
    settings.add_filter(r"(size +)[\d,]+ bytes", "$1[size]");
    settings.add_filter(r#"("size": )\d+"#, "$1[size]");
    settings.add_filter(r"(fuel +)[\d,.]+ units a byte, at most [\d,]+", "$1[fuel]");
    settings.add_filter(r"\d+ places of the module", "[number of] places of the module");
    settings.add_filter(r"(?s)(executed )[\d,]+ of [\d,]+ functions.*?and \d+ more", "$1[places]");
    settings.add_filter(&regex_of(&plugins()), "[plugins]");
    let executable = Path::new(env!("CARGO_BIN_EXE_softplug"));
    let beside = executable.parent().and_then(Path::parent).unwrap();
    settings.add_filter(&regex_of(beside), "[target]");
    settings.bind(|| insta::assert_snapshot!(name, text.to_string()));
}

fn regex_of(path: &Path) -> String {
    let mut escaped = String::new();
    for c in path.to_str().unwrap().chars() {
        if !c.is_alphanumeric() && c != '/' {
            escaped.push('\\');
        }
        escaped.push(c);
    }
    escaped
}

/// The names of the reference plug-ins.
fn names() -> impl Iterator<Item = &'static str> {
    softplug_native::NativePlugin::ALL.iter().map(|plugin| plugin.name())
}

/// The folder with the plug-ins: the one that SOFTPLUG_PLUGINS names, or one
/// that is built here, so that they are never older than their source.
pub(crate) fn plugins() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| match std::env::var_os("SOFTPLUG_PLUGINS") {
        Some(folder) if !folder.is_empty() => PathBuf::from(folder),
        _ => build(),
    });
    for name in names() {
        let file = folder.join(format!("{name}.wasm"));
        assert!(file.is_file(), "there is no {}", file.display());
    }
    folder.clone()
}

fn build() -> PathBuf {
    let executable = Path::new(env!("CARGO_BIN_EXE_softplug"));
    let target = executable.parent().and_then(Path::parent).unwrap();
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--profile", "plugin", "--target", "wasm32v1-none"])
        .arg("--lib")
        .args(names().map(|name| format!("--package=softplug-{name}")))
        // For the options that stand in .cargo/config.toml.
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .env("CARGO_TARGET_DIR", target)
        .status()
        .unwrap();
    assert!(built.success(), "the plug-in cannot be built: `rustup target add wasm32v1-none`");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("plugins");
    fs::create_dir_all(&folder).unwrap();
    for name in names() {
        let module = format!("wasm32v1-none/plugin/{}.wasm", name.replace('-', "_"));
        fs::copy(target.join(module), folder.join(format!("{name}.wasm"))).unwrap();
    }
    folder
}

/// A program of the project's own.
pub(crate) fn program(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/nc");
    fs::read(folder.join(name)).unwrap()
}
