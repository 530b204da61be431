//! Bombs at every door of a gateway, while a machine is fed and panels ask.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use softplug_live::pty::PtyPair;
use softplug_service::library::Library;

use super::{Gateway, HANG, bench, link, take, token, wait_for};
use crate::bombs::{HEAVIEST, REFUSED, Recipe, recipes};

/// How many of those that have to be compiled to be refused are tried at each door: each may take
/// seconds.
const COMPILED: usize = 3;

/// One request of the API, and the head of the answer with its body.
fn call(address: &str, token: &str, request: &str, body: &[u8]) -> std::io::Result<String> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(HANG))?;
    write!(
        stream,
        "{request} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\n\
         Content-Type: application/octet-stream\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    )?;
    stream.write_all(body)?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    Ok(answer)
}

#[test]
fn bombs_at_every_door_hold_nobody_up() {
    let pty = PtyPair::open().unwrap();
    let fed = link("lathe", pty.slave_path().to_str().unwrap());
    // This one takes whatever comes with its plug-in's name.
    let follows = link("mill", "pty:").replace("xon-xoff\"", "xon-xoff\"\nswap = \"follow\"");
    let bench = bench(&(fed + &follows));
    let text = fs::read_to_string(bench.path("gateway.toml")).unwrap();
    let limits = "[http]\nrequests-per-second = 100000\nburst = 100000\n";
    bench.write("gateway.toml", text.replace("[http]\n", limits));
    let token = token(&bench);
    let program = format!("%\nO1\n{}M30\n%\n", "N10 G1 X12.5 Y25\n".repeat(10_000));
    bench.write("programs/O1.nc", &program);
    // A pipe that nobody writes into: at the start already.
    let pipe = bench.path("state/plugins/incoming/pipe.wasm");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let gateway = Gateway::start(&bench);
    gateway.ask(&bench, &token, &["job", "submit", "lathe", "O1.nc", "--json"]).with_code(0);

    let mut modules: Vec<_> = recipes(&REFUSED).iter().map(Recipe::module).collect();
    modules.extend(recipes(&HEAVIEST[..COMPILED]).iter().map(Recipe::module));
    for (nth, module) in modules.iter().enumerate() {
        // Put in place whole, as a copying program does.
        let new = bench.write(&format!("new-{nth}"), module);
        let name = format!("state/plugins/incoming/{nth}.wasm");
        fs::rename(new, bench.path(&name)).unwrap();
    }
    // One that a former version had let in, for the link that follows.
    let heir = recipes(&HEAVIEST)[0].module_of("xon-xoff");
    Library::open(&bench.path("state/plugins")).unwrap().add(&heir).unwrap();
    let (address, secret) = (gateway.address.clone(), token.clone());
    let uploads = std::thread::spawn(move || {
        for module in &modules {
            let answer = call(&address, &secret, "POST /api/v1/plugins", module).unwrap();
            assert!(answer.starts_with("HTTP/1.1 422"), "{answer}");
        }
    });
    // The machine takes what it gets as fast as it comes, and a panel asks all the time.
    let (mut got, mut answers) = (Vec::new(), Vec::new());
    while got.len() < program.len() || !uploads.is_finished() {
        take(&pty, &mut got);
        let begin = Instant::now();
        let answer = call(&gateway.address, &token, "GET /api/v1/links", b"").unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        answers.push(begin.elapsed());
        assert!(got.len() <= program.len());
        std::thread::sleep(Duration::from_millis(2));
    }
    uploads.join().unwrap();
    assert!(got == program.as_bytes());
    answers.sort();
    let fed = call(&gateway.address, &token, "GET /api/v1/links/lathe", b"").unwrap();
    let starved =
        |name: &str| fed.split_once(name).unwrap().1.split(',').next().unwrap().to_owned();
    println!(
        "{} answers beside the bombs, p99 {:?}, at most {:?}; the machine fed starved {} times, {} µs",
        answers.len(),
        answers[answers.len() * 99 / 100],
        answers[answers.len() - 1],
        starved("\"starved\":"),
        starved("\"starved_us\":"),
    );
    // Each that was put there is refused and told once, and stays; the pipe too.
    let refused = REFUSED.len() + COMPILED + 1;
    let journal = || {
        let asked = "GET /api/v1/journal?limit=500";
        call(&gateway.address, &token, asked, b"").unwrap().matches("was not taken").count()
    };
    wait_for("refusals", || journal() >= refused);
    assert_eq!(journal(), refused);
    assert_eq!(fs::read_dir(bench.path("state/plugins/incoming")).unwrap().count(), refused);
    let not_taken = || {
        let asked = "GET /api/v1/journal?limit=500";
        let journal = call(&gateway.address, &token, asked, b"").unwrap();
        journal.contains("what is new in the library is not taken")
    };
    wait_for("the word on the one that is followed", not_taken);
    // Both links run what they ran.
    let links = call(&gateway.address, &token, "GET /api/v1/links", b"").unwrap();
    assert!(!links.contains("9.0.0"), "{links}");

    // A stop in the middle of compiling does not wait for it.
    let (address, secret) = (gateway.address.clone(), token.clone());
    let module = recipes(&HEAVIEST)[0].module();
    let upload = std::thread::spawn(move || {
        // Answered or not: the gateway is going.
        let _ = call(&address, &secret, "POST /api/v1/plugins", &module);
    });
    std::thread::sleep(Duration::from_millis(100));
    gateway.signal(Signal::TERM);
    let (code, log) = gateway.end();
    assert_eq!(code, Some(0), "{log}");
    upload.join().unwrap();
}
