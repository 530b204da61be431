//! A page's commands at work: a shell in an empty folder, what it shows compared with what
//! the page shows.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write as _;
use std::net::TcpListener;
use std::os::unix::fs::symlink;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};
use tempfile::TempDir;

use crate::bench::plugins;
use crate::page::{Block, repository};
use crate::transcript::{self, Step, difference};

/// Longer than anything takes, building from nothing included; only a hang gets there.
const HANG: Duration = Duration::from_mins(15);
/// Longer than anything takes that is built already.
const SLOW: Duration = Duration::from_mins(2);

/// A shell, and the programs that stay while the page goes on.
pub(crate) struct Session {
    /// What the page sees.
    folder: TempDir,
    /// Of the test alone: outputs, and the programs that PATH begins with.
    own: TempDir,
    shell: Child,
    input: ChildStdin,
    staying: Vec<Staying>,
    steps: usize,
    /// All that was shown: a `…` in a command stands for what came in its place.
    seen: String,
    /// Addresses of the page, and those that are free here.
    addresses: BTreeMap<String, String>,
}

/// A program that runs until the page ends, or until it is interrupted.
struct Staying {
    child: Child,
    output: PathBuf,
}

impl Session {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let own = tempfile::tempdir().unwrap();
        let programs = own.path().join("programs");
        fs::create_dir(&programs).unwrap();
        symlink(env!("CARGO_BIN_EXE_softplug"), programs.join("softplug")).unwrap();
        if let Some(python) = find("python_wasmtime") {
            fs::write(
                programs.join("python3"),
                format!("#!/bin/sh\nexec {} \"$@\"\n", python.display()),
            )
            .unwrap();
            make_executable(&programs.join("python3"));
        }
        let mut shell = bash(folder.path(), own.path());
        let mut shell = shell.stdin(Stdio::piped()).spawn().unwrap();
        let input = shell.stdin.take().unwrap();
        let (steps, seen) = (0, String::new());
        Self {
            folder,
            own,
            shell,
            input,
            staying: Vec::new(),
            steps,
            seen,
            addresses: BTreeMap::new(),
        }
    }

    /// Puts a block into a file, or behind what is in it. A word that ends in `…` stands for what was
    /// shown, as in a command.
    pub(crate) fn write(&mut self, name: &str, text: &str, append: bool) {
        let path = self.folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let text = self.filled(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut file =
            File::options().create(true).append(append).truncate(!append).write(true).open(&path);
        file.as_mut().unwrap().write_all(text.as_bytes()).unwrap();
    }

    /// Gives the page a plug-in of ours.
    pub(crate) fn give(&self, name: &str) {
        fs::copy(plugins().join(name), self.folder.path().join(name)).unwrap();
    }

    /// What a checkout has, for pages that are read in one.
    pub(crate) fn check_out(&self) {
        let folder = self.folder.path();
        fs::create_dir_all(folder.join("target")).unwrap();
        for name in ["docs", "fixtures", "plugins", "sdk"] {
            let _ = symlink(repository().join(name), folder.join(name));
        }
        let _ = symlink(plugins(), folder.join("target/plugins"));
    }

    /// Runs the commands of a block.
    pub(crate) fn run(&mut self, block: &Block) -> Result<(), String> {
        let steps = transcript::read(&block.text)?;
        for (at, step) in steps.iter().enumerate() {
            let stays = block.has("stays") && at + 1 == steps.len();
            let is_asked =
                steps.get(at + 1).is_some_and(|next| next.command.starts_with("echo $?"));
            let result = if stays { self.stay(step) } else { self.step(step, is_asked) };
            result.map_err(|error| {
                format!("line {}: $ {}\n{error}", block.line + step.line, step.command)
            })?;
        }
        Ok(())
    }

    /// What only looks may look too early, where a gateway is at work meanwhile: it looks again.
    fn step(&mut self, step: &Step, is_asked: bool) -> Result<(), String> {
        let begin = Instant::now();
        loop {
            let result = self.step_once(step, is_asked);
            let looks_again = !self.staying.is_empty() && only_looks(&step.command);
            if result.is_ok() || !looks_again || begin.elapsed() > SLOW {
                return result;
            }
            sleep(Duration::from_millis(100));
        }
    }

    fn step_once(&mut self, step: &Step, is_asked: bool) -> Result<(), String> {
        self.steps += 1;
        let output = self.own.path().join(format!("{}.out", self.steps));
        let ended = self.own.path().join(format!("{}.code", self.steps));
        let command = self.filled(&step.command)?;
        // The code of the one before stays there for `echo $?`.
        write!(
            self.input,
            "{gateway}{{ (exit ${{code:-0}})\n{command}\n}} </dev/null >{out} 2>&1\ncode=$?\necho $code >{code}.new\nmv {code}.new {code}\n",
            gateway = self.gateway(),
            out = output.display(),
            code = ended.display(),
        )
        .map_err(|error| format!("the shell has ended: {error}"))?;
        let begin = Instant::now();
        while !ended.exists() {
            let is_over = self.shell.try_wait().unwrap().is_some();
            if is_over || begin.elapsed() > HANG {
                let why = if is_over { "the shell ended" } else { "it does not end" };
                return Err(format!("{why}:\n{}", read(&output)));
            }
            sleep(Duration::from_millis(5));
        }
        let code = read(&ended);
        let shown = self.remember(&output);
        if code.trim() != "0" && !is_asked {
            return Err(format!("ended with {}:\n{shown}", code.trim()));
        }
        difference(&step.shown, &shown).map_or(Ok(()), Err)
    }

    /// Starts what goes on while the page does; with `^C` it is interrupted there.
    fn stay(&mut self, step: &Step) -> Result<(), String> {
        self.steps += 1;
        let output = self.own.path().join(format!("{}.out", self.steps));
        let file = File::create(&output).unwrap();
        let mut command = bash(self.folder.path(), self.own.path());
        command.args(["-c", &self.filled(&step.command)?]).stdin(Stdio::null()).process_group(0);
        let child = command.stdout(file.try_clone().unwrap()).stderr(file).spawn().unwrap();
        let mut staying = Staying { child, output };
        let end = step.shown.iter().position(|line| line == "^C");
        let expected = &step.shown[..end.unwrap_or(step.shown.len())];
        let begin = Instant::now();
        // What comes later is not looked at: it goes on.
        let goes_on: Vec<String> = expected.iter().cloned().chain(["…".to_owned()]).collect();
        while let Some(different) = difference(&goes_on, &self.as_on_the_page(&staying.output)) {
            if begin.elapsed() > SLOW || staying.child.try_wait().unwrap().is_some() {
                return Err(different);
            }
            sleep(Duration::from_millis(10));
        }
        self.remember(&staying.output);
        if let Some(end) = end {
            staying.interrupt();
            let all = [&step.shown[..end], &step.shown[end + 1..]].concat();
            let shown = self.as_on_the_page(&staying.output);
            return difference(&all, &shown).map_or(Ok(()), Err);
        }
        self.staying.push(staying);
        Ok(())
    }

    /// What was shown, with the page's addresses in it.
    fn as_on_the_page(&self, output: &Path) -> String {
        self.addresses
            .iter()
            .fold(read(output), |shown, (theirs, ours)| shown.replace(ours.as_str(), theirs))
    }

    fn remember(&mut self, output: &Path) -> String {
        let shown = self.as_on_the_page(output);
        self.seen += &shown;
        shown
    }

    /// A word that ends in `…` stands for the last one seen that begins so.
    fn filled(&mut self, command: &str) -> Result<String, String> {
        let mut filled = String::new();
        let mut rest = command;
        while let Some((before, after)) = rest.split_once('…') {
            let is_end = |c: char| c.is_whitespace() || "\"'=();<>".contains(c);
            let word = &before[before.rfind(is_end).map_or(0, |at| at + 1)..];
            let at = self.seen.rfind(word).filter(|_| !word.is_empty());
            let at = at.ok_or_else(|| format!("nothing that begins with {word} was shown"))?;
            let seen = &self.seen[at + word.len()..];
            filled += before;
            filled += &seen[..seen
                .find(|c: char| c.is_whitespace() || ",;'\"".contains(c))
                .unwrap_or(seen.len())];
            rest = after;
        }
        filled += rest;
        Ok(self.with_addresses(&filled))
    }

    /// Where the command looks for the page's gateway if nothing is said.
    fn gateway(&self) -> String {
        let address = self.addresses.get("127.0.0.1:8117");
        address.map_or(String::new(), |ours| format!("export SOFTPLUG_GATEWAY=http://{ours}\n"))
    }

    /// Ports that are free here in the place of those in the text.
    fn with_addresses(&mut self, text: &str) -> String {
        const HOST: &str = "127.0.0.1:";
        let mut parts = text.split(HOST);
        let mut made = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let digits = part.find(|c: char| !c.is_ascii_digit()).unwrap_or(part.len());
            let theirs = format!("{HOST}{}", &part[..digits]);
            let ours = self.addresses.entry(theirs).or_insert_with(free_address);
            made += ours;
            made += &part[digits..];
        }
        made
    }

    /// Ends what still runs.
    pub(crate) fn end(mut self) {
        for mut staying in self.staying.drain(..) {
            staying.interrupt();
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        for staying in &mut self.staying {
            staying.signal(Signal::KILL);
            let _ = staying.child.wait();
        }
        let _ = self.shell.kill();
        let _ = self.shell.wait();
    }
}

