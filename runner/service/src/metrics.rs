//! Metrics of the gateway as Prometheus reads them, in the OpenMetrics form.
//!
//! They are made of the same views that the API shows, at the moment at which they are asked for.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, text as openmetrics};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};

use crate::view::{BusUnitView, BusView, CountersView, HealthView, LinkState, LinkView};

/// What the text is.
pub(crate) const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Counters of requests.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// All that came.
    pub(crate) requests: AtomicU64,
    /// Without a token that is known.
    pub(crate) strangers: AtomicU64,
    /// Over the rate.
    pub(crate) hasty: AtomicU64,
    /// Answered with a status of 500 or above.
    pub(crate) failed: AtomicU64,
}

/// What the HTTP side counts.
#[derive(Copy, Clone, Debug)]
pub(crate) struct HttpFigures<'a> {
    pub(crate) tally: &'a Tally,
    pub(crate) connections: usize,
}

/// All metrics as text.
pub(crate) fn text(
    health: &HealthView,
    links: &[LinkView],
    buses: &[BusView],
    http: HttpFigures<'_>,
) -> Result<String, fmt::Error> {
    let mut registry = Registry::default();
    registry.register_collector(Box::new(Snapshot::new(health, links, buses, http)));
    let mut text = String::new();
    openmetrics::encode(&mut text, &registry)?;
    Ok(text)
}

#[derive(Debug)]
struct Snapshot {
    health: HealthView,
    links: Vec<LinkView>,
    buses: Vec<BusView>,
    connections: u64,
    /// By name, with what they count.
    requests: [(&'static str, &'static str, u64); 4],
}

impl Snapshot {
    fn new(
        health: &HealthView,
        links: &[LinkView],
        buses: &[BusView],
        http: HttpFigures<'_>,
    ) -> Self {
        let Tally { requests, strangers, hasty, failed } = http.tally;
        let [requests, strangers, hasty, failed] =
            [requests, strangers, hasty, failed].map(|count| count.load(Ordering::Relaxed));
        Self {
            health: health.clone(),
            links: links.to_vec(),
            buses: buses.to_vec(),
            connections: http.connections as u64,
            requests: [
                ("requests", "HTTP requests", requests),
                ("unauthorised", "HTTP requests without a known token", strangers),
                ("throttled", "HTTP requests over the rate", hasty),
                ("failed", "HTTP requests answered with a status of 500 or above", failed),
            ],
        }
    }
}

type Counted = fn(&CountersView) -> u64;

/// Name, what it is, how it is had.
const COUNTERS: [(&str, &str, Counted); 14] = [
    ("holds", "How often the machine has held the line", |of| of.holds),
    ("gaps", "How often the line stood still although bytes waited", |of| of.gaps),
    ("after_stop_characters", "Characters sent after the machine had said stop", |of| {
        of.after_stop
    }),
    ("starved", "How often the buffer ran empty in the middle of a job", |of| of.starved),
    ("events", "Events that the plug-in was given", |of| of.events),
    ("fuel", "Units of fuel that the plug-in used", |of| of.fuel),
    ("restarts", "How often the plug-in was started again after a fault", |of| of.restarts),
    ("reopened", "How often the port was opened again", |of| of.reopened),
    ("notes_dropped", "Messages of the plug-in that were dropped", |of| of.notes_dropped),
    ("endpoint_jobs", "What the endpoint's clients sent, in jobs", |of| of.endpoint_jobs),
    ("endpoint_failed", "Those of them that failed", |of| of.endpoint_failed),
    ("endpoint_bytes", "Bytes that were taken of them", |of| of.endpoint_bytes),
    ("received_bytes", "Good bytes from the machine", |of| of.bytes_in),
    ("sent_bytes", "Bytes to the machine", |of| of.bytes_out),
];

/// The counters of times, in microseconds.
const TIMES: [(&str, &str, Counted); 2] = [
    ("held", "Time for which the machine held the line", |of| of.held_us),
    ("starved_time", "Time for which the buffer was empty in the middle of a job", |of| {
        of.starved_us
    }),
];

