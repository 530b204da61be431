//! A shop over loopback: so many units, each a process, a gateway that feeds them, and at each unit a
//! simulated control that cuts what it is fed; all in real time.
//!
//! `cargo run --release -p softplug-unit --example shop -- target/release/softplug UNITS SECONDS [MARGIN]`
//!
//! With a margin, such as 0.01, all are fed over a bus that carries just as much as the planner says
//! that so many need, and units have the buffers that it says.
//!
//! Prints one JSON object: what the controls saw, and what gateway and units used. Ends with 1 if a
//! control ran empty, overflowed or got another byte than its program has. Where a control itself was
//! late by more than its free bytes last, its alarms prove nothing: the computer was too busy.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serde_json::Value;
use softplug_abi::{LineParameters, Micros};
use softplug_live::simulator::Simulator;
use softplug_machines::xon_xoff::{Control, ControlOptions, ControlReport};
use softplug_plan::{Machine, Plan, plan};
use softplug_unit::{Unit, UnitConfig};

/// Bits a second on each line, and bytes that each control cuts of the 1,920 that it carries.
const BAUD: u32 = 19_200;
const CUTS: u32 = 1_800;
const API: &str = "http://127.0.0.1:8137";

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments == ["unit"] {
        return run_unit();
    }
    let [softplug, units, seconds, rest @ ..] = arguments.as_slice() else {
        return Err("SOFTPLUG UNITS SECONDS [MARGIN] are wanted".into());
    };
    let (units, seconds): (usize, u64) = (units.parse()?, seconds.parse()?);
    let bus = rest.first().map(|margin| just_enough(units as u64, margin.parse()?)).transpose()?;
    let softplug = fs::canonicalize(softplug)?;
    let folder = tempfile::tempdir()?;
    let controls = (0..units).map(|_| Cutting::start()).collect::<Outcome<Vec<_>>>()?;
    let shop = Shop::start(&softplug, folder.path(), &controls, bus, seconds)?;
    let Fed { gateway, units: all_units, buses } = shop.feed(seconds)?;
    let reports: Vec<ControlReport> = controls.into_iter().map(Cutting::stop).collect();
    let sum = |of: fn(&ControlReport) -> u64| reports.iter().map(of).sum::<u64>();
    let wrong = reports
        .iter()
        .enumerate()
        .filter(|(at, report)| !report.received.matches(program(*at, seconds).as_bytes()));
    let (wrong, starved) = (wrong.count(), sum(|report| u64::from(report.starved)));
    let overflows = sum(|report| report.alarms.len() as u64);
    println!(
        "{{\"units\": {units}, \"seconds\": {seconds}, \"bytes\": {}, \"wrong_programs\": {wrong}, \"starved\": \
         {starved}, \"overflows\": {overflows}, \"controls_late_ms\": {}, \"holds\": {}, \"gateway_cpu_percent\": {:.1}, \
         \"unit_cpu_percent\": {:.2}, \"bus\": {}}}",
        sum(|report| report.received.count()),
        reports.iter().map(|report| report.late.0 / 1_000).max().unwrap_or_default(),
        sum(|report| u64::from(report.holds)),
        gateway,
        all_units / units as f64,
        bus.map_or("null".to_owned(), |bus| bus.json(&buses)),
    );
    if wrong > 0 || starved > 0 || overflows > 0 {
        return Err("a control ran empty, overflowed or got another byte".into());
    }
    Ok(())
}

/// A unit, as its own process: that of this folder.
fn run_unit() -> Outcome {
    let identity = u64::from(std::process::id()) << 32;
    let unit = Unit::start(UnitConfig::read(Path::new("unit.toml"))?, identity)?;
    println!("{{\"address\":\"{}\"}}", unit.address());
    Ok(unit.run()?)
}

/// A program of which each control has another one, and which takes so long to cut.
fn program(number: usize, seconds: u64) -> String {
    let size = seconds as usize * CUTS as usize;
    let mut text = String::new();
    for block in 1.. {
        if text.len() >= size {
            break;
        }
        let _ = writeln!(text, "N{block} G1 X{number} Y{}", block * 7 % 1_000);
    }
    text
}

