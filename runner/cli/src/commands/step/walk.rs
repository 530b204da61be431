//! Where one is in a run, and which key leads where.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use softplug_conformance::{Moment, Stepper};

use super::source::Source;

/// Moments that a page key passes.
const PAGE: usize = 10;

/// A walk through a run.
pub(super) struct Walk {
    pub(super) stepper: Stepper,
    pub(super) title: String,
    pub(super) source: Source,
    pub(super) at: usize,
}

/// Whether the walk goes on.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Turn {
    On,
    End,
}

impl Walk {
    /// Begins where the run did something else than it must, or at its start.
    pub(super) fn new(stepper: Stepper, title: String, source: Source) -> Self {
        let at = stepper.differs_at.unwrap_or(0);
        Self { stepper, title, source, at }
    }

    pub(super) fn moment(&self) -> &Moment {
        &self.stepper.moments[self.at]
    }

    pub(super) fn take(&mut self, key: KeyEvent) -> Turn {
        let last = self.stepper.moments.len() - 1;
        self.at = match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => {
                return Turn::End;
            }
            KeyCode::Char('q') | KeyCode::Esc => return Turn::End,
            KeyCode::Right | KeyCode::Down | KeyCode::Enter | KeyCode::Char(' ' | 'n' | 'j') => {
                (self.at + 1).min(last)
            }
            KeyCode::Left | KeyCode::Up | KeyCode::Backspace | KeyCode::Char('p' | 'k') => {
                self.at.saturating_sub(1)
            }
            KeyCode::PageDown => (self.at + PAGE).min(last),
            KeyCode::PageUp => self.at.saturating_sub(PAGE),
            KeyCode::Home | KeyCode::Char('g') => 0,
            KeyCode::End | KeyCode::Char('G') => last,
            KeyCode::Char('d') => self.stepper.differs_at.unwrap_or(self.at),
            KeyCode::Char('t') => self.later().unwrap_or(last),
            KeyCode::Char('s') => self.other_state().unwrap_or(last),
            _ => self.at,
        };
        Turn::On
    }

    /// The first moment of the next time.
    fn later(&self) -> Option<usize> {
        let now = self.moment().at_us;
        self.place(|moment| moment.at_us > now)
    }

    /// The next moment in another state.
    fn other_state(&self) -> Option<usize> {
        let now = &self.moment().after.state;
        self.place(|moment| moment.after.state != *now)
    }

    fn place(&self, is_it: impl Fn(&Moment) -> bool) -> Option<usize> {
        let ahead = self.stepper.moments[self.at..].iter().position(is_it);
        ahead.map(|ahead| self.at + ahead)
    }
}