type Measured = fn(&LinkView) -> u64;

const GAUGES: [(&str, &str, Measured); 9] = [
    ("up", "1 if the port is open and the plug-in runs", |link| link.is_up().into()),
    ("is_held", "1 while the machine holds the line", |link| link.is_held.into()),
    ("queued_jobs", "Jobs that wait", |link| link.queued.into()),
    ("unseen_jobs", "Jobs that ended badly and that nobody has acknowledged", |link| {
        link.unseen_count.into()
    }),
    ("alarms", "Watchdogs that have found something", |link| link.alarms.len() as u64),
    ("buffer_bytes", "Bytes in the buffer before the machine", |link| link.buffer.level),
    ("buffer_low_bytes", "Its low mark", |link| link.buffer.low),
    ("buffer_high_bytes", "Its high mark", |link| link.buffer.high),
    ("buffer_size_bytes", "Its size", |link| link.buffer.size),
];

impl LinkView {
    fn is_up(&self) -> bool {
        use LinkState::{Idle, Paused, Receiving, Sending};
        matches!(self.state, Idle | Sending | Receiving | Paused)
    }
}

impl Collector for Snapshot {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        self.gateway(&mut encoder)?;
        self.http(&mut encoder)?;
        self.links(&mut encoder)?;
        self.buses(&mut encoder)
    }
}

type OfBus = fn(&BusView) -> Option<f64>;

/// Of each bus: name, what it is, its unit, how it is had. What was not measured is left out.
const OF_BUSES: [(&str, &str, Option<Unit>, OfBus); 6] = [
    ("planned_rate", "Bits per second, as planned", None, |bus| Some(bus.rate)),
    ("planned_efficiency", "Data bits of all bits, as planned", None, |bus| Some(bus.efficiency)),
    ("planned_switch", "Time to switch to another unit, as planned", Some(Unit::Seconds), |bus| {
        Some(bus.switch_seconds)
    }),
    ("load", "Data that was sent, as a part of what is planned", None, |bus| bus.measured.load),
    ("efficiency", "Data bits of all bits, measured", None, |bus| bus.measured.efficiency),
    ("switch", "Time to switch to another unit, measured", Some(Unit::Seconds), |bus| {
        bus.measured.switch_seconds
    }),
];

type OfBusUnit = fn(&BusUnitView) -> u64;

/// Of each unit on a bus: name, what it is, how it is had.
const OF_BUS_UNITS: [(&str, &str, OfBusUnit); 2] = [
    ("unit_level_bytes", "Bytes in the unit's buffer", |unit| unit.level),
    ("unit_buffer_bytes", "Bytes of the unit's buffer", |unit| unit.buffer),
];

impl Snapshot {
    fn gateway(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let HealthView { is_healthy, version, started_ms, .. } = &self.health;
        let mut gauge = |name: &str, help: &str, unit, value: f64| {
            let value = ConstGauge::new(value);
            value.encode(encoder.encode_descriptor(name, help, unit, value.metric_type())?)
        };
        gauge("softplug_healthy", "1 if the gateway is healthy", None, f64::from(*is_healthy))?;
        let started = *started_ms as f64 / 1000.0;
        gauge("softplug_start_time", "When it started, since 1970", Some(&Unit::Seconds), started)?;
        let one = ConstGauge::new(1_u64);
        let help = "The gateway's version";
        let mut info =
            encoder.encode_descriptor("softplug_build", help, None, one.metric_type())?;
        one.encode(info.encode_family(&[("version", version.as_str())])?)
    }

    fn http(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let open = ConstGauge::new(self.connections);
        let help = "HTTP connections that are open";
        open.encode(encoder.encode_descriptor(
            "softplug_http_connections",
            help,
            None,
            open.metric_type(),
        )?)?;
        for (name, help, count) in self.requests {
            let count = ConstCounter::new(count);
            let name = format!("softplug_http_{name}");
            count.encode(encoder.encode_descriptor(&name, help, None, count.metric_type())?)?;
        }
        Ok(())
    }

