//! What ails a serial port: rights, holders, driver, latency, lines, settings,
//! and what is heard on it.

use std::fmt;
use std::fs::{self, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use softplug_abi::{LineParameters, Micros, ModemLines};

use crate::error::{Holder, PortError};
use crate::poll::{Interest, Poller};
use crate::port::holders::{group_name, holders, is_pty, is_terminal};
use crate::port::{
    Flow, Input, LineCounters, Port, PortOptions, PortSpec, ReadOutcome, SettingDifference,
    TtyPort, line_text,
};
use crate::ports::link;
use crate::suggest::Sample;

/// Rates to listen at, the commonest of machine controls first.
pub const COMMON_BAUDS: [u32; 10] =
    [9_600, 4_800, 19_200, 2_400, 38_400, 1_200, 115_200, 57_600, 600, 300];

/// FTDI adapters hand bytes on after 16 ms unless told otherwise.
const SLOW_LATENCY_MILLIS: u32 = 2;

/// What was found about a port.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Report {
    /// The path that was asked for, or the device server as it was written.
    pub path: PathBuf,
    /// The device that it leads to, if it is a link.
    pub device: Option<PathBuf>,
    /// Its name by the socket that it is plugged into.
    pub by_path: Option<PathBuf>,
    /// Owner, group and rights, such as `root:dialout 660`.
    pub rights: Option<String>,
    /// Who has it open, as far as we may see.
    pub holders: Vec<Holder>,
    /// The kernel's driver.
    pub driver: Option<String>,
    /// How long the adapter keeps bytes back, ms.
    pub latency_millis: Option<u32>,
    /// The settings that the port had.
    pub line_before: Option<LineParameters>,
    /// The modem lines that it has, and those that are on.
    pub modem_lines: Option<(ModemLines, ModemLines)>,
    /// Line errors since the driver was loaded.
    pub counters: Option<LineCounters>,
    /// Settings that were asked for and not taken.
    pub differences: Vec<SettingDifference>,
    /// All of it in sentences, in the order in which it was looked at.
    pub findings: Vec<Finding>,
}

/// How much a finding matters.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Severity {
    /// As it should be.
    Good,
    /// Worth knowing.
    Note,
    /// The port cannot be used, or will lose data.
    Problem,
}

/// One finding.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// One sentence: what, and what to do.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = match self.severity {
            Severity::Good => "ok",
            Severity::Note => "note",
            Severity::Problem => "problem",
        };
        write!(f, "{mark}: {}", self.text)
    }
}

impl Report {
    /// Whether nothing stands in the way of using the port.
    pub fn is_usable(&self) -> bool {
        self.findings.iter().all(|finding| finding.severity != Severity::Problem)
    }

    /// Of a port of which nothing is known yet.
    fn of(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            device: None,
            by_path: None,
            rights: None,
            holders: Vec::new(),
            driver: None,
            latency_millis: None,
            line_before: None,
            modem_lines: None,
            counters: None,
            differences: Vec::new(),
            findings: Vec::new(),
        }
    }

    fn add(&mut self, severity: Severity, text: impl Into<String>) {
        self.findings.push(Finding { severity, text: text.into() });
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.findings.iter().try_for_each(|finding| writeln!(f, "{finding}"))
    }
}

/// Looks at a port, opening it for a moment if nobody has it.
pub fn examine(path: &Path, options: &PortOptions) -> Report {
    let mut report = Report {
        device: path.canonicalize().ok().filter(|device| device != path),
        by_path: link(Path::new("/dev/serial/by-path"), path),
        ..Report::of(path)
    };
    let metadata = match fs::metadata(path) {
        Ok(metadata) if metadata.file_type().is_char_device() && is_terminal(&metadata) => metadata,
        Ok(_) => {
            let error = PortError::NotATerminal { path: path.to_owned() };
            report.add(Severity::Problem, error.to_string());
            return report;
        }
        Err(_) => {
            let error = PortError::NotFound { path: path.to_owned() };
            report.add(Severity::Problem, error.to_string());
            return report;
        }
    };
    look_from_outside(&mut report, &metadata);
    // A pty's slave is held open by whoever simulates on its master.
    if report.holders.is_empty() || is_pty(&metadata) {
        look_inside(&mut report, options);
    }
    report
}

