//! The gateway's process. Each line of its input is a link to add, of which it
//! answers the endpoint's address; after an empty line it begins the jobs.

use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::mpsc::{Receiver, channel};

use serde_json::Value;
use softplug_abi::{JobId, LineParameters};
use softplug_host::{Host, HostOptions, Plugin, Session};
use softplug_link::Job;
use softplug_live::channel::StationOptions;
use softplug_live::endpoint::{EndpointSetup, ServerEndpoint};
use softplug_live::reactor::{
    Backoff, Command, Feed, LaneEndpoint, LaneId, LaneSetup, Reactor, ReactorOptions, Report,
    Watchdogs,
};
use softplug_live::reservoir::{ReservoirReader, reservoir};
use softplug_live::{PortOptions, PortSpec};

use super::Outcome;
use super::placement::Placement;

/// What the gateway's configuration gives a link's flight recorder by default.
const RECORDER: usize = 8_192;
/// The one job of a link that has one.
const JOB: u32 = 1;

struct Gateway {
    plugins: HashMap<String, Plugin>,
    reactor: Reactor<Session>,
    reports: Receiver<(LaneId, Report)>,
    programs: HashMap<LaneId, String>,
    lanes: u32,
}

pub fn run(placement: Placement, plugins: &[String]) -> Outcome {
    let host = Host::new(HostOptions::default())?;
    let plugins = plugins
        .iter()
        .map(|path| Ok((path.clone(), host.load(path.as_ref())?)))
        .collect::<Outcome<_>>()?;
    let (report, reports) = channel();
    let options = ReactorOptions {
        real_time_priority: placement.is_real_time.then_some(1),
        ..ReactorOptions::default()
    };
    let reactor = Reactor::start(options, move |lane, said| {
        if concerns_us(&said) {
            let _ = report.send((lane, said));
        }
    })?;
    let mut gateway = Gateway { plugins, reactor, reports, programs: HashMap::new(), lanes: 0 };
    let wanted = BufReader::new(std::io::stdin()).lines().map_while(Result::ok);
    for wanted in wanted.take_while(|line| !line.is_empty()) {
        let address = gateway.add(&serde_json::from_str(&wanted)?)?;
        println!("{address}");
    }
    for (lane, program) in &gateway.programs {
        let size = Some(program.len() as u64);
        let job = Job { id: JobId(JOB), kind: 0, size, fields: Vec::new(), check: true };
        gateway.reactor.tell(*lane, Command::Begin(Feed { job, source: whole(program) }));
    }
    // Until the harness ends us.
    for (lane, report) in &gateway.reports {
        gateway.hear(lane, report);
    }
    Ok(())
}

impl Gateway {
    fn add(&mut self, wanted: &Value) -> Outcome<SocketAddr> {
        let text = |key: &str| wanted[key].as_str().ok_or("a link lacks something");
        let number = |key: &str| wanted[key].as_u64().ok_or("a link lacks something");
        let plugin = self.plugins.get(text("plugin")?).ok_or("no such plug-in")?;
        let settings: Vec<(&str, &str)> = wanted["settings"]
            .as_object()
            .into_iter()
            .flatten()
            .filter_map(|(name, value)| Some((name.as_str(), value.as_str()?)))
            .collect();
        let endpoint =
            ServerEndpoint::new(EndpointSetup::new(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))));
        let address = endpoint.address().ok_or("no address for an endpoint")?;
        let line = LineParameters::new(number("baud")? as u32);
        let stop_half_bits = number("stop_half_bits")? as u8;
        let setup = LaneSetup {
            port: PortSpec::Device(text("path")?.into()),
            port_options: PortOptions::new(LineParameters { stop_half_bits, ..line }),
            station: StationOptions {
                settings: plugin.manifest().resolve_settings(settings)?,
                depth: wanted["depth"].as_u64().map(|depth| depth as u32),
                ..StationOptions::default()
            },
            instance: plugin.instantiate()?,
            endpoint: Some(LaneEndpoint {
                endpoint: Box::new(endpoint),
                job_kind: 0,
                fields: Vec::new(),
                check: false,
            }),
            watchdogs: Watchdogs::default(),
            reopen: Backoff::default(),
            recorder_bytes: RECORDER,
        };
        let lane = LaneId(self.lanes);
        self.lanes += 1;
        if let Some(program) = wanted["program"].as_str() {
            self.programs.insert(lane, program.to_owned());
        }
        self.reactor.add(lane, setup);
        loop {
            match self.reports.recv()? {
                (up, Report::Up) if up == lane => return Ok(address),
                (other, report) => self.hear(other, report),
            }
        }
    }

    fn hear(&self, lane: LaneId, report: Report) {
        match report {
            Report::Fault(fault) => eprintln!("{lane}: {}", fault.sentence),
            Report::Rewind { job } => {
                if let Some(program) = self.programs.get(&lane) {
                    let source = whole(program);
                    self.reactor.tell(lane, Command::Refill { job, source });
                }
            }
            Report::JobEnded(end) => println!("{:?}", end.outcome),
            _ => {}
        }
    }
}

/// States and the like are not collected: nobody reads them here.
fn concerns_us(report: &Report) -> bool {
    use Report::{Fault, JobEnded, Rewind, Up};
    matches!(report, Up | Fault(_) | Rewind { .. } | JobEnded(_))
}

/// A source in which all of it is there.
fn whole(program: &str) -> ReservoirReader {
    let (mut writer, reader) = reservoir(program.len(), 0, program.len());
    // It is as large as the program.
    let _ = writer.write(program.as_bytes());
    writer.finish();
    reader
}
