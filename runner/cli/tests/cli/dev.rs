//! `softplug dev`: real saves in a folder, and what comes of them on a live line.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_service::library::Library;

use crate::bench::Bench;
use crate::gateway::{Gateway, token, wait_for};
use crate::kit::{alone, edit, in_folder, project};

const ACK: &[u8] = b"\x06";

/// The command at work.
struct Dev {
    child: Child,
    out: BufReader<ChildStdout>,
}

impl Dev {
    fn start(bench: &Bench, folder: &str, words: &[&str], environment: &[(&str, &str)]) -> Self {
        let mut command = bench.command(&[&["dev", "--json"], words].concat());
        alone(command.current_dir(bench.path(folder))).envs(environment.iter().copied());
        let mut child = command.spawn().unwrap();
        let out = BufReader::new(child.stdout.take().unwrap());
        Self { child, out }
    }

    /// What came of the next save; what was looked at further of the one before is passed over.
    fn round(&mut self) -> Value {
        loop {
            let line = self.line();
            if line["result"] != "looked-further" {
                return line;
            }
        }
    }

    fn line(&mut self) -> Value {
        let mut line = String::new();
        self.out.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|_| {
            let mut said = String::new();
            self.child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
            panic!("{line}\n{said}")
        })
    }

    /// Waits until it has said this for people.
    fn says(&mut self, text: &str) {
        let mut said = String::new();
        let err = self.child.stderr.as_mut().unwrap();
        while !said.contains(text) {
            let mut byte = [0];
            err.read_exact(&mut byte).unwrap();
            said.push(char::from(byte[0]));
        }
    }

    /// Ctrl-C, and the end.
    fn end(mut self) {
        kill_process(Pid::from_child(&self.child), Signal::INT).unwrap();
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
    }
}

/// Waits until the machine has got this.
fn reads(pty: &PtyPair, expected: &str) {
    let mut got = Vec::new();
    wait_for(expected, || {
        let mut buffer = [0; 256];
        while let ReadOutcome::Read(count) = pty.read(&mut buffer).unwrap() {
            got.extend(&buffer[..count]);
        }
        got.ends_with(expected.as_bytes())
    });
    assert_eq!(String::from_utf8_lossy(&got), expected);
}

#[test]
fn the_cases_of_the_abi_and_those_of_the_project_are_judged() {
    let bench = project("kit-further", "c");
    let mut dev = Dev::start(&bench, "kit-further", &[], &[]);
    assert_eq!(dev.round()["result"], "passed");
    let further = dev.line();
    assert_eq!(further["result"], "looked-further");
    let verdicts = further["verdicts"].as_array().unwrap().iter();
    let verdicts: Vec<_> = verdicts.map(|of| [&of["profile"], &of["verdict"]]).collect();
    assert_eq!(verdicts, [["abi", "conformant"], ["kit-further", "conformant"]]);
    dev.end();
}

