//! QEMU's control socket: one JSON document a line each way.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;

use serde_json::{Value, json};

use crate::HANG;

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
    pub(crate) fn try_ask(&mut self, command: &str, arguments: &Value) -> Result<Value, String> {
        let line = json!({ "execute": command, "arguments": arguments }).to_string() + "\n";
        self.out.write_all(line.as_bytes()).map_err(|error| error.to_string())?;
        loop {
            let mut answer = self.try_read()?;
            if let Some(error) = answer.get("error") {
                return Err(error.to_string());
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

    fn try_read(&mut self) -> Result<Value, String> {
        let mut line = String::new();
        match self.input.read_line(&mut line) {
            Ok(0) => Err("it has ended".to_owned()),
            Ok(_) => serde_json::from_str(&line).map_err(|error| format!("{error}: {line}")),
            Err(error) => Err(format!("no answer: {error}")),
        }
    }
}
