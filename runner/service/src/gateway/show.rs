//! From what is known to what is shown.

use softplug_abi::LineErrorKind;
use softplug_abi::manifest::{Kind, Manifest};
use softplug_live::endpoint::EndpointKind;
use softplug_live::reactor::{AlarmKind, LaneFigures};
use softplug_live::reservoir::Gauge;

use super::link::Link;
use super::results::Results;
use crate::programs::Program;
use crate::supervise;
use crate::view::{
    AlarmView, BufferView, CountersView, EndpointView, FieldView, JobBrief, KindView, LinkView,
    PluginView, PortView, ProbationView, ProgramView, QuarantineView, ReceivingView, SettingView,
    SwapState,
};
use std::fmt::Write as _;

/// A link, with so many jobs that wait.
pub(super) fn link(name: &str, link: &Link, queued: u32, results: &Results) -> LinkView {
    let figures = link.status.read();
    let config = &link.config;
    let probation = link.swap.as_ref().filter(|swap| swap.view.state == SwapState::Probation);
    let (unseen, unseen_count) = results.unseen(name);
    let mut view = LinkView {
        name: name.to_owned(),
        group: config.group.clone(),
        state: link.state(&figures),
        condition: link.condition.clone(),
        port: PortView {
            spec: config.port.to_string(),
            line: config.line_text(),
            flow: config.flow.name().to_owned(),
            differences: link.port.differences.clone(),
            other_side: link.port.path.as_ref().map(|path| path.display().to_string()),
        },
        endpoint: config.endpoint.map(|endpoint| EndpointView {
            listen: endpoint.listen.to_string(),
            kind: match endpoint.kind {
                EndpointKind::Raw => "raw",
                EndpointKind::Rfc2217 => "rfc2217",
            }
            .to_owned(),
            client: link.port.client.clone(),
            failure: link.port.endpoint_failure.clone(),
        }),
        plugin: Some(link.plugin.which.clone()),
        settings: link.plugin.settings.clone(),
        job: link.job.as_ref().map(|running| {
            running.job.brief(link.lane_progress(running.job.id, &figures).as_ref())
        }),
        last: results.last(name),
        unseen,
        unseen_count,
        queued,
        receiving: link.deliveries.values().next_back().map(|delivery| ReceivingView {
            name: delivery.name.clone(),
            bytes: delivery.gauge.written(),
            since_ms: delivery.since_ms,
        }),
        is_held: link.is_held(&figures),
        counters: counters(link, &figures),
        buffer: buffer(link),
        down: link.port.down.clone(),
        alarms: link.alarms.iter().map(|(kind, since)| alarm(*kind, *since)).collect(),
        probation: probation.and_then(|swap| {
            let former = swap.former.as_ref()?;
            Some(ProbationView { returns_to: former.which.clone(), since_ms: swap.view.at_ms })
        }),
        swap: link.swap.as_ref().map(|swap| swap.view.clone()),
        quarantine: match link.supervisor.state() {
            supervise::State::Quarantined { .. } => Some(QuarantineView {
                since_ms: link.faults.back().map_or(0, |fault| fault.at_ms),
                faults: link.faults.iter().cloned().collect(),
                ran_well: link
                    .ran_well
                    .clone()
                    .filter(|former| former.digest != link.plugin.which.digest),
            }),
            _ => None,
        },
        is_change_waiting: link.has_change_waiting(),
        unapplied: link.unapplied.clone(),
        drop: None,
        trouble: Vec::new(),
    };
    view.trouble = trouble(&view);
    view
}

/// What is wrong with a link: the same sentences wherever it is shown.
fn trouble(view: &LinkView) -> Vec<String> {
    let mut trouble = Vec::new();
    if let Some(quarantine) = &view.quarantine {
        let why =
            quarantine.faults.last().map_or("the plug-in failed too often", |last| &last.text);
        trouble.push(format!("quarantine: {why}"));
    }
    trouble.extend(view.down.iter().map(|down| down.reason.clone()));
    trouble.extend(view.unapplied.iter().map(|unapplied| unapplied.text.clone()));
    trouble.extend(view.alarms.iter().map(|alarm| alarm.text.clone()));
    trouble.extend(view.unseen.first().map(|job| result(job, view.unseen_count)));
    trouble
}

