//! The progress bar: how far, how fast, how long yet, how long held; and, with a bar or without,
//! what the machine is waited for.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use softplug_live::transfer::Progress;

use crate::numbers;
use crate::screen::Screen;

/// How the state of a plug-in begins that waits for the machine: for DC1, XON, DLE, the control.
const WAITING: &str = "waiting for ";
/// A machine may take so long without a word from us; most waits of a protocol are shorter.
const PATIENCE: Duration = Duration::from_secs(3);

/// A bar on standard error, or nothing where nobody would see it.
pub(crate) struct Bar<'a> {
    shown: ProgressBar,
    screen: &'a Screen,
    wait: RefCell<Wait>,
}

/// What is waited for, and since when.
#[derive(Default)]
struct Wait {
    state: String,
    since: Option<Instant>,
    /// The states that were told: each is told once.
    told: Vec<String>,
}

impl Wait {
    /// Whether this state has lasted so long that it is to be told.
    fn is_to_be_told(&mut self, state: &str, now: Instant) -> bool {
        if self.state != state {
            state.clone_into(&mut self.state);
            self.since = state.starts_with(WAITING).then_some(now);
        }
        let is_long = self.since.is_some_and(|since| now - since >= PATIENCE);
        let is_news = is_long && !self.told.iter().any(|told| told == state);
        if is_news {
            self.told.push(state.to_owned());
        }
        is_news
    }
}

impl<'a> Bar<'a> {
    /// A bar for a known size, or a line that tells how much came.
    pub(crate) fn new(total: Option<u64>, screen: &'a Screen) -> Self {
        Self { shown: Self::bar(total, screen), screen, wait: RefCell::default() }
    }

    fn bar(total: Option<u64>, screen: &Screen) -> ProgressBar {
        if !screen.shows_progress() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
        let template = match total {
            Some(_) => "[{bar:24}] {percent:>3} %  {msg}",
            None => "{msg}",
        };
        let style = ProgressStyle::with_template(template).expect("the template is sound");
        bar.with_style(style.progress_chars("=> "))
    }

    pub(crate) fn show(&self, progress: &Progress<'_>) {
        if self.wait.borrow_mut().is_to_be_told(progress.state, Instant::now()) {
            let state = progress.state.escape_debug();
            self.aside(|| {
                self.screen.note(format_args!(
                    "{state}: nothing leaves before that; see that the machine is connected and \
                     takes in (READ, DNC operation or the like)"
                ));
            });
        }
        if self.shown.is_hidden() {
            return;
        }
        self.shown.set_position(progress.bytes);
        self.shown.set_message(text(progress));
    }

    /// Prints something while the bar is out of the way.
    pub(crate) fn aside(&self, print: impl FnOnce()) {
        self.shown.suspend(print);
    }

    /// Takes the bar away: the result says it all.
    pub(crate) fn end(&self) {
        self.shown.finish_and_clear();
    }
}

/// `12,288 bytes, 912 bytes/s, 5 min 2 s left, held 3.1 s`. While the machine is waited for there
/// is no rate, and nothing to say how long it takes.
fn text(progress: &Progress<'_>) -> String {
    let mut text = numbers::bytes(progress.bytes);
    let seconds = progress.elapsed.as_secs_f64();
    if progress.state.starts_with(WAITING) {
        let _ = write!(text, ", {}", progress.state.escape_debug());
    } else if progress.bytes > 0 && seconds > 0.0 {
        let rate = progress.bytes as f64 / seconds;
        let _ = write!(text, ", {} bytes/s", numbers::count(rate as u64));
        if let Some(total) = progress.total {
            let left = total.saturating_sub(progress.bytes) as f64 / rate;
            let left = Duration::try_from_secs_f64(left).unwrap_or(Duration::MAX);
            let _ = write!(text, ", {} left", numbers::span(left));
        }
    }
    if progress.held > Duration::ZERO {
        let _ = write!(text, ", held {}", numbers::span(progress.held));
    }
    if progress.is_held {
        text += " (held now)";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_says_rate_time_left_and_time_held() {
        let mut progress = Progress {
            bytes: 12_288,
            total: Some(24_576),
            elapsed: Duration::from_secs(12),
            held: Duration::ZERO,
            is_held: false,
            state: "",
        };
        assert_eq!(text(&progress), "12,288 bytes, 1,024 bytes/s, 12.0 s left");
        progress.held = Duration::from_millis(3_140);
        progress.is_held = true;
        progress.total = None;
        assert_eq!(text(&progress), "12,288 bytes, 1,024 bytes/s, held 3.1 s (held now)");
        progress.bytes = 0;
        progress.held = Duration::ZERO;
        progress.is_held = false;
        assert_eq!(text(&progress), "0 bytes");
        progress.bytes = 54;
        progress.is_held = false;
        progress.total = Some(5_000);
        progress.state = "waiting for DC1";
        assert_eq!(text(&progress), "54 bytes, waiting for DC1");
    }

    #[test]
    fn a_long_wait_is_told_once() {
        let begin = Instant::now();
        let mut wait = Wait::default();
        let mut at =
            |seconds, state| wait.is_to_be_told(state, begin + Duration::from_secs(seconds));
        assert!(!at(0, "waiting for DC1") && !at(2, "waiting for DC1"));
        assert!(at(3, "waiting for DC1") && !at(4, "waiting for DC1"));
        assert!(!at(5, "sending") && !at(60, "sending"));
        assert!(!at(61, "waiting for DC3") && at(64, "waiting for DC3"));
        assert!(!at(65, "waiting for DC1") && !at(99, "waiting for DC1"));
    }
}
