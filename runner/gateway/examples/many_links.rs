//! How long an echo takes over many links at once, and what the gateway spends
//! on it: TCP client, endpoint, plug-in in its sandbox, pty, and back. With
//! ser2net in the gateway's place, the same without a plug-in.
//!
//! `many_links echo PLUGIN.wasm LINKS SECONDS` and
//! `many_links ser2net CHARDELAY LINKS SECONDS` print one line of JSON each;
//! `many_links saturate PLUGIN.wasm LINKS SECONDS DEPTH` fills lines of 9,600 baud both
//! ways instead and looks at each byte. What is
//! measured is another process, so that the clients' and machines' own work does
//! not count.

use std::error::Error;
use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::{AsFd, AsRawFd};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use mio::unix::SourceFd;
use mio::{Events, Interest, Poll, Token};
use softplug_abi::LineParameters;
use softplug_gateway::channel::StationOptions;
use softplug_gateway::endpoint::{EndpointSetup, ServerEndpoint};
use softplug_gateway::pty::PtyPair;
use softplug_gateway::reactor::{
    Backoff, LaneEndpoint, LaneId, LaneSetup, Reactor, ReactorOptions, Report, Watchdogs,
};
use softplug_gateway::{PortOptions, PortSpec, ReadOutcome};
use softplug_host::{Host, HostOptions};

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

const BAUD: u32 = 921_600;
/// Of lines that are filled.
const SLOW: u32 = 9_600;
const EVERY: Duration = Duration::from_millis(100);
const MESSAGE: usize = 16;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let of = |at: usize| {
        arguments.get(at).map(String::as_str).ok_or("read the first lines of the source")
    };
    match of(0)? {
        "gateway" => gateway(of(1)?, of(2)?.parse()?, of(3)?.parse()?),
        mode => {
            let (links, seconds) = (of(2)?.parse()?, of(3)?.parse()?);
            let machines = (0..links).map(|_| PtyPair::open()).collect::<Result<Vec<_>, _>>()?;
            let span = Duration::from_secs(seconds);
            let mut subject = match mode {
                "echo" => Subject::gateway(of(1)?, BAUD, 32, &machines)?,
                "saturate" => Subject::gateway(of(1)?, SLOW, of(4)?.parse()?, &machines)?,
                _ => Subject::ser2net(of(1)? == "true", &machines)?,
            };
            let result = if mode == "saturate" {
                saturate(&mut subject, &machines, span)
            } else {
                measure(&mut subject, &machines, span)
            };
            let _ = subject.process.kill();
            let _ = subject.process.wait();
            println!("{}", result?);
            Ok(())
        }
    }
}

/// The gateway's process: a port's path on each line of the input, the address of
/// its endpoint on each line of the output.
fn gateway(plugin: &str, baud: u32, depth: u32) -> Outcome {
    let host = Host::new(HostOptions::default())?;
    let plugin = host.load(plugin.as_ref())?;
    let settings = plugin.manifest().resolve_settings([])?;
    let (up, is_up) = channel();
    let reactor = Reactor::start(ReactorOptions::default(), move |_, report| {
        if matches!(report, Report::Up) {
            let _ = up.send(());
        } else if let Report::Fault(fault) = report {
            eprintln!("{}", fault.sentence);
        }
    })?;
    let paths = BufReader::new(std::io::stdin()).lines();
    for (at, path) in paths.map_while(Result::ok).take_while(|path| !path.is_empty()).enumerate() {
        let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let endpoint = ServerEndpoint::new(EndpointSetup::new(any));
        let address = endpoint.address().ok_or("no address for an endpoint")?;
        let endpoint = LaneEndpoint {
            endpoint: Box::new(endpoint),
            job_kind: 0,
            fields: Vec::new(),
            check: false,
        };
        let station = StationOptions {
            settings: settings.clone(),
            depth: Some(depth),
            ..StationOptions::default()
        };
        let setup = LaneSetup {
            port: PortSpec::Device(path.into()),
            port_options: PortOptions::new(LineParameters::new(baud)),
            station,
            instance: plugin.instantiate()?,
            endpoint: Some(endpoint),
            watchdogs: Watchdogs::default(),
            reopen: Backoff::default(),
            recorder_bytes: 0,
        };
        reactor.add(LaneId(at as u32), setup);
        is_up.recv()?;
        println!("{address}");
    }
    // Until the harness ends us.
    loop {
        thread::park();
    }
}