    fn links(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        if self.links.is_empty() {
            return Ok(());
        }
        for (name, help, value) in GAUGES {
            self.each(encoder, (name, help, None), |link| ConstGauge::new(value(link)))?;
        }
        for (name, help, count) in COUNTERS {
            let counter = |link: &LinkView| ConstCounter::new(count(&link.counters));
            self.each(encoder, (name, help, None), counter)?;
        }
        for (name, help, micros) in TIMES {
            let seconds = |link: &LinkView| micros(&link.counters) as f64 / 1e6;
            let counter = |link: &LinkView| ConstCounter::new(seconds(link));
            self.each(encoder, (name, help, Some(&Unit::Seconds)), counter)?;
        }
        self.labelled(encoder)
    }

    fn buses(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        for (name, help, unit, value) in OF_BUSES {
            let kind = ConstGauge::new(0.0_f64).metric_type();
            let name = format!("softplug_bus_{name}");
            let mut metric = encoder.encode_descriptor(&name, help, unit.as_ref(), kind)?;
            for bus in &self.buses {
                let Some(value) = value(bus) else { continue };
                let labels = [("bus", bus.name.as_str())];
                ConstGauge::new(value).encode(metric.encode_family(&labels)?)?;
            }
        }
        for (name, help, value) in OF_BUS_UNITS {
            let kind = ConstGauge::new(0_u64).metric_type();
            let name = format!("softplug_bus_{name}");
            let mut metric = encoder.encode_descriptor(&name, help, None, kind)?;
            for bus in &self.buses {
                for unit in &bus.units {
                    let labels = [("bus", bus.name.as_str()), ("link", unit.link.as_str())];
                    ConstGauge::new(value(unit)).encode(metric.encode_family(&labels)?)?;
                }
            }
        }
        Ok(())
    }

    /// One value of each link.
    fn each<M: EncodeMetric>(
        &self,
        encoder: &mut DescriptorEncoder<'_>,
        (name, help, unit): (&str, &str, Option<&Unit>),
        value: impl Fn(&LinkView) -> M,
    ) -> fmt::Result {
        let name = format!("softplug_link_{name}");
        let kind = value(&self.links[0]).metric_type();
        let mut metric = encoder.encode_descriptor(&name, help, unit, kind)?;
        for link in &self.links {
            let labels = [("link", link.name.as_str())];
            value(link).encode(metric.encode_family(&labels)?)?;
        }
        Ok(())
    }

    /// What a link has several of, or says in words.
    fn labelled(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let one = ConstGauge::new(1_u64);
        let help = "1 for the state that the link is in";
        let mut state =
            encoder.encode_descriptor("softplug_link_state", help, None, one.metric_type())?;
        for link in &self.links {
            let labels = [("link", link.name.as_str()), ("state", link.state.name())];
            one.encode(state.encode_family(&labels)?)?;
        }
        let help = "1 for the plug-in that the link runs";
        let mut plugin =
            encoder.encode_descriptor("softplug_link_plugin", help, None, one.metric_type())?;
        for link in &self.links {
            let Some(runs) = &link.plugin else { continue };
            let labels = [
                ("link", link.name.as_str()),
                ("plugin", runs.name.as_str()),
                ("version", runs.version.as_str()),
                ("sha256", runs.digest.as_str()),
            ];
            one.encode(plugin.encode_family(&labels)?)?;
        }
        let help = "Damaged characters and breaks";
        let kind = ConstCounter::new(0_u64).metric_type();
        let mut errors =
            encoder.encode_descriptor("softplug_link_line_errors", help, None, kind)?;
        for link in &self.links {
            for (kind, count) in &link.counters.line_errors {
                let labels = [("link", link.name.as_str()), ("kind", kind.as_str())];
                ConstCounter::new(*count).encode(errors.encode_family(&labels)?)?;
            }
        }
        Ok(())
    }
}
