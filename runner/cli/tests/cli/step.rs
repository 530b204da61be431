//! Walking through a case, in a real terminal.

use std::fs::{File, OpenOptions};
use std::process::Child;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use rustix::termios::{Winsize, tcsetwinsize};
use softplug_live::ReadOutcome;
use softplug_live::pty::PtyPair;

use crate::bench::{Bench, snapshot};
use crate::files::TRACE;

/// How long something that must come may take on a busy machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// The command on a terminal of its own.
struct Terminal {
    pty: PtyPair,
    slave: File,
    child: Child,
    columns: u16,
    seen: String,
}

impl Terminal {
    fn start(bench: &Bench, arguments: &[&str]) -> Self {
        let pty = PtyPair::open().unwrap();
        let slave = OpenOptions::new().read(true).write(true).open(pty.slave_path()).unwrap();
        let mut command = bench.command(arguments);
        command.stdin(slave.try_clone().unwrap()).stdout(slave.try_clone().unwrap());
        size(&slave, 100);
        let child = command.env("TERM", "xterm").spawn().unwrap();
        Self { pty, slave, child, columns: 100, seen: String::new() }
    }

    fn type_keys(&mut self, keys: &[u8]) {
        assert_eq!(self.pty.write(keys).unwrap(), keys.len());
        self.seen.clear();
        self.redraw();
    }

    /// Has all of the screen drawn anew: otherwise only what changes is.
    fn redraw(&mut self) {
        self.columns = if self.columns == 100 { 101 } else { 100 };
        size(&self.slave, self.columns);
        kill_process(Pid::from_child(&self.child), Signal::WINCH).unwrap();
    }

    #[track_caller]
    fn sees(&mut self, text: &str) {
        let began = Instant::now();
        let mut drawn = began;
        let mut buffer = [0; 4_096];
        while !plain(&self.seen).contains(text) {
            assert!(began.elapsed() < PATIENCE, "never seen: {text}\n{}", plain(&self.seen));
            match self.pty.read(&mut buffer).unwrap() {
                ReadOutcome::Read(count) => {
                    self.seen.push_str(&String::from_utf8_lossy(&buffer[..count]));
                }
                // The keys may have come after the order to draw.
                _ if drawn.elapsed() > Duration::from_millis(500) => {
                    drawn = Instant::now();
                    self.redraw();
                }
                _ => std::thread::sleep(Duration::from_millis(10)),
            }
        }
    }

    fn end(mut self) -> i32 {
        self.pty.write(b"q").unwrap();
        let mut buffer = [0; 4_096];
        // Nobody ends who cannot write.
        ended(&mut self.child, || drop(self.pty.read(&mut buffer)))
    }
}

/// The exit code, once there is one.
#[track_caller]
fn ended(child: &mut Child, mut meanwhile: impl FnMut()) -> i32 {
    let began = Instant::now();
    loop {
        meanwhile();
        if let Some(status) = child.try_wait().unwrap() {
            return status.code().unwrap();
        }
        assert!(began.elapsed() < PATIENCE, "it does not end");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Without what moves the cursor, over blanks for the most part, or colours.
fn plain(seen: &str) -> String {
    let mut parts = seen.split("\u{1b}[");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| c.is_ascii_alphabetic()).map_or(part.len(), |at| at + 1);
        plain.push_str(if part[..end].ends_with('H') { " " } else { "" });
        plain.push_str(&part[end..]);
    }
    plain
}

fn size(slave: &File, columns: u16) {
    let size = Winsize { ws_row: 30, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(slave, size).unwrap();
}

#[test]
fn a_case_is_walked_through_with_keys() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    bench.write(file, TRACE);
    let mut terminal = Terminal::start(&bench, &["replay", "xon-xoff", file, "--step"]);
    terminal.sees("step 1 of");
    terminal.sees("passed");
    terminal.type_keys(b"\x1b[C");
    terminal.sees("step 2 of");
    terminal.type_keys(b"G");
    terminal.sees("job 1 done, 2 bytes sent");
    terminal.seen.clear();
    terminal.type_keys(b"\x1b[H");
    terminal.sees("step 1 of");
    assert_eq!(terminal.end(), 0);

    bench.write(file, TRACE.replace("41             ; 'A'", "43             ; 'C'"));
    let swapped = ["replay", "xon-xoff", file, "--step", "--only", "xon-xoff.tx.first/swap:all"];
    let mut terminal = Terminal::start(&bench, &swapped);
    terminal.sees("FAILED");
    terminal.sees("swap:all");
    assert_eq!(terminal.end(), 1);
}

#[test]
fn it_ends_when_its_terminal_is_gone() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    bench.write(file, TRACE);
    let mut terminal = Terminal::start(&bench, &["replay", "xon-xoff", file, "--step"]);
    terminal.sees("step 1 of");
    // No session has this terminal as its own, so that nobody is sent SIGHUP.
    let Terminal { pty, slave, mut child, .. } = terminal;
    drop((pty, slave));
    assert_eq!(ended(&mut child, || ()), 5);
}

#[test]
fn without_a_terminal_and_with_several_cases_it_says_what_to_do() {
    let bench = Bench::new();
    bench.write("xon-xoff.tx.first.spt", TRACE);
    let two = TRACE.replace("xon-xoff.tx.first", "xon-xoff.tx.second");
    bench.write("xon-xoff.tx.second.spt", two);
    let step = |files: &[&str]| {
        let arguments = [&["replay", "xon-xoff", "--step"], files].concat();
        bench.run(&arguments).with_code(2).err
    };
    let mut text = step(&["xon-xoff.tx.first.spt"]);
    text += &step(&["xon-xoff.tx.first.spt", "xon-xoff.tx.second.spt"]);
    snapshot("step-refusals", text);
}
