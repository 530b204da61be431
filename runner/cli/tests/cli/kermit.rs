//! Kermit between the command and Debian's C-Kermit, over a line that is good or bad.

mod needs_kermit {
    use std::process::{Child, Command, Stdio};

    use crate::bench::{Bench, Ran};
    use crate::foreign::{Faults, Line, Ports, file};

    /// A megabyte: its packets are counted round 15 times and more.
    const LENGTH: usize = 1_000_000;
    /// A rate at which the command does not wait for the line, and long writes.
    const FAST: &str = "--line 4000000~8N1 --depth 2000";
    /// Times for a line that is as fast.
    const SHORT_TIMES: &str =
        "--set answer_time=1000 --set packet_time=1000 --set character_time=200";

    fn words(text: &str) -> Vec<String> {
        text.split_whitespace().map(|word| word.replace('~', " ")).collect()
    }

    /// C-Kermit on its port, with these settings, doing this one thing.
    fn kermit(ports: &Ports, settings: &str, what: &str) -> Child {
        let line = "set carrier-watch off, set modem type none";
        let port = format!("set line {}, set flow none, set parity none", ports.theirs);
        let usual = "set file type binary, set transfer display none, set retry 30";
        let does = format!("{line}, {port}, {usual}, {settings}, {what}, exit \\v(status)");
        let mut command = Command::new("kermit");
        command.args(["-Y", "-H", "-C", &does]).stdin(Stdio::null());
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    /// One transfer: the file as it came, and how the command and C-Kermit ended.
    struct Transfer {
        ran: Ran,
        foreign: bool,
        came: Vec<u8>,
        sent: Vec<u8>,
        faults: u64,
    }

    /// C-Kermit takes what the command sends.
    fn sends(
        sent: Vec<u8>,
        options: &str,
        settings: &str,
        to_us: Faults,
        to_them: Faults,
    ) -> Transfer {
        let bench = Bench::new();
        bench.write("sent.bin", sent.clone());
        let ports = Line::new(to_us, to_them).ports();
        let port = &ports.ours;
        let came = bench.path("came.bin");
        let mut foreign = kermit(&ports, settings, &format!("receive {}", came.display()));
        // What is said of the line comes instead of the fast one.
        let line = if options.contains("--line") { "" } else { FAST };
        let arguments = format!("send --port {port} --plugin kermit {line} {options} sent.bin");
        let ran = bench.run(&words(&arguments));
        if ran.code != 0 {
            // What it waits for does not come any more.
            let _ = foreign.kill();
        }
        let foreign = foreign.wait().unwrap().success();
        let faults = ports.end();
        let came = std::fs::read(came).unwrap_or_default();
        Transfer { ran, foreign, came, sent, faults }
    }

    /// The command takes what C-Kermit sends.
    fn receives(
        sent: Vec<u8>,
        options: &str,
        settings: &str,
        to_us: Faults,
        to_them: Faults,
    ) -> Transfer {
        let bench = Bench::new();
        bench.write("sent.bin", sent.clone());
        let ports = Line::new(to_us, to_them).ports();
        let port = &ports.ours;
        let path = bench.path("sent.bin");
        let mut foreign = kermit(&ports, settings, &format!("send {}", path.display()));
        let arguments = format!(
            "receive --port {port} --plugin kermit {FAST} {options} --wait 60 --out came.bin"
        );
        let ran = bench.run(&words(&arguments));
        if ran.code != 0 {
            let _ = foreign.kill();
        }
        let foreign = foreign.wait().unwrap().success();
        let faults = ports.end();
        let came = std::fs::read(bench.path("came.bin")).unwrap_or_default();
        Transfer { ran, foreign, came, sent, faults }
    }

    impl Transfer {
        /// It came as it was sent, and both say so.
        fn went_well(&self) {
            assert_eq!(self.ran.code, 0, "{}", self.ran);
            assert!(self.foreign, "C-Kermit failed; {}", self.ran);
            self.is_whole();
        }

        fn is_whole(&self) {
            let is_same = self.came == self.sent;
            assert!(is_same, "{} bytes came, other ones; {}", self.came.len(), self.ran);
        }

        /// It came as it was sent, or who sent or received says that it did not.
        fn is_no_lie(&self) {
            assert!(self.faults > 10, "{} faults", self.faults);
            if self.ran.code == 0 {
                self.is_whole();
            } else {
                assert!(self.ran.err.contains("error: "), "{}", self.ran);
            }
        }
    }

    const NONE: Faults = Faults { seed: 0, flips: 0, drops: 0, doubles: 0 };

    #[test]
    fn kermit_takes_a_megabyte_in_long_packets_with_crc() {
        sends(file(LENGTH), "", "set receive timeout 2", NONE, NONE).went_well();
    }

    #[test]
    fn kermit_takes_a_megabyte_in_short_packets_with_check_1() {
        let settings = "set receive packet-length 94, set receive timeout 2";
        sends(file(LENGTH), "--set check=1", settings, NONE, NONE).went_well();
    }

    /// C-Kermit answers at the check: at a real rate the CR behind it is still on its way.
    #[test]
    fn kermit_is_heard_at_the_rate_of_a_line() {
        let settings = "set receive packet-length 40, set receive timeout 10";
        let options = "--line 9600~8N1 --set repeats=1 --set answer_time=2000";
        sends(file(1_000), options, settings, NONE, NONE).went_well();
    }

    #[test]
    fn kermit_takes_all_bytes_with_prefixes_for_the_eighth_bit() {
        let options = "--set eighth_bit=prefix --set check=2";
        sends(file(LENGTH / 4), options, "set receive timeout 2", NONE, NONE).went_well();
    }

    #[test]
    fn kermit_takes_runs() {
        let sent = [vec![0; 100_000], file(100), vec![b'~'; 5_000], vec![0xFF; 5_000]].concat();
        sends(sent, "", "set receive timeout 2", NONE, NONE).went_well();
    }

    #[test]
    fn kermit_sends_a_megabyte_in_long_packets_with_crc() {
        receives(file(LENGTH), "", "set block-check 3", NONE, NONE).went_well();
    }

    #[test]
    fn kermit_sends_a_megabyte_in_short_packets_with_check_1() {
        let settings = "set block-check 1, set send packet-length 94";
        receives(file(LENGTH), "--set packet_length=94", settings, NONE, NONE).went_well();
    }

    #[test]
    fn kermit_sends_all_bytes_with_prefixes_for_the_eighth_bit() {
        let options = "--set eighth_bit=prefix";
        receives(file(LENGTH / 4), options, "set block-check 2", NONE, NONE).went_well();
    }

    #[test]
    fn kermit_sends_runs() {
        let sent = [vec![0; 100_000], file(100), vec![b'~'; 5_000], vec![0xFF; 5_000]].concat();
        receives(sent, "", "set block-check 3", NONE, NONE).went_well();
    }

    #[test]
    fn kermit_takes_nothing_wrong_from_a_bad_line() {
        for seed in [1, 2] {
            let to_them = Faults { seed, flips: 60_000, drops: 60_000, doubles: 60_000 };
            let to_us = Faults { seed: 10 + seed, flips: 2_000, drops: 2_000, doubles: 2_000 };
            let settings = "set receive timeout 2";
            let transfer = sends(file(LENGTH), SHORT_TIMES, settings, to_us, to_them);
            transfer.is_no_lie();
            // None of these is more than Kermit can mend.
            transfer.went_well();
        }
    }

    #[test]
    fn kermit_sends_nothing_wrong_over_a_bad_line() {
        for seed in [1, 2] {
            let to_us = Faults { seed, flips: 60_000, drops: 60_000, doubles: 60_000 };
            let to_them = Faults { seed: 10 + seed, flips: 2_000, drops: 2_000, doubles: 2_000 };
            let settings = "set block-check 3, set send timeout 2";
            let transfer = receives(file(LENGTH), SHORT_TIMES, settings, to_us, to_them);
            transfer.is_no_lie();
            transfer.went_well();
        }
    }
}
