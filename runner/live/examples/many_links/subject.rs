//! What is measured: the gateway, or ser2net, as a process of its own.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use mio::net::TcpStream;
use softplug_live::pty::PtyPair;

use super::placement::{Apart, Placement};
use super::used::resident;
use super::{Outcome, echo};

/// Within so long the gateway answers.
const PATIENCE: Duration = Duration::from_secs(30);
/// What waits in a client's own kernel buffers, at most: the lines are slow.
const SEND_BUFFER: usize = 8_192;

/// A link to add, as the gateway's process reads it.
pub struct Wanted(pub serde_json::Value);

impl Wanted {
    /// 8N1, with the plug-in's default settings.
    pub fn new(path: &Path, plugin: &str, baud: u32, depth: u32) -> Outcome<Self> {
        let path = path.to_str().ok_or("a path that is no text")?;
        Ok(Self(serde_json::json!({
            "path": path, "plugin": plugin, "baud": baud, "stop_half_bits": 2, "depth": depth,
        })))
    }
}

/// What is measured. It ends with this.
pub struct Subject {
    process: Child,
    /// The gateway's.
    input: Option<ChildStdin>,
    /// Lines that the gateway prints.
    answers: Receiver<String>,
    pub addresses: Vec<SocketAddr>,
    pub name: String,
    _folder: Option<tempfile::TempDir>,
    _apart: Option<Apart>,
    /// Resident bytes before the first link.
    pub before: u64,
}

impl Subject {
    /// A gateway without links, which has loaded these plug-ins.
    pub fn gateway(placement: Placement, plugins: &[&str]) -> Outcome<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("gateway").args(plugins).args(placement.options());
        let (mut process, apart) =
            placement.begin(command.stdin(Stdio::piped()).stdout(Stdio::piped()))?;
        let input = process.stdin.take();
        let output = process.stdout.take().ok_or("the gateway has no pipe")?;
        let (answer, answers) = channel();
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                let _ = answer.send(line);
            }
        });
        thread::sleep(Duration::from_millis(500));
        let before = resident(process.id())?;
        let name = "softplug".into();
        Ok(Self {
            process,
            input,
            answers,
            addresses: Vec::new(),
            name,
            _folder: None,
            _apart: apart,
            before,
        })
    }

    /// Adds links.
    pub fn add(&mut self, wanted: &[Wanted]) -> Outcome {
        for Wanted(link) in wanted {
            let input = self.input.as_mut().ok_or("links are added to the gateway only")?;
            writeln!(input, "{link}")?;
            let address = self.answer()?.parse()?;
            self.addresses.push(address);
        }
        Ok(())
    }

    /// All links are there; jobs begin.
    pub fn begin(&mut self) -> Outcome {
        Ok(writeln!(self.input.as_mut().ok_or("only the gateway has jobs")?)?)
    }

    /// The next line that the gateway prints.
    pub fn answer(&self) -> Outcome<String> {
        Ok(self.answers.recv_timeout(PATIENCE).map_err(|_| "the gateway does not answer")?)
    }

    /// ser2net with a raw TCP port for each machine.
    pub fn ser2net(placement: Placement, chardelay: bool, machines: &[PtyPair]) -> Outcome<Self> {
        let mut text = Vec::new();
        let (mut addresses, mut kept) = (Vec::new(), Vec::new());
        for (at, machine) in machines.iter().enumerate() {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
            let address = listener.local_addr()?;
            // Kept until all have one, so that no two get the same.
            kept.push(listener);
            let (path, port, baud) = (machine.slave_path().display(), address.port(), echo::BAUD);
            writeln!(text, "connection: &l{at}")?;
            writeln!(text, "  accepter: tcp,127.0.0.1,{port}")?;
            writeln!(text, "  connector: serialdev,{path},{baud}n81,local")?;
            writeln!(text, "  options:\n    chardelay: {chardelay}")?;
            addresses.push(address);
        }
        drop(kept);
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("ser2net.yaml");
        fs::write(&file, text)?;
        let mut command = Command::new(if placement.is_real_time { "chrt" } else { "ser2net" });
        if placement.is_real_time {
            command.args(["-r", "1", "ser2net"]);
        }
        let (process, apart) = placement.begin(command.arg("-n").arg("-c").arg(&file).arg("-u"))?;
        thread::sleep(Duration::from_secs(2));
        Ok(Self {
            process,
            input: None,
            answers: channel().1,
            addresses,
            name: format!("ser2net, chardelay {chardelay}"),
            _folder: Some(folder),
            _apart: apart,
            before: 0,
        })
    }

    pub fn pid(&self) -> u32 {
        self.process.id()
    }
}

impl Drop for Subject {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A client of a link. ser2net takes a while until it listens on a thousand ports.
pub fn connect(address: SocketAddr) -> Outcome<TcpStream> {
    for _ in 0..100 {
        if let Ok(stream) = std::net::TcpStream::connect(address) {
            stream.set_nodelay(true)?;
            stream.set_nonblocking(true)?;
            rustix::net::sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER)?;
            return Ok(TcpStream::from_std(stream));
        }
        thread::sleep(Duration::from_millis(100));
    }
    Err("nobody listens".into())
}
