//! Lines that are not what was asked for, over a gateway's endpoint as the device server.

use std::net::{TcpListener, TcpStream};

use rustix::process::Signal;
use softplug_live::pty::PtyPair;

use super::{Gateway, bench, link, take, token, wait_for};

#[test]
fn a_port_that_does_not_do_what_was_asked_is_an_error() {
    let pty = PtyPair::open().unwrap();
    let server = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let endpoint = format!("endpoint = {{ listen = \"{server}\", kind = \"rfc2217\" }}\n");
    let bench = bench(&(link("lathe", pty.slave_path().to_str().unwrap()) + &endpoint));
    bench.write("O1.nc", "G1X1\n");
    token(&bench);
    let gateway = Gateway::start(&bench);
    wait_for("the endpoint", || TcpStream::connect(server).is_ok());
    let port = format!("rfc2217://{server}");
    let send = |line: &str, more: &[&str]| {
        let words = ["send", "--port", &port, "--line", line, "--plugin", "xon-xoff", "O1.nc"];
        bench.run(&[&words[..], more].concat())
    };
    // The endpoint may still have the client of the wait.
    wait_for("the refusal", || send("9600 7E1", &[]).err.contains("does not do what was asked"));
    let json = send("9600 7E1", &["--json"]).with_code(6).json();
    let error = &json["error"];
    assert_eq!(error["code"], 6);
    let differences = error["differences"].as_array().unwrap();
    let differences: Vec<_> = differences
        .iter()
        .map(|one| ["setting", "asked", "has"].map(|key| one[key].as_str().unwrap()))
        .collect();
    assert_eq!(
        differences,
        [["baud rate", "9600", "115200"], ["data bits", "7", "8"], ["parity", "even", "none"]]
    );
    let mut got = Vec::new();
    take(&pty, &mut got);
    assert!(got.is_empty(), "nothing was sent: {got:02X?}");

    let ran = send("115200 8N1", &[]).with_code(0);
    assert!(ran.out.starts_with("sent 5 bytes in "), "{ran}");
    wait_for("the program", || {
        take(&pty, &mut got);
        got.len() >= 5
    });
    assert_eq!(got, b"G1X1\n");
    gateway.signal(Signal::TERM);
    assert_eq!(gateway.end().0, Some(0));
}

#[test]
fn a_check_tells_a_line_that_is_not_the_protocols() {
    let bench = bench("");
    let library = softplug_service::library::Library::open(&bench.path("state/plugins")).unwrap();
    library.add_file(&crate::bench::plugins().join("fanuc-rs232.wasm")).unwrap();
    let lathe = link("lathe", "/dev/ttyS7").replace("\"xon-xoff\"", "\"fanuc-rs232\"");
    bench.write("gateway.toml", &lathe);
    let ran = bench.run(&["gateway", "check", "gateway.toml"]).with_code(0);
    let told = "note: gateway.toml:4:8: the line is 115200 8N1, the protocol's 7E2: a wrong parity \
                bit is not looked at; `line = \"7E2\"`, unless the machine is set otherwise\n";
    assert!(ran.err.ends_with(told), "{ran}");
    let json = bench.run(&["gateway", "check", "gateway.toml", "--json"]).with_code(0).json();
    assert_eq!((&json["result"], &json["remarks"][0]["line"]), (&"right".into(), &4.into()));
}
