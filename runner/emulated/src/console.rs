//! A shell in the guest, spoken to over its first serial port, which is raw and echoes nothing.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;

use crate::HANG;

/// What the guest's `init` says when its shell reads commands.
const READY: &str = "console ready";
/// The most of the guest's own words that are kept: the kernel may say much before it panics.
const CHATTER_LINES: usize = 10_000;

/// How a command in the guest ended.
#[derive(Clone, Debug)]
pub struct Ran {
    /// Its exit code; 128 and more for a signal.
    pub code: i32,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Ran {
    /// Fails if it ended otherwise.
    #[track_caller]
    pub fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, code, "{self}");
        self
    }

    /// The JSON document on standard output.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self}"))
    }
}

impl std::fmt::Display for Ran {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { code, out, err } = self;
        write!(f, "exit code {code}\n--- standard output\n{out}--- standard error\n{err}")
    }
}

/// The shell.
pub(crate) struct Console {
    out: UnixStream,
    input: BufReader<UnixStream>,
}

impl Console {
    pub(crate) fn new(stream: UnixStream) -> Self {
        stream.set_read_timeout(Some(HANG)).unwrap();
        Self { out: stream.try_clone().unwrap(), input: BufReader::new(stream) }
    }

    /// Waits until the guest has booted.
    pub(crate) fn until_ready(&mut self) {
        self.line_with(READY);
    }

    /// Runs a script and waits for its end.
    #[track_caller]
    pub(crate) fn run(&mut self, script: &str) -> Ran {
        // The sizes come first: what is printed may be anything.
        let line = format!(
            "( {script}\n) </dev/null >/run/out 2>/run/err; \
             code=$?; echo; echo \"ran $code $(wc -c </run/out) $(wc -c </run/err)\"; cat /run/out /run/err\n"
        );
        self.out.write_all(line.as_bytes()).expect("the console takes commands");
        let line = self.line_with("ran ");
        let numbers: Vec<usize> =
            line.split_whitespace().skip(1).map(|number| number.parse().unwrap()).collect();
        let &[code, out, err] = &numbers[..] else { panic!("not a result: {line}") };
        Ran { code: code as i32, out: self.text(out), err: self.text(err) }
    }

    /// The next line that begins with this; the kernel may have its say before.
    #[track_caller]
    fn line_with(&mut self, begin: &str) -> String {
        let mut chatter = String::new();
        for _ in 0..CHATTER_LINES {
            let mut line = Vec::new();
            let read = self.input.read_until(b'\n', &mut line);
            let line = String::from_utf8_lossy(&line);
            match read {
                Ok(count) if count > 0 => {}
                end => panic!("the guest's console ended ({end:?}):\n{chatter}{line}"),
            }
            if line.starts_with(begin) {
                return line.trim_end().to_owned();
            }
            chatter += &line;
        }
        panic!("the guest talks and talks:\n{chatter}");
    }

    fn text(&mut self, bytes: usize) -> String {
        let mut text = vec![0; bytes];
        self.input.read_exact(&mut text).expect("the output comes whole");
        String::from_utf8_lossy(&text).into_owned()
    }
}
