//! Views as people read them.

use std::fmt::Write as _;

use softplug_live::plain_text;
use softplug_service::view::{
    DropView, JobBrief, JobState, JobView, LinkView, PluginRef, Seen, SeenWhat, SwapView,
};

use crate::numbers;

pub(crate) fn plugin(plugin: Option<&PluginRef>) -> String {
    plugin.map_or_else(|| "-".to_owned(), |of| plain_text(&format!("{} {}", of.name, of.version)))
}

/// What the link is doing, with the machine's hold.
pub(crate) fn state(link: &LinkView) -> String {
    let awaits = link.job.as_ref().is_some_and(|job| job.progress.awaits.is_some());
    let what = match (link.is_held, awaits) {
        (true, _) => ", held by the machine",
        (false, true) => ", waits for the machine",
        (false, false) => "",
    };
    format!("{}{what}", link.state.name())
}

/// The job that runs, or the last one, and those that wait.
pub(crate) fn doing(link: &LinkView) -> String {
    let mut parts = Vec::new();
    match (&link.job, &link.last) {
        (Some(job), _) => parts.push(brief(job)),
        // What nobody has seen stands among the trouble, with all of it.
        (None, Some(last)) if link.unseen.iter().any(|unseen| unseen.id == last.id) => {
            parts.push(format!("last {}", named(last)));
        }
        (None, Some(last)) => parts.push(format!("last {}", brief(last))),
        (None, None) => {}
    }
    if let Some(receiving) = &link.receiving {
        let name = receiving.name.as_deref().unwrap_or("unnamed");
        parts.push(format!("receives {} {}", plain_text(name), numbers::count(receiving.bytes)));
    }
    if link.queued > 0 {
        parts.push(format!("{} waiting", link.queued));
    }
    parts.join(", ")
}

/// What is wrong with the link; empty if nothing is.
pub(crate) fn trouble(link: &LinkView) -> String {
    let parts: Vec<String> = link.trouble.iter().map(|text| plain_text(text)).collect();
    parts.join("; ")
}

/// A drop folder and what is in it.
pub(crate) fn drop(drop: &DropView) -> String {
    let number = numbers::count;
    let mut text = plain_text(&drop.folder);
    let parts = [
        (drop.waiting, "waiting"),
        (drop.under_way, "under way"),
        (drop.left_lying, "not taken: see the journal"),
    ];
    for (count, what) in parts.into_iter().filter(|(count, _)| *count > 0) {
        let _ = write!(text, ", {} {what}", number(count));
    }
    text
}

/// A job by its number and program, with its state unless it runs.
fn named(job: &JobBrief) -> String {
    let what = plain_text(job.program.as_ref().unwrap_or(&job.kind));
    let mut text = format!("{}: {what}", job.id);
    if job.state != JobState::Running {
        let _ = write!(text, " {}", job.state.name());
    }
    text
}

/// A job in short, with how far it is in the gateway's words.
fn brief(job: &JobBrief) -> String {
    let mut text = named(job);
    if !job.progress.text.is_empty() {
        let _ = write!(text, ", {}", plain_text(&job.progress.text));
    }
    text
}

/// A job's program, with the name that it says of itself if that is another: `flange.nc (O1234)`.
pub(crate) fn what(job: &JobView) -> String {
    let program = plain_text(job.program.as_ref().unwrap_or(&job.kind));
    match &job.named {
        Some(named) => format!("{program} ({})", plain_text(named)),
        None => program,
    }
}

/// A job in a sentence.
pub(crate) fn job(job: &JobView) -> String {
    let mut text = format!("job {}: {} on {}, {}", job.id, what(job), job.link, job.state.name());
    if !job.progress.text.is_empty() {
        let _ = write!(text, ", {}", plain_text(&job.progress.text));
    }
    if let Some(message) = &job.message {
        let _ = write!(text, ": {}", plain_text(message));
    }
    text
}

pub(crate) fn swap(swap: &SwapView) -> String {
    let state = serde_json::to_value(swap.state).ok();
    let state = state.as_ref().and_then(serde_json::Value::as_str).unwrap_or_default();
    let mut text = format!("{}: {} {state}", swap.link, plugin(Some(&swap.to)));
    if let Some(pause) = swap.pause_us {
        let _ = write!(text, ", the link stood still for {pause} µs");
    }
    if let Some(message) = &swap.message {
        let _ = write!(text, ": {}", plain_text(message));
    }
    text
}

/// What passed on a line, on one line.
pub(crate) fn seen(seen: &Seen) -> String {
    let what = match &seen.what {
        SeenWhat::Received { hex } => format!("<- {}", bytes(hex)),
        SeenWhat::Sent { hex } => format!("-> {}", bytes(hex)),
        SeenWhat::LineError { kind, hex } => {
            format!("!! {} {}", plain_text(kind), plain_text(hex.as_deref().unwrap_or_default()))
        }
        SeenWhat::Held { is_held: true } => "   held".to_owned(),
        SeenWhat::Held { is_held: false } => "   let go".to_owned(),
        SeenWhat::ModemLines { on } => format!("   modem lines {}", plain_text(&on.join(" "))),
        SeenWhat::State { name } => format!("   state {}", plain_text(name)),
        SeenWhat::Note { level, text } => format!("   {}: {}", plain_text(level), plain_text(text)),
        SeenWhat::Other { text } => format!("   {}", plain_text(text)),
    };
    format!("{:>12.6} {}", seen.at_us as f64 / 1e6, what.trim_end())
}

/// Text where it is text, escaped elsewhere.
fn bytes(hex: &str) -> String {
    let digits = hex.as_bytes().chunks_exact(2);
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    digits.filter_map(byte).collect::<Vec<u8>>().escape_ascii().to_string()
}
