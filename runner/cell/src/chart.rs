//! Who ran and who waited, over time.

use std::collections::VecDeque;

use crate::cell::Cell;
use crate::setup::ChannelId;

/// What a channel does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Doing {
    /// It runs this program.
    Runs(String),
    /// It stands: for whom or what, in words.
    Waits(String),
    /// Its program stands for another reason: an axis was taken from it, somebody has it pause, its
    /// port is gone.
    Stands(String),
    /// It runs no program.
    Idle,
}

/// A channel did one thing for a while.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Span {
    /// From, in milliseconds.
    pub from: u64,
    /// To; none: it still does.
    pub to: Option<u64>,
    /// What.
    pub doing: Doing,
}

/// The latest spans of each channel of a cell.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Chart {
    channels: Vec<VecDeque<Span>>,
    most: usize,
}

impl Chart {
    /// Keeps so many spans of each channel.
    pub fn new(most: usize) -> Self {
        Self { channels: Vec::new(), most: most.max(1) }
    }

    /// Looks at a cell, as it is from this time on.
    pub fn look(&mut self, now: u64, cell: &Cell) {
        self.channels.resize(cell.setup().channels().count(), VecDeque::new());
        for (spans, channel) in self.channels.iter_mut().zip(cell.setup().channels()) {
            let doing = doing(cell, channel);
            if let Some(last) = spans.back_mut() {
                if last.doing == doing {
                    continue;
                }
                last.to = Some(now);
                if last.from >= now {
                    spans.pop_back();
                }
            }
            spans.push_back(Span { from: now, to: None, doing });
            if spans.len() > self.most {
                spans.pop_front();
            }
        }
    }

    /// The spans of a channel, the oldest first.
    pub fn spans(&self, channel: ChannelId) -> impl Iterator<Item = &Span> {
        self.channels.get(usize::from(channel.0)).into_iter().flatten()
    }
}

fn doing(cell: &Cell, channel: ChannelId) -> Doing {
    let view = cell.channel(channel);
    let setup = cell.setup();
    let Some(program) = view.program else { return Doing::Idle };
    if let Some((word, _)) = view.waits {
        return Doing::Waits(word.told(channel, setup));
    }
    if let Some(axis) = view.deprived.first() {
        return Doing::Stands(format!("{} was taken from it", setup.axis_name(*axis)));
    }
    if cell.may_be_fed(channel) {
        return Doing::Runs(program.to_owned());
    }
    Doing::Stands(match (cell.is_stopped(), view.is_lost, view.is_paused) {
        (true, ..) => "the cell is stopped".to_owned(),
        (_, true, _) => "its port is gone, or its plug-in stopped".to_owned(),
        (.., true) => "paused".to_owned(),
        _ => format!("the group is in {}", cell.mode(setup.group_of(channel)).name()),
    })
}
