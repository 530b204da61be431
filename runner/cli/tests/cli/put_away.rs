//! What came and cannot be written: it is not acknowledged, and the command says why.

use std::fs::create_dir;

use softplug_live::port::ReadOutcome;
use softplug_live::pty::PtyPair;

use crate::bench::Bench;
use crate::simulation::{ended, wait_for};

/// The partner's block "XY" of 3964R.
const BLOCK: [u8; 5] = [b'X', b'Y', 0x10, 0x03, 0x12];

#[test]
fn a_block_that_cannot_be_written_is_not_acknowledged() {
    for place in [["--out", "O1.bin"], ["--dir", "in"]] {
        let bench = Bench::new();
        create_dir(bench.path("in")).unwrap();
        let pty = PtyPair::open().unwrap();
        let port = pty.slave_path().to_str().unwrap().to_owned();
        let receive = ["receive", "--port", &port, "--plugin", "native:r3964"];
        let quiet = ["--set", "nak_at_start=off"];
        let child = bench.without_room(&[&receive[..], &quiet, &place].concat()).spawn().unwrap();
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
