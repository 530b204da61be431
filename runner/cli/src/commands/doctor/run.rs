//! `softplug doctor`.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use serde::Serialize;
use softplug_abi::LineParameters;
use softplug_live::clock::Clock;
use softplug_live::doctor::{self, COMMON_BAUDS, Report, Severity};
use softplug_live::poll::Poller;
use softplug_live::port::{TtyPort, line_text};
use softplug_live::suggest::{Suggestion, suggest};
use softplug_live::{BadSpec, PortOptions, PortSpec};

use super::Arguments;
use crate::commands::ports::HolderEntry;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::screen::{BAD, GOOD, HEADING, Screen};
use crate::stop;

#[derive(Serialize)]
struct Document<'a> {
    port: String,
    usable: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    by_path: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rights: Option<&'a str>,
    holders: Vec<HolderEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    driver: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    latency_millis: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    line_before: Option<String>,
    findings: Vec<FindingEntry<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    heard: Option<Vec<Heard>>,
}

#[derive(Serialize)]
struct FindingEntry<'a> {
    severity: &'static str,
    text: &'a str,
}

#[derive(Serialize)]
struct Heard {
    line: String,
    /// 0 to 1000.
    score: u32,
    characters: usize,
    excerpt: String,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let baud = arguments.baud.first().copied().unwrap_or(COMMON_BAUDS[0]);
    let flow = arguments.flow.flow();
    let options = PortOptions { flow, ..PortOptions::new(LineParameters::new(baud)) };
    let server = server(&arguments.port)?;
    if server.is_some() && arguments.listen.is_some() {
        return Err(Failure::usage("--listen tries rates at a port of this computer only")
            .hint("leave it out, or run it on the computer that has the port"));
    }
    let report = match &server {
        Some(spec) => doctor::examine_server(spec, &options),
        None => doctor::examine(&arguments.port, &options),
    };
    for finding in &report.findings {
        let (style, mark) = match finding.severity {
            Severity::Good => (GOOD, "ok"),
            Severity::Note => (HEADING, "note"),
            Severity::Problem => (BAD, "problem"),
        };
        screen.say(format_args!("{style}{mark}{style:#}: {}", finding.text));
    }
    let heard = match arguments.listen {
        Some(seconds) if report.is_usable() => Some(listen(arguments, &options, seconds, screen)?),
        _ => None,
    };
    screen.document(&document(&report, heard.as_deref()));
    Ok(if report.is_usable() { Exit::Done } else { Exit::Port })
}

/// The device server, if it is one. A path that is no form of a port is examined as a path, which
/// says what is wrong with it.
fn server(port: &Path) -> Result<Option<PortSpec>, Failure> {
    let text = port.to_string_lossy();
    match text.parse::<PortSpec>() {
        Ok(PortSpec::Device(_)) => Ok(None),
        Err(BadSpec::Form(_)) if !text.contains("://") => Ok(None),
        Ok(PortSpec::Pty) => Err(Failure::usage("pty: makes a new pty, which nothing can ail")
            .hint("give a port that is there, such as /dev/ttyUSB0")),
        Ok(server @ (PortSpec::Tcp { .. } | PortSpec::Rfc2217 { .. })) => Ok(Some(server)),
        Err(error) => Err(error.into()),
    }
}

fn listen(
    arguments: &Arguments,
    options: &PortOptions,
    seconds: u32,
    screen: &Screen,
) -> Result<Vec<Suggestion>, Failure> {
    let bauds = if arguments.baud.is_empty() { &COMMON_BAUDS[..] } else { &arguments.baud };
    let mut port = TtyPort::open(&arguments.port, options)?;
    let rates = if port.is_pty() { 1 } else { bauds.len() };
    let all = u64::from(seconds) * rates as u64;
    screen.note(format_args!(
        "listening for {} s at each of {}, {all} s in all; let the machine send, Ctrl-C ends it",
        seconds,
        numbers::things(rates as u64, "baud rate"),
    ));
    let mut poller = Poller::new(Clock::start())?;
    let (stop, waker) = (stop::on_signals()?, poller.waker());
    // Ends with the process: a signal may come at any time until then.
    thread::spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_millis(50));
        }
        waker.wake();
    });
    let each = Duration::from_secs(u64::from(seconds));
    let samples = doctor::listen(&mut port, bauds, each, &mut poller)?;
    let suggestions = suggest(&samples);
    match suggestions.first() {
        None => screen.say(
            "nothing was heard: is the machine sending, and are the wires to pins 2 and 3 crossed?",
        ),
        Some(best) if best.is_good() => screen.say(format_args!(
            "it sounds like {GOOD}{}{GOOD:#}, of {}: {}",
            line_text(&best.line),
            numbers::things(best.characters as u64, "character"),
            best.excerpt
        )),
        Some(best) => screen.say(format_args!(
            "something is heard ({}), but it fits no common setting well; likeliest is {}: {}",
            numbers::things(best.characters as u64, "character"),
            line_text(&best.line),
            best.excerpt
        )),
    }
    Ok(suggestions)
}

fn document<'a>(report: &'a Report, heard: Option<&[Suggestion]>) -> Document<'a> {
    let findings = report.findings.iter().map(|finding| FindingEntry {
        severity: match finding.severity {
            Severity::Good => "ok",
            Severity::Note => "note",
            Severity::Problem => "problem",
        },
        text: &finding.text,
    });
    let heard = heard.map(|heard| {
        let entry = |suggestion: &Suggestion| Heard {
            line: line_text(&suggestion.line),
            score: suggestion.score,
            characters: suggestion.characters,
            excerpt: suggestion.excerpt.clone(),
        };
        heard.iter().map(entry).collect()
    });
    Document {
        port: report.path.display().to_string(),
        usable: report.is_usable(),
        by_path: report.by_path.as_ref().map(|path| path.display().to_string()),
        rights: report.rights.as_deref(),
        holders: report.holders.iter().map(HolderEntry::from).collect(),
        driver: report.driver.as_deref(),
        latency_millis: report.latency_millis,
        line_before: report.line_before.as_ref().map(line_text),
        findings: findings.collect(),
        heard,
    }
}