/// Looks at a device server, connecting to it for a moment; at most for the time-out of `options`
/// once the name is known. What only a port of this computer has is left out.
pub fn examine_server(spec: &PortSpec, options: &PortOptions) -> Report {
    let mut report = Report::of(&PathBuf::from(spec.to_string()));
    let port = match Port::open(spec, options) {
        Ok(port) => port,
        Err(error) => {
            report.differences = error.differences().to_vec();
            report.add(Severity::Problem, error.to_string());
            return report;
        }
    };
    if let Port::Rfc2217(server) = &port {
        let name = server.signature().map(|name| format!(" and calls itself {name}"));
        let text = format!("a device server answers, speaks RFC 2217{}", name.unwrap_or_default());
        report.add(Severity::Good, text);
        report.modem_lines = port.modem_lines();
        report.add(Severity::Good, lines_text(report.modem_lines));
        if let Some(text) = stopped_text(options.flow, report.modem_lines) {
            report.add(Severity::Problem, text);
        }
        report.differences = port.differences().to_vec();
        for difference in report.differences.clone() {
            report.add(Severity::Note, difference.to_string());
        }
    } else {
        let text = "it takes connections; a raw port says nothing of itself, of its settings or of \
                    what is behind it";
        report.add(Severity::Good, text);
    }
    let text = "driver, rights, latency timer and who else has it are known only of a port of this \
                computer: look for them at the device server";
    report.add(Severity::Note, text);
    report
}

/// Listens with 8 data bits and no parity at each rate for `each`; ends early
/// when the poller is woken. On a pty, which has no rate, once.
pub fn listen(
    port: &mut TtyPort,
    bauds: &[u32],
    each: Duration,
    poller: &mut Poller,
) -> Result<Vec<Sample>, PortError> {
    let bauds = if port.is_pty() { &bauds[..bauds.len().min(1)] } else { bauds };
    let mut samples = Vec::new();
    for &baud in bauds {
        match port.set_line(&PortOptions::new(LineParameters::new(baud))) {
            // A rate that the port does not have is none to listen at.
            Err(PortError::NotTaken { .. }) => continue,
            set => set?,
        }
        let baud = if port.is_pty() { 0 } else { baud };
        let (sample, woken) = listen_once(port, baud, each, poller)?;
        samples.push(sample);
        if woken {
            break;
        }
    }
    Ok(samples)
}

fn listen_once(
    port: &mut TtyPort,
    baud: u32,
    each: Duration,
    poller: &mut Poller,
) -> Result<(Sample, bool), PortError> {
    let mut sample = Sample { baud, ..Sample::default() };
    let span = Micros(i64::try_from(each.as_micros()).unwrap_or(i64::MAX));
    let end = poller.clock().now() + span;
    loop {
        let ready = poller.wait(Some(&port.fd()), Interest::READ, Some(end))?;
        if ready.readable || ready.hangup {
            let outcome = port.read(usize::MAX, &mut |input| sample.hear(&input))?;
            if let ReadOutcome::Gone(reason) = outcome {
                return Err(PortError::Gone(reason));
            }
        }
        if ready.woken || ready.timer || poller.clock().now() >= end {
            return Ok((sample, ready.woken));
        }
    }
}

