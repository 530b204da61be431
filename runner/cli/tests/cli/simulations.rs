//! Simulated machines, and scripts that play a partner, with the command at the other end.

use std::io::Read as _;
use std::time::Duration;

use crate::bench::{Bench, program};
use crate::simulation::{HANG, LINE, Simulation, alone, ended, interrupt, wait_for};

#[test]
fn a_simulated_lathe_cuts_what_is_sent() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("cut.nc", "G91 S20 T1 M3\nG01 X-2 Z-20 F2000\nM30\n");
    let simulation = Simulation::of("pulse-lathe", &bench, &["--once", "--picture", "part.svg"]);
    let send = ["send", "--port", &simulation.port, "--plugin", "pulse-lathe", "--json", "cut.nc"];
    let line = ["--line", "40000 8N1", "--depth", "1000", "--set", "input=iso"];
    let sent = bench.run(&[&send[..], &line].concat()).with_code(0).json();
    assert_eq!(sent["result"], "done");
    let (_, report) = simulation.end();
    // Time is real here: a gap is not the program's.
    assert_eq!((&report["x_pulses"], &report["z_pulses"]), (&200.into(), &2_000.into()));
    assert_eq!((&report["programs"], &report["lost_pulses"]), (&1.into(), &0.into()));
    assert!(String::from_utf8(bench.read("part.svg")).unwrap().contains("id=\"part\""));
}

#[test]
fn a_simulated_control_speaks_xmodem_both_ways() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("O1.nc", program("surfacing.nc"));
    let fast = ["--baud", "115200", "--once"];
    let simulation = Simulation::of(
        "xmodem",
        &bench,
        &[&fast[..], &["--damage", "3", "--out", "got.nc"]].concat(),
    );
    let line = ["--line", "115200 8N1"];
    let send = ["send", "--port", &simulation.port, "--plugin", "xmodem", "--json", "O1.nc"];
    assert_eq!(bench.run(&[&send[..], &line].concat()).with_code(0).json()["result"], "done");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["done"], &report["failed"]), (0, &1.into(), &0.into()), "{report}");
    let (sent, got) = (bench.read("O1.nc"), bench.read("got.nc"));
    assert_eq!(got[..sent.len()], sent);
    assert!(got[sent.len()..].iter().all(|byte| *byte == 0x1A));

    let simulation =
        Simulation::of("xmodem", &bench, &[&fast[..], &["--file", "O1.nc", "--long"]].concat());
    let receive = ["receive", "--port", &simulation.port, "--plugin", "xmodem", "--out", "back.nc"];
    bench.run(&[&receive[..], &line].concat()).with_code(0);
    assert_eq!(bench.read("back.nc"), sent);
    assert_eq!(simulation.end().0, 0);
}

#[test]
fn a_simulated_machine_speaks_kermit_both_ways_and_asks() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("O1.NC", program("surfacing.nc"));
    let fast = ["--baud", "115200", "--long", "1000", "--once"];
    let line = ["--line", "115200 8N1"];
    let faults = ["--damage", "4", "--lose", "5", "--expect", "O1.NC"];
    let simulation = Simulation::of("kermit", &bench, &[&fast[..], &faults].concat());
    let send = ["send", "--port", &simulation.port, "--plugin", "kermit", "--json", "O1.NC"];
    assert_eq!(bench.run(&[&send[..], &line].concat()).with_code(0).json()["result"], "done");
    let (code, report) = simulation.end();
    assert_eq!((code, &report["done"], &report["failed"]), (0, &1.into(), &0.into()), "{report}");
    assert_eq!(report["as_expected"], true);

    let simulation = Simulation::of("kermit", &bench, &[&fast[..], &["--file", "O1.NC"]].concat());
    let receive = ["receive", "--port", &simulation.port, "--plugin", "kermit", "--out", "back.nc"];
    bench.run(&[&receive[..], &line].concat()).with_code(0);
    assert_eq!(bench.read("back.nc"), bench.read("O1.NC"));
    assert_eq!(simulation.end().0, 0);

    // It asks for a program of the folder.
    let ask = ["--ask", "O1.NC", "--expect", "O1.NC"];
    let simulation = Simulation::of("kermit", &bench, &[&fast[..], &ask].concat());
    std::fs::create_dir(bench.path("came")).unwrap();
    let serve = ["receive", "--port", &simulation.port, "--plugin", "kermit", "--dir", "came"];
    let serve = [&serve[..], &["--programs", "."], &line].concat();
    let serving = bench.command(&serve).spawn().unwrap();
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (0, &true.into()), "{report}");
    interrupt(&serving);
    ended(serving);
}

