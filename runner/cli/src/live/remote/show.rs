//! Views as people read them.

use std::fmt::Write as _;

use softplug_service::view::{JobView, LinkView, PluginRef, Seen, SeenWhat, SwapView};

use super::printable;
use crate::numbers;

pub(super) fn plugin(plugin: Option<&PluginRef>) -> String {
    plugin.map_or_else(|| "-".to_owned(), |of| printable(&format!("{} {}", of.name, of.version)))
}

/// What the link is doing, with the machine's hold.
pub(super) fn state(link: &LinkView) -> String {
    let held = if link.is_held { ", held" } else { "" };
    format!("{}{held}", link.state.name())
}

/// The job that runs, and those behind it.
pub(super) fn doing(link: &LinkView) -> String {
    let mut parts = Vec::new();
    if let Some(job) = &link.job {
        let what = job.program.as_ref().unwrap_or(&job.kind);
        let done = match job.size {
            Some(size) if size > 0 => format!("{} %", job.surely_left.min(size) * 100 / size),
            _ => format!("{} bytes", numbers::count(job.surely_left)),
        };
        parts.push(format!("{}: {} {done}", job.id, printable(what)));
    }
    if let Some(receiving) = &link.receiving {
        let name = receiving.name.as_deref().unwrap_or("unnamed");
        parts.push(format!("receives {} {}", printable(name), numbers::count(receiving.bytes)));
    }
    if link.queued > 0 {
        parts.push(format!("{} waiting", link.queued));
    }
    parts.join(", ")
}

/// What is wrong with the link; empty if nothing is.
pub(super) fn trouble(link: &LinkView) -> String {
    let parts: Vec<String> = link.trouble.iter().map(|text| printable(text)).collect();
    parts.join("; ")
}

/// How far a job is, in bytes.
pub(super) fn progress(job: &JobView) -> String {
    let left = numbers::count(job.surely_left);
    match job.size {
        Some(size) => format!("{left} of {}", numbers::count(size)),
        None => left,
    }
}

/// A job in a sentence.
pub(super) fn job(job: &JobView) -> String {
    let what = job.program.as_ref().unwrap_or(&job.kind);
    let mut text =
        format!("job {}: {} on {}, {}", job.id, printable(what), job.link, job.state.name());
    if job.surely_left > 0 {
        let _ = write!(text, ", {} bytes have left", progress(job));
    }
    if job.state.is_final() && job.maybe_left > job.surely_left {
        let maybe = numbers::count(job.maybe_left);
        let _ = write!(text, ", up to {maybe} may have left");
    }
    if let Some(message) = &job.message {
        let _ = write!(text, ": {}", printable(message));
    }
    text
}

pub(super) fn swap(swap: &SwapView) -> String {
    let state = serde_json::to_value(swap.state).ok();
    let state = state.as_ref().and_then(serde_json::Value::as_str).unwrap_or_default();
    let mut text = format!("{}: {} {state}", swap.link, plugin(Some(&swap.to)));
    if let Some(pause) = swap.pause_us {
        let _ = write!(text, ", the link stood still for {pause} µs");
    }
    if let Some(message) = &swap.message {
        let _ = write!(text, ": {}", printable(message));
    }
    text
}

/// What passed on a line, on one line.
pub(super) fn seen(seen: &Seen) -> String {
    let what = match &seen.what {
        SeenWhat::Received { hex } => format!("<- {}", bytes(hex)),
        SeenWhat::Sent { hex } => format!("-> {}", bytes(hex)),
        SeenWhat::LineError { kind, hex } => {
            format!("!! {} {}", printable(kind), printable(hex.as_deref().unwrap_or_default()))
        }
        SeenWhat::Held { is_held: true } => "   held".to_owned(),
        SeenWhat::Held { is_held: false } => "   let go".to_owned(),
        SeenWhat::ModemLines { on } => format!("   modem lines {}", printable(&on.join(" "))),
        SeenWhat::State { name } => format!("   state {}", printable(name)),
        SeenWhat::Note { level, text } => format!("   {}: {}", printable(level), printable(text)),
        SeenWhat::Other { text } => format!("   {}", printable(text)),
    };
    format!("{:>12.6} {}", seen.at_us as f64 / 1e6, what.trim_end())
}

/// Text where it is text, escaped elsewhere.
fn bytes(hex: &str) -> String {
    let digits = hex.as_bytes().chunks_exact(2);
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    digits.filter_map(byte).collect::<Vec<u8>>().escape_ascii().to_string()
}
