//! The progress bar: how far, how fast, how long yet, how long held.

use std::fmt::Write as _;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use softplug_gateway::transfer::Progress;

use crate::numbers;
use crate::screen::Screen;

/// A bar on standard error, or nothing where nobody would see it.
pub(super) struct Bar {
    bar: ProgressBar,
}

impl Bar {
    /// A bar for a known size, or a line that tells how much came.
    pub(super) fn new(total: Option<u64>, screen: &Screen) -> Self {
        if !screen.shows_progress() {
            return Self { bar: ProgressBar::hidden() };
        }
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
        let template = match total {
            Some(_) => "[{bar:24}] {percent:>3} %  {msg}",
            None => "{msg}",
        };
        let style = ProgressStyle::with_template(template).expect("the template is sound");
        Self { bar: bar.with_style(style.progress_chars("=> ")) }
    }

    pub(super) fn show(&self, progress: &Progress<'_>) {
        if self.bar.is_hidden() {
            return;
        }
        self.bar.set_position(progress.bytes);
        self.bar.set_message(text(progress));
    }

    /// Prints something while the bar is out of the way.
    pub(super) fn aside(&self, print: impl FnOnce()) {
        self.bar.suspend(print);
    }

    /// Takes the bar away: the result says it all.
    pub(super) fn end(&self) {
        self.bar.finish_and_clear();
    }
}

/// `12,288 bytes, 912 bytes/s, 5 min 2 s left, held 3.1 s`.
fn text(progress: &Progress<'_>) -> String {
    let mut text = numbers::bytes(progress.bytes);
    let seconds = progress.elapsed.as_secs_f64();
    if progress.bytes > 0 && seconds > 0.0 {
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
    }
}