impl Staying {
    fn signal(&self, signal: Signal) {
        let _ = kill_process_group(Pid::from_child(&self.child), signal);
    }

    /// As Ctrl-C does; one that goes on all the same is killed, and that is an error.
    fn interrupt(&mut self) {
        self.signal(Signal::INT);
        let begin = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            if begin.elapsed() > SLOW {
                self.signal(Signal::KILL);
                panic!("it does not end by Ctrl-C:\n{}", read(&self.output));
            }
            sleep(Duration::from_millis(10));
        }
    }
}

/// Whether a command changes nothing, so that it can be given again.
fn only_looks(command: &str) -> bool {
    let is_question = ["softplug link list", "softplug link show", "cat "];
    let sends = [" -T", " -X", " -d", " --json", " --data", " --request"];
    is_question.iter().any(|begin| command.starts_with(begin))
        || (command.starts_with("curl ") && !sends.iter().any(|option| command.contains(option)))
}

/// A shell as somebody has it who has installed the command, and nothing of this build's.
fn bash(folder: &Path, own: &Path) -> Command {
    let mut command = Command::new("bash");
    command.args(["--noprofile", "--norc"]).current_dir(folder);
    for (name, _) in std::env::vars_os() {
        let name = name.to_string_lossy().into_owned();
        let is_ours = ["CARGO", "RUSTFLAGS", "RUSTDOC", "SOFTPLUG_", "INSTA_", "__CARGO"]
            .iter()
            .any(|prefix| name.starts_with(prefix));
        if is_ours && name != "CARGO_HOME" && !name.starts_with("CARGO_NET") {
            command.env_remove(name);
        }
    }
    let path = std::env::var("PATH").unwrap_or_default();
    command
        .env("PATH", format!("{}:{path}", own.join("programs").display()))
        .env("SOFTPLUG_PLUGINS", plugins())
        .env("SOFTPLUG_SDK", repository())
        .env("CARGO_NET_OFFLINE", "true")
        // The SDK is built once for all pages.
        .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).join("kit"))
        .env("LC_ALL", "C.UTF-8")
        .env("NO_COLOR", "1")
        .env("CARGO_TERM_COLOR", "never")
        .env_remove("COLUMNS");
    command
}

fn find(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join(program)).find(|file| file.is_file())
}

fn make_executable(path: &Path) {
    use std::os::unix::fs::PermissionsExt as _;
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

fn read(path: &Path) -> String {
    String::from_utf8_lossy(&fs::read(path).unwrap_or_default()).into_owned()
}

fn free_address() -> String {
    TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr()).unwrap().to_string()
}