fn look_from_outside(report: &mut Report, metadata: &Metadata) {
    let owner = if metadata.uid() == 0 { "root".to_owned() } else { metadata.uid().to_string() };
    let group = group_name(metadata.gid());
    report.rights = Some(format!("{owner}:{group} {:03o}", metadata.mode() & 0o777));
    report.holders = holders(&report.path);
    if !report.holders.is_empty() && !is_pty(metadata) {
        let error = PortError::InUse { path: report.path.clone(), holders: report.holders.clone() };
        report.add(Severity::Problem, error.to_string());
    }
    let device = report.device.clone().unwrap_or_else(|| report.path.clone());
    let Some(name) = device.file_name().and_then(|name| name.to_str()) else { return };
    report.driver = driver(Path::new("/sys"), name);
    if let Some(driver) = &report.driver {
        let text = format!("the driver is {driver}");
        report.add(Severity::Good, text);
    }
    report.latency_millis = latency_millis(Path::new("/sys"), name);
    match report.latency_millis {
        Some(millis) if millis > SLOW_LATENCY_MILLIS => report.add(
            Severity::Note,
            format!(
                "the adapter keeps bytes back for up to {millis} ms; it is asked for less while \
                 the port is open, to set it for good write 1 to the latency_timer of {name}"
            ),
        ),
        Some(millis) => {
            report.add(Severity::Good, format!("the adapter's latency timer is {millis} ms"));
        }
        None => {}
    }
    if let Some(lasting) = &report.by_path {
        let text = format!("its lasting name is {}", lasting.display());
        report.add(Severity::Good, text);
    }
}

fn look_inside(report: &mut Report, options: &PortOptions) {
    let port = match TtyPort::open(&report.path, options) {
        Ok(port) => port,
        Err(error) => {
            report.differences = error.differences().to_vec();
            report.add(Severity::Problem, error.to_string());
            return;
        }
    };
    report.add(Severity::Good, "it can be opened by this user and nobody else has it");
    let before = port.line_before();
    report.line_before = Some(before);
    report.add(Severity::Good, format!("it was set to {}", line_text(&before)));
    report.modem_lines = port.modem_lines();
    report.add(Severity::Good, lines_text(report.modem_lines));
    if let Some(text) = stopped_text(options.flow, report.modem_lines) {
        report.add(Severity::Problem, text);
    }
    report.counters = port.counters();
    if let Some(counters) = report.counters {
        let LineCounters { framing, parity, breaks, overruns } = counters;
        let any = framing > 0 || parity > 0 || overruns > 0;
        let severity = if any { Severity::Note } else { Severity::Good };
        let text = format!(
            "since its driver was loaded it has counted {parity} parity errors, {framing} framing \
             errors, {breaks} breaks and {overruns} overruns"
        );
        report.add(severity, text);
    }
    report.differences = port.differences().to_vec();
    for difference in report.differences.clone() {
        report.add(Severity::Note, difference.to_string());
    }
}

/// What keeps everything from leaving, where the partner stops the port with a line.
fn stopped_text(flow: Flow, lines: Option<(ModemLines, ModemLines)>) -> Option<String> {
    let (known, on) = lines?;
    let is_stopped = known.contains(ModemLines::CTS) && !on.contains(ModemLines::CTS);
    (flow == Flow::RtsCts && is_stopped).then(|| {
        "CTS is off, and with RTS/CTS nothing leaves while it is: the machine stops us, is off, or its \
         cable has no wire to our CTS"
            .to_owned()
    })
}

/// The modem lines in one sentence.
fn lines_text(lines: Option<(ModemLines, ModemLines)>) -> String {
    let Some((known, on)) = lines else { return "it has no modem lines".to_owned() };
    let names = [
        ("CTS", ModemLines::CTS),
        ("DSR", ModemLines::DSR),
        ("DCD", ModemLines::DCD),
        ("RI", ModemLines::RI),
        ("RTS", ModemLines::RTS),
        ("DTR", ModemLines::DTR),
    ];
    let state = |line| if on.contains(line) { "on" } else { "off" };
    let known = names.iter().filter(|(_, line)| known.contains(*line));
    let states: Vec<_> = known.map(|(name, line)| format!("{name} {}", state(*line))).collect();
    format!("its modem lines are {}", states.join(", "))
}

/// The name of the driver of a terminal.
fn driver(sys: &Path, name: &str) -> Option<String> {
    let device = sys.join("class/tty").join(name).join("device");
    // A port of the serial core hangs below two nodes of that core.
    let mut folder = device.canonicalize().ok()?;
    while folder.starts_with(sys) {
        let link = fs::read_link(folder.join("driver")).ok();
        let driver = link.and_then(|link| Some(link.file_name()?.to_str()?.to_owned()));
        match driver {
            Some(driver) if driver != "port" && driver != "ctrl" => return Some(driver),
            _ => folder = folder.parent()?.to_owned(),
        }
    }
    None
}

