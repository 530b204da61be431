//! XMODEM between the command and Debian's `lrzsz`, over a line that is good or bad.

mod needs_sx {
    use std::process::Command;
    use std::time::Duration;

    use rustix::process::{Pid, Signal, kill_process};

    use crate::bench::{Bench, Ran};
    use crate::foreign::{Faults, Line, file};

    /// A megabyte: the numbers of its blocks begin anew 30 times.
    const LENGTH: usize = 1_000_000;
    /// A rate at which the command does not wait for the line, and long writes.
    const FAST: &str = "--line 4000000~8N1 --depth 2000";
    /// Times for a line that is as fast: lrzsz's own are longer.
    const SHORT_TIMES: &str = "--set purge_time=200 --set character_time=200 --set block_time=2000";

    fn words(text: &str) -> Vec<String> {
        text.split_whitespace().map(|word| word.replace('~', " ")).collect()
    }

    /// One transfer: the file as it came, and how the command and lrzsz ended.
    struct Transfer {
        ran: Ran,
        foreign: bool,
        came: Vec<u8>,
        faults: u64,
    }

    /// lrzsz's `rx` takes what the command sends.
    fn sends(options: &str, rx: &[&str], to_us: Faults, to_them: Faults) -> Transfer {
        let bench = Bench::new();
        bench.write("sent.bin", file(LENGTH));
        let line = Line::new(to_us, to_them);
        let port = line.port();
        let arguments = format!("send --port {port} --plugin xmodem {FAST} {options} sent.bin");
        let command = bench.command(&words(&arguments)).spawn().unwrap();
        // It takes no name that leads out of its folder.
        let folder = bench.path("");
        let (mut rx, relay) =
            line.start(Command::new("rx").current_dir(folder).arg("-q").args(rx).arg("came.bin"));
        let ran = Ran::from(command.wait_with_output().unwrap());
        if ran.code != 0 {
            // What it waits for does not come any more.
            let _ = rx.kill();
        }
        let foreign = rx.wait().unwrap().success();
        let faults = relay.end();
        let came = std::fs::read(bench.path("came.bin")).unwrap_or_default();
        Transfer { ran, foreign, came, faults }
    }

    /// The command takes what lrzsz's `sx` sends.
    fn receives(options: &str, sx: &[&str], to_us: Faults, to_them: Faults) -> Transfer {
        let bench = Bench::new();
        bench.write("sent.bin", file(LENGTH));
        let line = Line::new(to_us, to_them);
        let port = line.port();
        let arguments = format!(
            "receive --port {port} --plugin xmodem {FAST} {options} --wait 60 --out came.bin"
        );
        let (mut sx, relay) =
            line.start(Command::new("sx").arg("-q").args(sx).arg(bench.path("sent.bin")));
        let ran = bench.run(&words(&arguments));
        if ran.code != 0 {
            let _ = sx.kill();
        }
        let foreign = sx.wait().unwrap().success();
        let faults = relay.end();
        let came = std::fs::read(bench.path("came.bin")).unwrap_or_default();
        Transfer { ran, foreign, came, faults }
    }

    impl Transfer {
        /// It came as it was sent, with padding of less than a block of this length.
        fn went_well(&self, block: usize) {
            assert_eq!(self.ran.code, 0, "{}", self.ran);
            assert!(self.foreign, "lrzsz failed; {}", self.ran);
            self.is_whole(block);
        }

        fn is_whole(&self, block: usize) {
            let sent = file(LENGTH);
            let (came, padding) = self.came.split_at(sent.len().min(self.came.len()));
            assert!(came == sent, "{} bytes came, other ones; {}", self.came.len(), self.ran);
            assert!(padding.len() < block && padding.iter().all(|byte| *byte == 0x1A));
        }

        /// It came as it was sent, or who sent and who received say that it did not.
        fn is_no_lie(&self, block: usize) {
            assert!(self.faults > 10, "{} faults", self.faults);
            if self.ran.code == 0 {
                self.is_whole(block);
            } else {
                assert!(self.ran.err.contains("error: "), "{}", self.ran);
            }
        }
    }

    const NONE: Faults = Faults { seed: 0, flips: 0, drops: 0, doubles: 0 };

    #[test]
    fn rx_takes_a_megabyte_with_crc() {
        sends("", &["-c"], NONE, NONE).went_well(128);
    }

    #[test]
    fn rx_takes_a_megabyte_with_checksums() {
        sends("", &[], NONE, NONE).went_well(128);
    }

    #[test]
    fn rx_takes_a_megabyte_in_long_blocks() {
        sends("--set mode=1k", &["-c"], NONE, NONE).went_well(1_024);
    }

    #[test]
    fn sx_sends_a_megabyte_with_crc() {
        receives("", &[], NONE, NONE).went_well(1);
    }

    #[test]
    fn sx_sends_a_megabyte_with_checksums() {
        receives("--set mode=checksum", &[], NONE, NONE).went_well(1);
    }

    #[test]
    fn sx_sends_a_megabyte_in_long_blocks() {
        receives("--set padding=keep", &["-k"], NONE, NONE).went_well(1_024);
    }

    #[test]
    fn sx_is_told_of_an_abort() {
        let bench = Bench::new();
        bench.write("sent.bin", file(LENGTH));
        let line = Line::new(NONE, NONE);
        let port = line.port();
        let arguments = format!(
            "receive --port {port} --plugin xmodem --line 9600~8N1 --wait 60 --out came.bin"
        );
        let command = bench.command(&words(&arguments)).spawn().unwrap();
        let (mut sx, relay) = line.start(Command::new("sx").arg("-q").arg(bench.path("sent.bin")));
        let came = || std::fs::metadata(bench.path("came.bin.partial")).map_or(0, |of| of.len());
        for _ in 0..600 {
            if came() > 500 {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let id = Pid::from_child(&command);
        kill_process(id, Signal::INT).unwrap();
        assert_eq!(Ran::from(command.wait_with_output().unwrap()).code, 5);
        // sx by itself would try for minutes.
        let told = (0..200).any(|_| {
            std::thread::sleep(Duration::from_millis(50));
            sx.try_wait().unwrap().is_some()
        });
        if !told {
            let _ = sx.kill();
        }
        let ended = sx.wait().unwrap();
        relay.end();
        assert!(told && !ended.success(), "nobody told it");
    }

    #[test]
    fn rx_takes_nothing_wrong_from_a_bad_line() {
        // Each lost ACK takes as long as lrzsz is patient: 13 s.
        let to_them = Faults { seed: 1, flips: 150_000, drops: 150_000, doubles: 150_000 };
        let to_us = Faults { seed: 11, flips: 0, drops: 700, doubles: 300 };
        let options = format!("--set mode=1k {SHORT_TIMES}");
        let transfer = sends(&options, &["-c"], to_us, to_them);
        transfer.is_no_lie(1_024);
        // None of these is more than XMODEM can mend.
        transfer.went_well(1_024);
    }

    #[test]
    fn sx_sends_nothing_wrong_over_a_bad_line() {
        for seed in [1, 2] {
            let to_us = Faults { seed, flips: 60_000, drops: 60_000, doubles: 60_000 };
            let to_them = Faults { seed: 10 + seed, flips: 900, drops: 900, doubles: 900 };
            let transfer = receives(SHORT_TIMES, &["-k"], to_us, to_them);
            transfer.is_no_lie(1);
        }
    }
}
