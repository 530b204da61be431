//! What came and cannot be written: it is not acknowledged, and the command says why.

use std::fs::create_dir;
use std::process::{Child, Command, Stdio};

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;

use crate::bench::Bench;
use crate::simulation::{ended, wait_for};

/// The partner's block "XY" of 3964R.
const BLOCK: [u8; 5] = [b'X', b'Y', 0x10, 0x03, 0x12];

/// The command where no file may have a byte.
fn without_room(bench: &Bench, words: &[&str]) -> Child {
    let asked = bench.command(words);
    let mut child = Command::new("sh");
    let script = "trap '' XFSZ; ulimit -f 0; exec \"$0\" \"$@\"";
    child.args(["-c", script]).arg(asked.get_program()).args(asked.get_args());
    child.current_dir(asked.get_current_dir().unwrap());
    child.envs(asked.get_envs().filter_map(|(name, value)| Some((name, value?))));
    child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_block_that_cannot_be_written_is_not_acknowledged() {
    for place in [["--out", "O1.bin"], ["--dir", "in"]] {
        let bench = Bench::new();
        create_dir(bench.path("in")).unwrap();
        let pty = PtyPair::open().unwrap();
        let port = pty.slave_path().to_str().unwrap().to_owned();
        let receive = ["receive", "--port", &port, "--plugin", "native:r3964"];
        let quiet = ["--set", "nak_at_start=off"];
        let child = without_room(&bench, &[&receive[..], &quiet, &place].concat());
        pty.write(&[0x02]).unwrap();
        let mut answer = [0; 16];
        let mut ready = 0;
        wait_for("the DLE that it is ready", || {
            if let ReadOutcome::Read(count) = pty.read(&mut answer).unwrap() {
                ready += count;
            }
            ready > 0
        });
        assert_eq!((ready, answer[0]), (1, 0x10));
        pty.write(&BLOCK).unwrap();
        let ran = ended(child).with_code(2);
        let said = format!("what was received cannot be written into {}: File too large", place[1]);
        assert!(ran.err.contains(&said), "{ran}");
        assert!(!ran.err.contains("met a state that it should not"), "{ran}");
        let rest = pty.read(&mut answer).unwrap();
        assert_eq!(rest, ReadOutcome::Empty, "the block was acknowledged: {answer:x?}");
        assert_eq!(Bench::names_in(&bench.path("in")), Vec::<String>::new());
        assert_eq!(bench.names(), ["in"]);
    }
}