/// How long an adapter waits for more bytes before it hands them on.
fn latency_millis(sys: &Path, name: &str) -> Option<u32> {
    let places = [
        sys.join("class/tty").join(name).join("device/latency_timer"),
        sys.join("bus/usb-serial/devices").join(name).join("latency_timer"),
    ];
    places.iter().find_map(|place| fs::read_to_string(place).ok()?.trim().parse().ok())
}

impl Sample {
    /// Adds what was heard.
    fn hear(&mut self, input: &Input<'_>) {
        use softplug_abi::LineErrorKind as Kind;
        match input {
            Input::Bytes(bytes) => self.good.extend_from_slice(bytes),
            Input::LineError { kind: Kind::Break, .. } => self.breaks += 1,
            Input::LineError { kind: Kind::Overrun, .. } => self.overruns += 1,
            Input::LineError { byte, .. } => self.bad.extend(*byte),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn driver_and_latency_are_read_where_the_kernel_shows_them() {
        let root = tempfile::tempdir().unwrap();
        let sys = root.path().canonicalize().unwrap();
        let device = sys.join("devices/usb1/1-1:1.0/ttyUSB0");
        fs::create_dir_all(&device).unwrap();
        fs::create_dir_all(sys.join("class/tty/ttyUSB0")).unwrap();
        symlink(&device, sys.join("class/tty/ttyUSB0/device")).unwrap();
        symlink("../../../../bus/usb-serial/drivers/ftdi_sio", device.join("driver")).unwrap();
        assert_eq!(driver(&sys, "ttyUSB0").as_deref(), Some("ftdi_sio"));
        assert_eq!(latency_millis(&sys, "ttyUSB0"), None);
        fs::write(device.join("latency_timer"), "16\n").unwrap();
        assert_eq!(latency_millis(&sys, "ttyUSB0"), Some(16));
        assert_eq!(driver(&sys, "ttyUSB1"), None);
    }

    #[test]
    fn the_cores_own_drivers_are_passed_over() {
        let root = tempfile::tempdir().unwrap();
        let sys = root.path().canonicalize().unwrap();
        let device = sys.join("devices/pnp0/00:00/00:00:0/00:00:0.0");
        fs::create_dir_all(&device).unwrap();
        fs::create_dir_all(sys.join("class/tty/ttyS0")).unwrap();
        symlink(&device, sys.join("class/tty/ttyS0/device")).unwrap();
        symlink("/bus/serial-base/drivers/port", device.join("driver")).unwrap();
        symlink("/bus/serial-base/drivers/ctrl", sys.join("devices/pnp0/00:00/00:00:0/driver"))
            .unwrap();
        symlink("/bus/pnp/drivers/serial", sys.join("devices/pnp0/00:00/driver")).unwrap();
        assert_eq!(driver(&sys, "ttyS0").as_deref(), Some("serial"));
    }

    #[test]
    fn a_line_that_cts_stops_is_told_where_it_counts() {
        let lines = |on| Some((ModemLines::CTS.union(ModemLines::RTS), on));
        let off = lines(ModemLines::RTS);
        let text = stopped_text(Flow::RtsCts, off).unwrap();
        assert!(text.starts_with("CTS is off, and with RTS/CTS nothing leaves"), "{text}");
        assert_eq!(stopped_text(Flow::RtsCts, lines(ModemLines::CTS)), None);
        assert_eq!(stopped_text(Flow::Host, off), None);
        assert_eq!(stopped_text(Flow::RtsCts, None), None);
    }

    #[test]
    fn modem_lines_read_as_on_and_off() {
        let known = ModemLines::CTS.union(ModemLines::RTS);
        let text = lines_text(Some((known, ModemLines::RTS)));
        assert_eq!(text, "its modem lines are CTS off, RTS on");
    }
}