/// A bus as the planner has it.
#[derive(Clone, Copy)]
struct Bus {
    rate: u64,
    margin: f64,
    load: f64,
    /// Bytes of each unit's buffer.
    buffer: u64,
}

const EFFICIENCY: f64 = 0.5;
const SWITCH: f64 = 0.01;
/// Bytes that a control has at least when the line is let go.
const LOW: u64 = 512;

/// The slowest bus that feeds so many machines, in whole bits per second.
fn just_enough(units: u64, margin: f64) -> Outcome<Bus> {
    let of = |rate: u64| -> Outcome<Plan> {
        let bus = softplug_plan::Bus {
            rate: rate as f64,
            efficiency: EFFICIENCY,
            switch: SWITCH,
            margin,
        };
        let machine = Machine {
            name: "mill".to_owned(),
            rate: f64::from(BAUD),
            efficiency: 0.8,
            consumes: 8.0 * f64::from(CUTS),
            buffer: LOW,
            count: units,
        };
        Ok(plan(&softplug_plan::Shop::new(bus, vec![machine])?))
    };
    let (mut less, mut enough) = (1_u64, 1_u64 << 30);
    while enough - less > 1 {
        let rate = less.midpoint(enough);
        if of(rate)?.largest_equal >= units { enough = rate } else { less = rate }
    }
    let plan = of(enough)?;
    let bits = plan.machines[0].unit_buffer_bits.ok_or("the planner refuses the shop")?;
    let load = plan.bus.load;
    Ok(Bus { rate: enough, margin, load, buffer: (bits / 8.0).ceil() as u64 })
}

impl Bus {
    fn toml(&self) -> String {
        let Self { rate, .. } = self;
        format!(
            "[[bus]]\nname = \"hall\"\nrate = {rate}\nefficiency = {EFFICIENCY:?}\nswitch = \"{}ms\"\n",
            SWITCH * 1e3
        )
    }

    /// What was planned, and what the gateway measured: the mean and the most of all looks.
    fn json(&self, looks: &[Value]) -> String {
        let Self { rate, margin, load, buffer } = self;
        let measured = |key: &str| {
            let seen: Vec<f64> =
                looks.iter().filter_map(|look| look["measured"][key].as_f64()).collect();
            let mean = seen.iter().sum::<f64>() / seen.len() as f64;
            let most = seen.iter().copied().fold(0.0, f64::max);
            format!("\"{key}\": {{\"mean\": {mean:.4}, \"most\": {most:.4}}}")
        };
        let lowest = looks.iter().flat_map(|look| look["units"].as_array().into_iter().flatten());
        let lowest = lowest.filter_map(|unit| unit["level"].as_u64()).min().unwrap_or_default();
        let takes: Vec<f64> = looks
            .last()
            .into_iter()
            .flat_map(|look| look["units"].as_array().into_iter().flatten())
            .filter_map(|unit| unit["consumes"].as_f64())
            .collect();
        let takes = takes.iter().copied().fold(0.0, f64::max);
        format!(
            "{{\"rate\": {rate}, \"margin\": {margin}, \"planned_load\": {load:.4}, \"unit_buffer\": {buffer}, \
             {}, {}, {}, \"lowest_level\": {lowest}, \"most_consumed\": {takes:.0}}}",
            measured("load"),
            measured("efficiency"),
            measured("switch_seconds"),
        )
    }
}

/// What feeding came to: hundredths of a core of the gateway and of all units, and what the bus
/// looked like.
struct Fed {
    gateway: f64,
    units: f64,
    buses: Vec<Value>,
}

/// A control on a thread of its own.
struct Cutting {
    port: String,
    is_stopped: Arc<AtomicBool>,
    thread: JoinHandle<ControlReport>,
}

impl Cutting {
    fn start() -> Outcome<Self> {
        let line = LineParameters::new(BAUD);
        let options = ControlOptions {
            line,
            buffer: 2_048,
            low: 512,
            high: 1_024,
            rate: CUTS,
            // It begins to cut when its buffer has been filled.
            pauses: vec![(0, Micros::from_millis(2_000))],
            receive_fifo: 4_096,
            ..ControlOptions::default()
        };
        let mut simulator = Simulator::new(Control::new(options)?)?;
        let port = simulator.port().to_string();
        let is_stopped = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&is_stopped);
        let thread = thread::spawn(move || {
            while !stopped.load(Ordering::Relaxed) {
                let until = simulator.now() + Micros::from_millis(200);
                simulator.turn(until).expect("a pty works");
            }
            simulator.partner.report()
        });
        Ok(Self { port, is_stopped, thread })
    }

    fn stop(self) -> ControlReport {
        self.is_stopped.store(true, Ordering::Relaxed);
        self.thread.join().expect("a control does not panic")
    }
}