/// What is measured.
struct Subject {
    process: Child,
    addresses: Vec<SocketAddr>,
    name: String,
    _folder: Option<tempfile::TempDir>,
    /// Resident bytes before the first link.
    before: u64,
}

impl Subject {
    fn gateway(plugin: &str, baud: u32, depth: u32, machines: &[PtyPair]) -> Outcome<Self> {
        let mut process = Command::new(std::env::current_exe()?)
            .args(["gateway", plugin, &baud.to_string(), &depth.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let (Some(mut paths), Some(answers)) = (process.stdin.take(), process.stdout.take()) else {
            return Err("the gateway has no pipes".into());
        };
        thread::sleep(Duration::from_millis(500));
        let before = resident(process.id())?;
        let mut answers = BufReader::new(answers).lines();
        let mut addresses = Vec::new();
        for machine in machines {
            writeln!(paths, "{}", machine.slave_path().display())?;
            addresses.push(answers.next().ok_or("the gateway has ended")??.parse()?);
        }
        // Its input stays open: at its end nothing more is added, all the same.
        writeln!(paths)?;
        Ok(Self { process, addresses, name: "softplug".into(), _folder: None, before })
    }

    fn ser2net(chardelay: bool, machines: &[PtyPair]) -> Outcome<Self> {
        let mut text = Vec::new();
        let (mut addresses, mut kept) = (Vec::new(), Vec::new());
        for (at, machine) in machines.iter().enumerate() {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
            let address = listener.local_addr()?;
            // Kept until all have one, so that no two get the same.
            kept.push(listener);
            let path = machine.slave_path().display();
            let port = address.port();
            writeln!(text, "connection: &l{at}")?;
            writeln!(text, "  accepter: tcp,127.0.0.1,{port}")?;
            writeln!(text, "  connector: serialdev,{path},{BAUD}n81,local")?;
            writeln!(text, "  options:\n    chardelay: {chardelay}")?;
            addresses.push(address);
        }
        drop(kept);
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("ser2net.yaml");
        fs::write(&file, text)?;
        let process = Command::new("ser2net").arg("-n").arg("-c").arg(&file).arg("-u").spawn()?;
        thread::sleep(Duration::from_secs(2));
        let before = 0;
        let name = format!("ser2net, chardelay {chardelay}");
        Ok(Self { process, addresses, name, _folder: Some(folder), before })
    }
}

/// One link's two far ends.
struct Link {
    client: TcpStream,
    sent_at: Option<Instant>,
    back: usize,
}

/// ser2net takes a while until it listens on a thousand ports.
fn connect(address: SocketAddr) -> Outcome<TcpStream> {
    for _ in 0..100 {
        if let Ok(stream) = std::net::TcpStream::connect(address) {
            stream.set_nodelay(true)?;
            stream.set_nonblocking(true)?;
            return Ok(TcpStream::from_std(stream));
        }
        thread::sleep(Duration::from_millis(100));
    }
    Err("nobody listens".into())
}

fn measure(subject: &mut Subject, machines: &[PtyPair], span: Duration) -> Outcome<String> {
    let mut poll = Poll::new()?;
    let mut links = Vec::new();
    for (at, (machine, address)) in machines.iter().zip(&subject.addresses).enumerate() {
        let mut client = connect(*address)?;
        poll.registry().register(&mut client, Token(2 * at), Interest::READABLE)?;
        let fd = machine.master().as_fd().as_raw_fd();
        poll.registry().register(&mut SourceFd(&fd), Token(2 * at + 1), Interest::READABLE)?;
        links.push(Link { client, sent_at: None, back: 0 });
    }
    let begin = Instant::now() + Duration::from_secs(1);
    let pid = subject.process.id();
    let mut events = Events::with_capacity(1_024);
    let (mut trips, mut unanswered, mut late) = (Vec::new(), 0_u64, 0_u64);
    let (warm, end) = (begin + Duration::from_secs(1), begin + Duration::from_secs(1) + span);
    let mut used = None;
    let mut turn = 0;
    let mut buffer = [0; 4_096];
    loop {
        let now = Instant::now();
        if now >= end {
            break;
        }
        if now >= warm && used.is_none() {
            used = Some(cpu_ticks(pid)?);
        }
        // Each in its turn, evenly over the time.
        let count = links.len() as u32;
        let due = |turn: u32| begin + EVERY * (turn / count) + EVERY * (turn % count) / count;
        while due(turn) <= now {
            let link = &mut links[(turn % count) as usize];
            turn += 1;
            if link.sent_at.is_some() {
                unanswered += u64::from(now >= warm);
            }
            link.sent_at = Some(Instant::now());
            link.back = 0;
            if link.client.write(b"0123456789ABCDE\n").is_err() {
                return Err("a client cannot write".into());
            }
        }
        let wake = due(turn).min(end);
        let patience = wake.saturating_duration_since(Instant::now());
        // Rounded up to a millisecond by the poll, which only makes messages late.
        poll.poll(&mut events, Some(patience))?;
        for event in &events {
            let at = event.token().0 / 2;
            if event.token().0 % 2 == 1 {
                // The machine sends back what it gets.
                while let ReadOutcome::Read(count) = machines[at].read(&mut buffer)? {
                    let _ = machines[at].write(&buffer[..count])?;
                }
                continue;
            }
            loop {
                match links[at].client.read(&mut buffer) {
                    Ok(0) => return Err("a client was sent away".into()),
                    Ok(count) => {
                        let link = &mut links[at];
                        link.back += count;
                        // What came so late that the next message was out already.
                        late += u64::from(link.back > MESSAGE && Instant::now() >= warm);
                        if link.back == MESSAGE
                            && let Some(sent_at) = link.sent_at.take()
                            && sent_at >= warm
                        {
                            trips.push(sent_at.elapsed());
                        }
                    }
                    Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                    Err(error) => return Err(error.into()),
                }
            }
        }
    }
    let used = cpu_ticks(pid)? - used.unwrap_or(0);
    let grown = resident(pid)?.saturating_sub(subject.before);
    trips.sort();
    let micros = |part: f64| {
        let at = ((trips.len() as f64 * part) as usize).min(trips.len().saturating_sub(1));
        trips.get(at).map(Duration::as_micros)
    };
    Ok(serde_json::json!({
        "subject": subject.name,
        "links": machines.len(),
        "echoes": trips.len(),
        "unanswered": unanswered,
        "late": late,
        "p50_micros": micros(0.5),
        "p99_micros": micros(0.99),
        "max_micros": micros(1.0),
        "cpu_percent": used as f64 / span.as_secs_f64(),
        "resident_grown_kib": grown / 1_024,
    })
    .to_string())
}

/// A stream whose every byte is known; none is a control code.
fn byte(at: u64) -> u8 {
    b' ' + (at % 95) as u8
}

/// How far a line's two streams are, sent and received at each end.
struct Filled {
    client: TcpStream,
    to_machine: (u64, u64),
    to_client: (u64, u64),
}

/// Fills all lines both ways.
fn saturate(subject: &mut Subject, machines: &[PtyPair], span: Duration) -> Outcome<String> {
    let mut poll = Poll::new()?;
    let mut links = Vec::new();
    for (at, (machine, address)) in machines.iter().zip(&subject.addresses).enumerate() {
        let mut client = connect(*address)?;
        let both = Interest::READABLE | Interest::WRITABLE;
        poll.registry().register(&mut client, Token(2 * at), both)?;
        let fd = machine.master().as_fd().as_raw_fd();
        poll.registry().register(&mut SourceFd(&fd), Token(2 * at + 1), Interest::READABLE)?;
        links.push(Filled { client, to_machine: (0, 0), to_client: (0, 0) });
    }
    let mut events = Events::with_capacity(1_024);
    let pid = subject.process.id();
    let (begin, mut wrong, mut turn) = (Instant::now(), 0_u64, 0_u64);
    let warm = begin + Duration::from_secs(5);
    let mut start = None;
    let mut buffer = [0; 4_096];
    let total = |links: &[Filled]| {
        let sum = |of: fn(&Filled) -> u64| links.iter().map(of).sum::<u64>();
        (sum(|link| link.to_machine.1), sum(|link| link.to_client.1))
    };
    while begin.elapsed() < span + Duration::from_secs(5) {
        if start.is_none() && Instant::now() >= warm {
            start = Some((cpu_ticks(pid)?, total(&links)));
        }
        // Each machine sends what its line can carry, a hundredth of them at a time.
        while begin.elapsed() >= Duration::from_millis(turn) {
            for at in (0..machines.len()).filter(|at| *at as u64 % 100 == turn % 100) {
                let sent = &mut links[at].to_client.0;
                let bytes: Vec<u8> = (*sent..*sent + u64::from(SLOW) / 100).map(byte).collect();
                *sent += machines[at].write(&bytes)? as u64;
            }
            turn += 1;
        }
        poll.poll(&mut events, Some(Duration::from_millis(1)))?;
        for event in &events {
            let at = event.token().0 / 2;
            let link = &mut links[at];
            if event.token().0 % 2 == 1 {
                while let ReadOutcome::Read(count) = machines[at].read(&mut buffer)? {
                    // Control codes are the gateway's own.
                    for heard in buffer[..count].iter().filter(|heard| **heard >= b' ') {
                        wrong += u64::from(*heard != byte(link.to_machine.1));
                        link.to_machine.1 += 1;
                    }
                }
                continue;
            }
            while let Ok(count @ 1..) = link.client.read(&mut buffer) {
                for heard in &buffer[..count] {
                    wrong += u64::from(*heard != byte(link.to_client.1));
                    link.to_client.1 += 1;
                }
            }
            loop {
                let from = link.to_machine.0;
                let bytes: Vec<u8> = (from..from + 4_096).map(byte).collect();
                match link.client.write(&bytes) {
                    Ok(count) => link.to_machine.0 += count as u64,
                    Err(_) => break,
                }
            }
        }
    }
    let (ticks, before) = start.ok_or("too short")?;
    let cpu = (cpu_ticks(pid)? - ticks) as f64 / span.as_secs_f64();
    let after = total(&links);
    let rate = |bytes: u64| bytes as f64 / span.as_secs_f64() / machines.len() as f64;
    let grown = resident(pid)?.saturating_sub(subject.before);
    Ok(serde_json::json!({
        "links": machines.len(),
        "wrong_bytes": wrong,
        "to_machine_bytes": after.0,
        "to_client_bytes": after.1,
        "to_machine_bytes_per_second": rate(after.0 - before.0),
        "to_client_bytes_per_second": rate(after.1 - before.1),
        "cpu_percent": cpu,
        "resident_grown_kib": grown / 1_024,
    })
    .to_string())
}

/// Hundredths of a second that the process has computed, all its threads.
fn cpu_ticks(pid: u32) -> Outcome<u64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let rest = stat.rsplit_once(')').ok_or("no such statistics")?.1;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    Ok(fields[11].parse::<u64>()? + fields[12].parse::<u64>()?)
}

fn resident(pid: u32) -> Outcome<u64> {
    let text = fs::read_to_string(format!("/proc/{pid}/statm"))?;
    let pages: u64 = text.split_whitespace().nth(1).ok_or("no such statistics")?.parse()?;
    Ok(pages * 4_096)
}
