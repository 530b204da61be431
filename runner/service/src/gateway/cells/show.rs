//! Cells, shown.

use softplug_cell::{ChannelId, ChannelSet, Doing, Mode, Span};

use super::{CellState, Control};
use crate::view::{
    CellAxisView, CellChannelState, CellChannelView, CellGroupView, CellMode, CellSpanView,
    CellStuckView, CellView, now_ms,
};

impl Control {
    pub(super) fn cell_views(&self) -> Vec<CellView> {
        self.cells.by_name.keys().filter_map(|name| self.cell_view(name)).collect()
    }

    pub(super) fn cell_view(&self, name: &str) -> Option<CellView> {
        let state = self.cells.by_name.get(name)?;
        let (cell, setup) = (&state.cell, &state.config.setup);
        let named = |set: ChannelSet| {
            set.iter().map(|one| setup.channel_name(one).to_owned()).collect::<Vec<String>>()
        };
        let axis = |axis| {
            let (owner, queue) = cell.axis(axis);
            CellAxisView {
                name: setup.axis_name(axis).to_owned(),
                owner: owner.map(|owner| setup.channel_name(owner).to_owned()),
                queue: queue.iter().map(|one| setup.channel_name(*one).to_owned()).collect(),
            }
        };
        let stuck = cell.stuck().into_iter().map(|stuck| CellStuckView {
            link: setup.channel_name(stuck.channel).to_owned(),
            is_deadlock: cell.deadlocked().has(stuck.channel),
            since_ms: stuck.since,
            text: stuck.text,
        });
        Some(CellView {
            name: name.to_owned(),
            is_stopped: cell.is_stopped(),
            channels: setup
                .channels()
                .map(|one| channel(state, one, named(cell.waits_for(one))))
                .collect(),
            axes: setup.axes().map(axis).collect(),
            groups: setup
                .groups()
                .map(|(id, name, set)| CellGroupView {
                    name: name.to_owned(),
                    channels: named(set),
                    mode: cell.mode(id).into(),
                })
                .collect(),
            stuck: stuck.collect(),
            now_ms: now_ms(),
        })
    }
}

fn channel(state: &CellState, channel: ChannelId, waits_for: Vec<String>) -> CellChannelView {
    let view = state.cell.channel(channel);
    let spans: Vec<CellSpanView> = state.chart.spans(channel).map(span).collect();
    let now = spans.last().cloned();
    let job = state.jobs[usize::from(channel.0)].as_ref();
    CellChannelView {
        link: state.config.setup.channel_name(channel).to_owned(),
        state: now.as_ref().map_or(CellChannelState::Idle, |now| now.state),
        text: now.as_ref().map(|now| now.text.clone()).unwrap_or_default(),
        since_ms: now.map_or(0, |now| now.from_ms),
        program: view.program.map(ToOwned::to_owned),
        job: job.map(|job| job.id.0),
        loaded: view.loaded.map(ToOwned::to_owned),
        waits_for,
        words_passed: job.map_or(0, |job| job.passed as u32),
        words: job.map_or(0, |job| job.stops.len() as u32),
        spans,
    }
}

fn span(span: &Span) -> CellSpanView {
    let (state, text) = match &span.doing {
        Doing::Runs(program) => (CellChannelState::Runs, program.as_str()),
        Doing::Waits(text) => (CellChannelState::Waits, text.as_str()),
        Doing::Stands(text) => (CellChannelState::Stands, text.as_str()),
        Doing::Idle => (CellChannelState::Idle, "runs no program"),
    };
    CellSpanView { from_ms: span.from, to_ms: span.to, state, text: text.to_owned() }
}

impl From<Mode> for CellMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Auto => Self::Auto,
            Mode::JogInAuto => Self::JogInAuto,
            Mode::Mda => Self::Mda,
            Mode::Jog => Self::Jog,
        }
    }
}