/// Processes that are ended with the shop.
struct Shop<'a> {
    softplug: &'a Path,
    folder: &'a Path,
    gateway: Child,
    units: Vec<Child>,
}

impl<'a> Shop<'a> {
    fn start(
        softplug: &'a Path,
        folder: &'a Path,
        controls: &[Cutting],
        bus: Option<Bus>,
        seconds: u64,
    ) -> Outcome<Self> {
        let plugin = softplug.with_file_name("../plugins/xon-xoff.wasm");
        let mut text = "[gateway]\nwatch = false\n[http]\nlisten = \"127.0.0.1:8137\"\n\
                        tokens = \"tokens.toml\"\nrequests-per-second = 10000\nburst = 10000\n"
            .to_owned();
        text.push_str(&bus.as_ref().map(Bus::toml).unwrap_or_default());
        let on = if bus.is_some() { "bus = \"hall\"\n" } else { "" };
        let buffer = bus.map_or(16 << 10, |bus| bus.buffer);
        let mut units = Vec::new();
        fs::create_dir_all(folder.join("programs"))?;
        for (at, control) in controls.iter().enumerate() {
            let own = folder.join(format!("unit-{at}"));
            fs::create_dir_all(&own)?;
            let port = &control.port;
            let unit = format!(
                "name = \"unit-{at}\"\nlisten = \"127.0.0.1:0\"\nstate = \"state\"\n[signature]\nunsigned = true\n\
                 [[link]]\nname = \"mill\"\nport = \"{port}\"\nline = \"{BAUD} 8N1\"\nbuffer = {buffer}\ndepth = 16\n"
            );
            fs::write(own.join("unit.toml"), unit)?;
            let (child, address) =
                ready(Command::new(std::env::current_exe()?).arg("unit").current_dir(&own))?;
            units.push(child);
            let _ = writeln!(
                text,
                "[[link]]\nname = \"mill-{at}\"\nport = \"unit://{address}/mill\"\nplugin = \"xon-xoff\"\n{on}"
            );
            fs::write(folder.join(format!("programs/O{at}.nc")), program(at, seconds))?;
        }
        fs::write(folder.join("gateway.toml"), text)?;
        let run = |words: &[&str]| -> Outcome<Vec<u8>> {
            let output = Command::new(softplug).args(words).current_dir(folder).output()?;
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            if output.status.success() { Ok(output.stdout) } else { Err(said.into()) }
        };
        let plugin = match bus {
            Some(_) => unchecked(&plugin, folder)?,
            None => plugin,
        };
        let plugin = plugin.display().to_string();
        run(&["plugin", "add", &plugin, "--library", "state/plugins"])?;
        let token = Command::new(softplug)
            .args(["gateway", "token", "--name", "shop", "--role", "admin"])
            .current_dir(folder)
            .output()?;
        fs::write(folder.join("tokens.toml"), token.stdout)?;
        let shown = String::from_utf8(token.stderr)?;
        let token = shown.split_whitespace().find(|word| word.starts_with("softplug_"));
        fs::write(folder.join("token"), token.ok_or("no token")?)?;
        let (gateway, _) =
            ready(Command::new(softplug).args(["gateway", "run", "--json"]).current_dir(folder))?;
        Ok(Self { softplug, folder, gateway, units })
    }

