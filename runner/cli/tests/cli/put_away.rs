//! What came and cannot be written: it is not acknowledged, and the command says why.

use std::fs::{create_dir, rename};
use std::process::Child;

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

/// A partner of 3964R, to whom the command has said that it is ready.
struct Partner {
    pty: PtyPair,
    receives: Child,
}

impl Partner {
    /// `receive --out O1.bin`, with other options behind it.
    fn begin(bench: &Bench, options: &[&str]) -> Self {
        let pty = PtyPair::open().unwrap();
        let port = pty.slave_path().to_str().unwrap().to_owned();
        let receive = ["receive", "--port", &port, "--plugin", "native:r3964", "--out", "O1.bin"];
        // Much may happen before the block comes.
        let quiet = ["--set", "nak_at_start=off", "--set", "zvz=60000"];
        let receives = bench.command(&[&receive[..], &quiet, options].concat()).spawn().unwrap();
        let partner = Self { pty, receives };
        partner.pty.write(&[0x02]).unwrap();
        partner.hears_a_dle();
        partner
    }

    fn hears_a_dle(&self) {
        let mut answer = [0; 16];
        let mut heard = 0;
        wait_for("a DLE", || {
            if let ReadOutcome::Read(count) = self.pty.read(&mut answer).unwrap() {
                heard += count;
            }
            heard > 0
        });
        assert_eq!((heard, answer[0]), (1, 0x10));
    }

    /// Sends the block, which must not be acknowledged; what the command says.
    fn refused(self) -> String {
        self.pty.write(&BLOCK).unwrap();
        let ran = ended(self.receives).with_code(2);
        let rest = self.pty.read(&mut [0; 16]).unwrap();
        assert_eq!(rest, ReadOutcome::Empty, "the block was acknowledged: {ran}");
        ran.err
    }
}

#[test]
fn what_is_acknowledged_has_its_name_and_a_killed_command_takes_nothing_from_it() {
    let bench = Bench::new();
    let mut partner = Partner::begin(&bench, &[]);
    partner.pty.write(&BLOCK).unwrap();
    partner.hears_a_dle();
    partner.receives.kill().unwrap();
    partner.receives.wait().unwrap();
    assert_eq!(bench.names(), ["O1.bin"]);
    assert_eq!(bench.read("O1.bin"), b"XY");
}

#[test]
fn a_file_that_cannot_get_its_name_is_not_acknowledged() {
    let bench = Bench::new();
    let partner = Partner::begin(&bench, &[]);
    bench.write("O1.bin", "theirs");
    let said = partner.refused();
    assert!(said.contains("another file of this name came up meanwhile"), "{said}");
    assert!(said.contains("what came is in O1.bin.failed"), "{said}");
    assert_eq!(bench.names(), ["O1.bin", "O1.bin.failed"]);
    assert_eq!(bench.read("O1.bin"), b"theirs");
    assert_eq!(bench.read("O1.bin.failed"), b"XY");
}

#[test]
fn what_somebody_puts_in_the_place_of_the_file_does_not_get_its_name() {
    for options in [&[][..], &["--force"]] {
        let bench = Bench::new();
        let partner = Partner::begin(&bench, options);
        bench.write("other", "theirs");
        rename(bench.path("other"), bench.path("O1.bin.partial")).unwrap();
        let said = partner.refused();
        assert!(said.contains("somebody removed or replaced O1.bin.partial"), "{said}");
        assert_eq!(bench.names(), ["O1.bin.failed", "O1.bin.partial"]);
        assert_eq!(bench.read("O1.bin.partial"), b"theirs");
        assert_eq!(bench.read("O1.bin.failed"), b"XY");
    }
}

#[test]
fn force_takes_nothing_from_a_reception_that_is_under_way() {
    let bench = Bench::new();
    let partner = Partner::begin(&bench, &["--force"]);
    let other = ["receive", "--port", "/dev/none", "--plugin", "native:r3964", "--out", "O1.bin"];
    for options in [&[][..], &["--force"]] {
        let ran = bench.run(&[&other[..], options].concat()).with_code(2);
        let said = "O1.bin.partial is just being written by another command";
        assert!(ran.err.contains(said), "{ran}");
    }
    partner.pty.write(&BLOCK).unwrap();
    partner.hears_a_dle();
    ended(partner.receives).with_code(0);
    assert_eq!(bench.names(), ["O1.bin"]);
    assert_eq!(bench.read("O1.bin"), b"XY");
}

#[test]
fn what_a_killed_reception_left_outlives_one_with_force() {
    let bench = Bench::new();
    bench.write("O1.bin.partial", "half");
    let pty = PtyPair::open().unwrap();
    let port = pty.slave_path().to_str().unwrap().to_owned();
    let receive = ["receive", "--port", &port, "--plugin", "native:r3964", "--out", "O1.bin"];
    let ran = bench.run(&[&receive[..], &["--force", "--wait", "1"]].concat()).with_code(5);
    let said = "what a killed command left of the file is in O1.bin.failed";
    assert!(ran.err.contains(said), "{ran}");
    assert_eq!(bench.names(), ["O1.bin.failed"]);
    assert_eq!(bench.read("O1.bin.failed"), b"half");
}

#[test]
fn what_is_put_away_stays_whole_when_the_next_one_is_not() {
    let bench = Bench::new();
    let pty = PtyPair::open().unwrap();
    let port = pty.slave_path().to_str().unwrap().to_owned();
    let receive = ["receive", "--port", &port, "--plugin", "native:fanuc-rs232", "--out", "O1"];
    let child = bench.command(&receive).spawn().unwrap();
    // Two programs of one punch: the second goes into a file of its own.
    pty.write(b"\x12%\nO1\nM30\n%\nO2\nM30\n%\n").unwrap();
    wait_for("the second program", || bench.path("delivery.partial").exists());
    bench.write("other", "theirs");
    rename(bench.path("other"), bench.path("delivery.partial")).unwrap();
    pty.write(b"\0\0\x14").unwrap();
    let ran = ended(child).with_code(2);
    assert!(ran.err.contains("what came besides cannot be written"), "{ran}");
    assert!(ran.err.contains("what came is in O1\n"), "{ran}");
    assert_eq!(bench.read("O1"), b"%\nO1\nM30\n%\n");
    assert_eq!(bench.names(), ["O1", "O2.failed", "delivery.partial"]);
}