pub(super) fn counters(link: &Link, figures: &LaneFigures) -> CountersView {
    let before = link.before.0.as_ref();
    let sum = |of: fn(&LaneFigures) -> u64| of(figures) + before.map_or(0, of);
    let longest = |of: fn(&LaneFigures) -> u64| of(figures).max(before.map_or(0, of));
    let line_errors = LineErrorKind::ALL.iter().enumerate().map(|(at, kind)| {
        let count = figures.line_errors[at] + before.map_or(0, |before| before.line_errors[at]);
        (kind.name().to_owned(), count)
    });
    CountersView {
        bytes_in: sum(|figures| figures.bytes_in),
        bytes_out: sum(|figures| figures.bytes_out),
        line_errors: line_errors.collect(),
        holds: sum(|figures| figures.holds),
        held_us: sum(|figures| figures.held_micros),
        gaps: sum(|figures| figures.gaps),
        longest_gap_us: longest(|figures| figures.longest_gap_micros),
        after_stop: sum(|figures| figures.after_hold),
        starved: sum(|figures| figures.starvations),
        starved_us: sum(|figures| figures.starved_micros),
        events: sum(|figures| figures.events),
        fuel: sum(|figures| figures.fuel),
        restarts: sum(|figures| figures.restarts),
        reopened: sum(|figures| figures.opened.saturating_sub(1)),
        notes_dropped: sum(|figures| figures.left_out),
        endpoint_jobs: sum(|figures| figures.endpoint_jobs),
        endpoint_failed: sum(|figures| figures.endpoint_failed),
        endpoint_bytes: sum(|figures| figures.endpoint_bytes),
    }
}

pub(super) fn buffer(link: &Link) -> BufferView {
    let config = &link.config.buffer;
    let gauge = link.gauge.as_ref();
    let under_way = gauge.filter(|_| link.job.is_some());
    BufferView {
        size: config.size.into(),
        low: config.low.into(),
        high: config.high.into(),
        level: under_way.map_or(0, |gauge| gauge.level() as u64),
        largest: gauge.map_or(0, |gauge| gauge.highest() as u64),
        smallest: gauge.and_then(Gauge::lowest).map(|level| level as u64),
    }
}

fn alarm(kind: AlarmKind, since_ms: u64) -> AlarmView {
    AlarmView { kind: kind.name().to_owned(), text: alarm_text(kind).to_owned(), since_ms }
}

/// What a watchdog has found.
pub(super) const fn alarm_text(kind: AlarmKind) -> &'static str {
    match kind {
        AlarmKind::NoBytes => "nothing comes from the machine",
        AlarmKind::NoProgress => "the job does not get on",
        AlarmKind::StuckHeld => "the machine holds the line",
    }
}

/// How the newest job ended of those that nobody has acknowledged.
fn result(job: &JobBrief, count: u32) -> String {
    let what = job.program.as_ref().unwrap_or(&job.kind);
    let mut text = format!("job {}, {what}, {}", job.id, job.state.name());
    for part in job.message.iter().chain(Some(&job.progress.text).filter(|text| !text.is_empty())) {
        let _ = write!(text, ": {part}");
    }
    if count > 1 {
        let _ = write!(text, "; and {} before it that nobody has acknowledged", count - 1);
    }
    text
}

pub(super) fn program(program: Program) -> ProgramView {
    ProgramView { name: program.name, bytes: program.size, changed_ms: program.modified }
}

pub(super) fn kinds(kinds: &[Kind]) -> Vec<KindView> {
    let field = |field: &softplug_abi::manifest::Field| FieldView {
        name: field.name.clone(),
        kind: field.kind.name().to_owned(),
        required: field.required,
        text: field.text.clone(),
    };
    let kind = |kind: &Kind| KindView {
        name: kind.name.clone(),
        text: kind.text.clone(),
        fields: kind.fields.iter().map(field).collect(),
    };
    kinds.iter().map(kind).collect()
}

/// A plug-in of the library with its manifest.
pub(super) fn plugin(
    entry: &crate::library::Entry,
    manifest: &Manifest,
    links: Vec<String>,
) -> PluginView {
    let setting = |setting: &softplug_abi::manifest::Setting| SettingView {
        name: setting.name.clone(),
        kind: setting.kind.name().to_owned(),
        default: match &setting.default {
            serde_json::Value::String(text) => text.clone(),
            serde_json::Value::Bool(true) => "on".to_owned(),
            serde_json::Value::Bool(false) => "off".to_owned(),
            other => other.to_string(),
        },
        min: setting.min,
        max: setting.max,
        unit: setting.unit.clone(),
        choices: setting.choices.clone(),
        text: setting.text.clone(),
    };
    PluginView {
        plugin: super::loading::reference_of(entry),
        protocol: entry.protocol.clone(),
        description: entry.description.clone(),
        licence: manifest.licence.clone(),
        bytes: entry.size,
        settings: manifest.settings.iter().map(setting).collect(),
        presets: manifest.presets.iter().map(|preset| preset.name.clone()).collect(),
        jobs: kinds(&manifest.jobs),
        links,
    }
}