#[test]
fn a_simulated_machine_behind_a_tcp_port_takes_one_at_a_time() {
    let _alone = alone();
    let bench = Bench::new();
    bench.write("O1.nc", program("surfacing.nc"));
    let options = ["--listen", "127.0.0.1:0", "--buffer", "8192", "--once", "--expect", "O1.nc"];
    let simulation = Simulation::start(&bench, &options);
    let address = simulation.port.strip_prefix("tcp://").unwrap();
    // Whoever goes leaves it to the next one.
    drop(std::net::TcpStream::connect(address).unwrap());
    let mut there = None;
    wait_for("a turn of our own", || {
        let stream = std::net::TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
        let is_sent_away = (&stream).read(&mut [0]).is_ok_and(|count| count == 0);
        there = (!is_sent_away).then_some(stream);
        there.is_some()
    });
    let second = std::net::TcpStream::connect(address).unwrap();
    second.set_read_timeout(Some(HANG)).unwrap();
    assert!((&second).read(&mut [0]).is_ok_and(|count| count == 0), "a second one is sent away");
    drop(there);
    wait_for("the end of a connection", || {
        let send = ["send", "--port", &simulation.port, "--plugin", "xon-xoff", "O1.nc", "--json"];
        bench.run(&[&send[..], &LINE].concat()).code == 0
    });
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (0, &true.into()), "{report}");

    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let ran = bench.run(&["simulate", "xon-xoff", "--listen", &address]).with_code(6);
    assert!(ran.err.contains("cannot be listened on"), "{ran:?}");
}

#[test]
fn a_script_plays_the_partner_of_a_trace() {
    let _alone = alone();
    let bench = Bench::new();
    let front = "id: xon-xoff.tx.script\ntitle: A script\nprofile: xon-xoff\n\
                 clauses: xon-xoff.tx.obey-xoff\nlevel: must\nline: 9600 8N1 depth=1 reaction=0\nsince: 1\n\
                 origin: hand-written\n---\n";
    let body = "? 0.000000 send 1 \"ABCD\"\n> 0.000000 \"AB\"\n< 0.002000 13\n< 0.300000 11\n\
                > 0.300000 \"CD\"\n= 0.302084 done 1 sent=4\n";
    bench.write("partner.spt", format!("{front}{body}"));
    bench.write("good.nc", "ABCD");
    bench.write("other.nc", "ABXD");
    let play = |file: &str| {
        let options = ["partner.spt", "--once", "--quiet-time", "1"];
        let simulation = Simulation::of("script", &bench, &options);
        let send = ["send", "--port", &simulation.port, "--plugin", "xon-xoff", file, "--json"];
        let sent = bench.run(&[&send[..], &["--line", "9600 8N1"]].concat()).with_code(0).json();
        (sent, simulation.end())
    };
    let (sent, (code, report)) = play("good.nc");
    assert_eq!((code, &report["came"], &report["said"]), (0, &4.into(), &2.into()), "{report}");
    assert!(sent["holds"].as_u64() >= Some(1), "{sent}");
    let (_, (code, report)) = play("other.nc");
    assert_eq!(code, 1);
    assert_eq!(report["message"], "line 14: 43 is expected, 58 came");

    // What was to come is compared, and kept.
    let options =
        ["partner.spt", "--once", "--quiet-time", "1", "--expect", "other.nc", "--out", "came.bin"];
    let simulation = Simulation::of("script", &bench, &options);
    let send = ["send", "--port", &simulation.port, "--plugin", "xon-xoff", "good.nc"];
    bench.run(&[&send[..], &["--line", "9600 8N1"]].concat()).with_code(0);
    let (code, report) = simulation.end();
    assert_eq!((code, &report["as_expected"]), (1, &false.into()), "{report}");
    assert_eq!(bench.read("came.bin"), b"ABCD");

    // What is said counts once it was taken.
    let body = "< 0.000000 gen:bytes(1,1000000)\n. 1.000000\n";
    bench.write("long.spt", format!("{front}{body}"));
    let options = ["long.spt", "--once", "--quiet-time", "1", "--listen", "127.0.0.1:0"];
    let simulation = Simulation::of("script", &bench, &options);
    let address = simulation.port.strip_prefix("tcp://").unwrap();
    let deaf = std::net::TcpStream::connect(address).unwrap();
    let (code, report) = simulation.end();
    assert_eq!((code, report["result"].as_str()), (1, Some("failed")), "{report}");
    drop(deaf);

    bench.write("lines.spt", format!("{front}! 0.000000 break\n. 1.000000\n"));
    let ran = bench.run(&["simulate", "script", "lines.spt"]).with_code(2);
    assert!(ran.err.contains("lines.spt:10: a partner of bytes alone"), "{ran:?}");
}

#[test]
fn an_interrupted_simulation_reports() {
    let bench = Bench::new();
    let simulation = Simulation::start(&bench, &[]);
    interrupt(&simulation.child);
    let (code, report) = simulation.end();
    assert_eq!((code, &report["result"]), (0, &"done".into()), "{report}");
    assert_eq!(report["received"], 0);
}