#[test]
fn each_save_goes_into_a_gateways_link_in_the_middle_of_a_job() {
    let bench = project("kit-dev", "rust");
    in_folder(&bench, "kit-dev", &["build"]).with_code(0);
    let library = Library::open(&bench.path("state/plugins")).unwrap();
    library.add_file(&bench.path("kit-dev/target/plugins/kit-dev.wasm")).unwrap();
    let pty = PtyPair::open().unwrap();
    let port = pty.slave_path().display().to_string();
    bench.write(
        "gateway.toml",
        format!(
            "[http]\nlisten = \"127.0.0.1:0\"\ntokens = \"t.toml\"\n[[link]]\nname = \"lathe\"\n\
             port = \"{port}\"\nline = \"9600 8N1\"\nplugin = \"kit-dev\"\nsettings = {{ answer_time = 60000 }}\n"
        ),
    );
    let token = token(&bench);
    bench.write("programs/O1.nc", "one\ntwo\nthree\n");
    let gateway = Gateway::start(&bench);
    let address = format!("http://{}", gateway.address);
    let environment = [("SOFTPLUG_GATEWAY", &*address), ("SOFTPLUG_TOKEN", &*token)];
    let mut dev = Dev::start(&bench, "kit-dev", &["--link", "lathe"], &environment);
    let first = dev.round();
    assert_eq!((&first["result"], &first["failed"]), (&"swapped".into(), &0.into()), "{first}");

    let mut submit = bench.command(&["job", "submit", "lathe", "O1.nc", "--json"]);
    let sent = submit.envs(environment).output().unwrap();
    assert!(sent.status.success(), "{sent:?}");
    reads(&pty, "one\n");
    edit(&bench, "kit-dev/src/lib.rs", "each answered with ACK or NAK.\"", "each answered.\"");
    let second = dev.round();
    assert_eq!(second["result"], "swapped", "{second}");
    assert_ne!(second["sha256"], first["sha256"]);
    pty.write(ACK).unwrap();
    reads(&pty, "two\n");

    // What does not build, or does something else, is told; the one before goes on.
    edit(&bench, "kit-dev/src/lib.rs", "is_bad = true;", "is_bad = truth;");
    let broken = dev.round();
    assert_eq!(broken["result"], "not-built", "{broken}");
    assert!(broken["message"].as_str().unwrap().contains("src/lib.rs"), "{broken}");
    edit(&bench, "kit-dev/src/lib.rs", "is_bad = truth;", "is_bad = false;");
    let diverged = dev.round();
    assert_eq!(diverged["result"], "diverged", "{diverged}");
    assert!(diverged["failed"].as_u64() > Some(0), "{diverged}");
    pty.write(ACK).unwrap();
    reads(&pty, "three\n");
    edit(&bench, "kit-dev/src/lib.rs", "is_bad = false;", "is_bad = true;");
    assert_eq!(dev.round()["result"], "swapped");
    dev.end();
    gateway.signal(Signal::TERM);
    assert_eq!(gateway.end().0, Some(0));
}

mod needs_clang {
    use super::*;

    #[test]
    fn each_save_goes_onto_a_port() {
        let bench = project("kit-port", "c");
        bench.write("kit-port/text.nc", "one\ntwo\n");
        std::fs::create_dir(bench.path("kit-port/kept")).unwrap();
        let pty = PtyPair::open().unwrap();
        let port = pty.slave_path().display().to_string();
        let words = [
            &["--port", &port, "--send", "text.nc", "--set", "answer_time=60000"][..],
            &["--keep", "kept"],
        ]
        .concat();
        let mut dev = Dev::start(&bench, "kit-port", &words, &[]);
        let first = dev.round();
        assert_eq!(first["result"], "swapped", "{first}");
        reads(&pty, "one\n");

        // With its state, in the middle of the job.
        let file = "kit-port/src/plugin.c";
        edit(&bench, file, "does not wait for answers", "is in a hurry");
        assert_eq!(dev.round()["result"], "swapped");
        pty.write(ACK).unwrap();
        reads(&pty, "two\n");
        pty.write(ACK).unwrap();
        // As new, where the state is another one; the file is sent anew.
        edit(
            &bench,
            "kit-port/manifest.json",
            "\"saves\": 1, \"accepts\": [1]",
            "\"saves\": 2, \"accepts\": [2]",
        );
        edit(&bench, file, "sp_saved(1,", "sp_saved(2,");
        edit(&bench, file, "sizeof s, 1,", "sizeof s, 2,");
        let third = dev.round();
        assert_eq!(third["result"], "swapped", "{third}");
        reads(&pty, "one\n");
        pty.write(ACK).unwrap();
        reads(&pty, "two\n");
        pty.write(ACK).unwrap();
        // What the machine sends is acknowledged, and kept.
        pty.write(b"M30\n").unwrap();
        reads(&pty, "\x06");
        let kept = || {
            let folder = std::fs::read_dir(bench.path("kit-port/kept")).unwrap();
            let files = folder.map(|entry| std::fs::read(entry.unwrap().path()).unwrap());
            files.collect::<Vec<_>>()
        };
        wait_for("what was kept", || kept() == [b"M30\n"]);
        // A plug-in that traps ends, and the next save begins anew.
        edit(
            &bench,
            file,
            "    cancel_timer();\n    s.transmitted",
            "    sp_panic(\"here\");\n    s.transmitted",
        );
        assert_eq!(dev.round()["result"], "diverged");
        // What cannot be kept is not acknowledged.
        std::fs::remove_dir_all(bench.path("kit-port/kept")).unwrap();
        pty.write(b"M31\n").unwrap();
        dev.says("what comes is not kept: ");
        dev.end();
        let mut rest = [0; 16];
        assert_eq!(pty.read(&mut rest).unwrap(), ReadOutcome::Empty, "{rest:x?}");
    }
}