    /// Sends each its program, and waits until all are cut.
    fn feed(&self, seconds: u64) -> Outcome<Fed> {
        thread::sleep(Duration::from_secs(10));
        let (begin, before) = (Instant::now(), self.used()?);
        for at in 0..self.units.len() {
            let (program, link) = (format!("O{at}.nc"), format!("mill-{at}"));
            self.ask(&["job", "submit", &link, &program])?;
        }
        let until = begin + Duration::from_secs(seconds + 120);
        let mut used = (0.0, 0.0);
        let mut is_measured = false;
        let mut buses = Vec::new();
        loop {
            thread::sleep(Duration::from_secs(2));
            // When all are fed: not in the first rounds, nor when the first have ended.
            let elapsed = begin.elapsed().as_secs();
            if (seconds / 4..seconds * 3 / 4).contains(&elapsed) {
                buses.extend(self.buses()?);
            }
            if !is_measured && begin.elapsed() >= Duration::from_secs(seconds * 3 / 4) {
                let (span, after) = (begin.elapsed().as_secs_f64(), self.used()?);
                used = ((after.0 - before.0) / span, (after.1 - before.1) / span);
                is_measured = true;
            }
            let jobs = self.ask(&["job", "list", "--limit", "1000", "--json"])?;
            let ended = jobs.matches("\"state\":\"done\"").count()
                + jobs.matches("\"state\": \"done\"").count();
            if ended == self.units.len() {
                // What is in the controls' buffers is cut.
                thread::sleep(Duration::from_secs(3));
                let (gateway, units) = used;
                return Ok(Fed { gateway, units, buses });
            }
            if Instant::now() > until {
                return Err(format!("{ended} of {} jobs are done", self.units.len()).into());
            }
        }
    }

    fn buses(&self) -> Outcome<Vec<Value>> {
        let token = fs::read_to_string(self.folder.join("token"))?;
        let request = format!(
            "GET /api/v1/buses HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {}\r\nConnection: close\r\n\r\n",
            token.trim()
        );
        let mut stream = TcpStream::connect(API.trim_start_matches("http://"))?;
        stream.write_all(request.as_bytes())?;
        let mut text = String::new();
        stream.read_to_string(&mut text)?;
        let (_, body) = text.split_once("\r\n\r\n").ok_or("an answer without a body")?;
        Ok(serde_json::from_str(body)?)
    }

    fn ask(&self, words: &[&str]) -> Outcome<String> {
        let output = Command::new(self.softplug)
            .args(words)
            .args(["--gateway", API])
            .env("SOFTPLUG_TOKEN", fs::read_to_string(self.folder.join("token"))?)
            .output()?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
        }
        Ok(String::from_utf8(output.stdout)?)
    }

    /// Hundredths of a second of computing of the gateway, and of all units.
    fn used(&self) -> Outcome<(f64, f64)> {
        let units = self.units.iter().map(|unit| computed(unit.id())).sum::<Outcome<f64>>()?;
        Ok((computed(self.gateway.id())?, units))
    }
}

impl Drop for Shop<'_> {
    fn drop(&mut self) {
        for child in self.units.iter_mut().chain([&mut self.gateway]) {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The plug-in without its wish to see each program before it sends it: all of it would pass the bus
/// twice, at another pace than that of cutting.
fn unchecked(plugin: &Path, folder: &Path) -> Outcome<PathBuf> {
    const WISH: &[u8] = b",\"check_pass\":true";
    let mut module = fs::read(plugin)?;
    let at = module.windows(WISH.len()).position(|bytes| bytes == WISH).ok_or("no such wish")?;
    module[at..at + WISH.len()].fill(b' ');
    let file = folder.join("unchecked.wasm");
    fs::write(&file, module)?;
    Ok(file)
}

fn computed(process: u32) -> Outcome<f64> {
    let text = fs::read_to_string(format!("/proc/{process}/stat"))?;
    let (_, behind) = text.rsplit_once(')').ok_or("a process has no name")?;
    let fields: Vec<&str> = behind.split_whitespace().collect();
    Ok(fields[11].parse::<f64>()? + fields[12].parse::<f64>()?)
}

/// Starts a process that says in its first line where it listens.
fn ready(command: &mut Command) -> Outcome<(Child, String)> {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
    let output = child.stdout.take().ok_or("it has an output")?;
    let (tell, told) = mpsc::channel();
    thread::spawn(move || {
        let mut lines = BufReader::new(output).lines();
        let _ = tell.send(lines.next());
        lines.for_each(drop);
    });
    let line = told.recv_timeout(Duration::from_mins(1))?.ok_or("it ended at once")??;
    let address = line.split("\"address\":\"").nth(1).and_then(|rest| rest.split('"').next());
    Ok((child, address.ok_or("it says no address")?.to_owned()))
}
