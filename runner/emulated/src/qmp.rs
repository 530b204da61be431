//! QEMU's control socket: one JSON document a line each way.

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;

use serde_json::{Value, json};
use thiserror::Error;

use crate::HANG;

/// Why a command has no answer.
#[derive(Debug, Error)]
pub(crate) enum QmpError {
    #[error(transparent)]
    NotAsked(#[from] io::Error),
    #[error("it has ended")]
    Ended,
    #[error("no answer: {0}")]
    NoAnswer(io::Error),
    #[error("{error}: {line}")]
    NoJson { line: String, error: serde_json::Error },
    /// What QEMU says.
    #[error("{0}")]
    Refused(Value),
}

/// The control connection of one QEMU.
pub(crate) struct Qmp {
    out: UnixStream,
    input: BufReader<UnixStream>,
}

impl Qmp {
    /// Greets, as the protocol wants it before anything else.
    pub(crate) fn new(stream: UnixStream) -> Self {
        stream.set_read_timeout(Some(HANG)).unwrap();
        let out = stream.try_clone().unwrap();
        let mut qmp = Self { out, input: BufReader::new(stream) };
        let greeting = qmp.read();
        assert!(greeting.get("QMP").is_some(), "no greeting of QEMU: {greeting}");
        qmp.ask("qmp_capabilities", &json!({}));
        qmp
    }

    /// Carries out a command and gives its answer.
    #[track_caller]
    pub(crate) fn ask(&mut self, command: &str, arguments: &Value) -> Value {
        self.try_ask(command, arguments).unwrap_or_else(|error| panic!("{command}: {error}"))
    }

    /// Asks a machine that may be gone.
    pub(crate) fn try_ask(&mut self, command: &str, arguments: &Value) -> Result<Value, QmpError> {
        let line = json!({ "execute": command, "arguments": arguments }).to_string() + "\n";
        self.out.write_all(line.as_bytes())?;
        loop {
            let mut answer = self.try_read()?;
            if let Some(error) = answer.get("error") {
                return Err(QmpError::Refused(error.clone()));
            }
            if let Some(value) = answer.get_mut("return") {
                return Ok(value.take());
            }
            // An event: whatever it tells shows in the guest as well.
        }
    }

    fn read(&mut self) -> Value {
        self.try_read().unwrap_or_else(|error| panic!("QEMU: {error}"))
    }

    fn try_read(&mut self) -> Result<Value, QmpError> {
        let mut line = String::new();
        match self.input.read_line(&mut line) {
            Ok(0) => Err(QmpError::Ended),
            Ok(_) => serde_json::from_str(&line).map_err(|error| QmpError::NoJson { line, error }),
            Err(error) => Err(QmpError::NoAnswer(error)),
        }
    }
}
