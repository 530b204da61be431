//! A cut: what pulses in each period, at a feed.

use crate::arc::Arc;
use crate::codes;
use crate::line::Line;
use softplug_plugin::{StateReader, StateWriter};

/// A feed of one step a period: the modulus of the feed's sum. A smaller feed is a part of it.
pub const FASTEST: u32 = 1 << 20;

/// The feed of F as an octal word: F + 1 of 4,096.
///
/// ```
/// assert_eq!(pulse_lathe::feed_of_word(0o7777), pulse_lathe::FASTEST);
/// ```
pub fn feed_of_word(word: u16) -> u32 {
    (u32::from(word & 0o7777) + 1) << 8
}

/// What moves.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Path {
    Line(Line),
    /// An arc, and the pulses of x and z that are to be done when it is over. Those of the
    /// arc are taken from them.
    Arc(Arc, (i32, i32)),
    /// An arc of so many steps.
    Steps(Arc),
}

/// The pulses of one block, period by period.
///
/// ```
/// use pulse_lathe::{Cut, FASTEST, Line};
///
/// // Two pulses of x at half of the fastest feed.
/// let mut cut = Cut::line(Line::between(2, 0), FASTEST / 2);
/// let bytes: Vec<u8> = std::iter::from_fn(|| cut.period()).collect();
/// assert_eq!(bytes, [0x40, 0x41, 0x40, 0x01]);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Cut {
    path: Path,
    feed: u32,
    sum: u32,
    /// The second pulse of a step of x.
    second: u8,
}

impl Cut {
    pub(crate) fn new(path: Path, feed: u32) -> Self {
        Self { path, feed: feed.clamp(1, FASTEST), sum: 0, second: 0 }
    }

    pub(crate) fn path(&self) -> Path {
        self.path
    }

    /// A line at a feed, in parts of [`FASTEST`].
    pub fn line(line: Line, feed: u32) -> Self {
        Self::new(Path::Line(line), feed)
    }

    /// An arc of so many steps at a feed, in parts of [`FASTEST`].
    pub fn arc(arc: Arc, feed: u32) -> Self {
        Self::new(Path::Steps(arc), feed)
    }

    /// The byte of the next period; `None`: the cut is over.
    pub fn period(&mut self) -> Option<u8> {
        if self.is_over() {
            return None;
        }
        let pulses = self.pulses();
        Some(if self.is_over() { pulses } else { pulses | codes::FOLLOWS })
    }

    fn pulses(&mut self) -> u8 {
        if self.second != 0 {
            return core::mem::take(&mut self.second);
        }
        self.sum += self.feed;
        if self.sum < FASTEST {
            return 0;
        }
        self.sum -= FASTEST;
        self.step()
    }

    /// One step, whatever the feed. Of one of x on an arc the first pulse.
    fn step(&mut self) -> u8 {
        match &mut self.path {
            Path::Line(line) => line.step().unwrap_or_default(),
            Path::Steps(arc) => {
                let pulse = arc.step().unwrap_or_default();
                self.second = pulse & (codes::X | codes::X_MINUS);
                pulse
            }
            Path::Arc(arc, rest) => {
                let Some(pulse) = arc.step() else { return last(rest) };
                let (x, z) = codes::pulses(pulse);
                rest.0 -= 2 * x as i32;
                rest.1 -= z as i32;
                self.second = pulse & (codes::X | codes::X_MINUS);
                pulse
            }
        }
    }

    /// Whether all pulses are done.
    pub fn is_over(&self) -> bool {
        let is_over = match &self.path {
            Path::Line(line) => line.is_over(),
            Path::Steps(arc) => arc.is_over(),
            Path::Arc(arc, rest) => arc.is_over() && *rest == (0, 0),
        };
        is_over && self.second == 0
    }

    /// Where a cut ends from where it stands, in pulses of x and z, after at most `most` steps
    /// of an arc; `None`: they were not enough, and it stands behind them. `moved` is what these were.
    pub(crate) fn skip(&mut self, most: &mut u32, moved: &mut (i64, i64)) -> Option<()> {
        match &mut self.path {
            Path::Line(line) => add(moved, line.rest()),
            Path::Arc(_, (x, z)) => add(moved, (i64::from(*x), i64::from(*z))),
            Path::Steps(arc) => {
                while !arc.is_over() {
                    *most = most.checked_sub(1)?;
                    let (x, z) = codes::pulses(arc.step().unwrap_or_default());
                    add(moved, (2 * x, z));
                }
            }
        }
        Some(())
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        match &self.path {
            Path::Line(line) => {
                state.u8(0);
                line.save(state);
            }
            Path::Arc(arc, (x, z)) => {
                state.u8(1);
                arc.save(state);
                state.u32(x.cast_unsigned());
                state.u32(z.cast_unsigned());
            }
            Path::Steps(arc) => {
                state.u8(2);
                arc.save(state);
            }
        }
        state.u32(self.feed);
        state.u32(self.sum);
        state.u8(self.second);
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        let path = match state.u8() {
            0 => Path::Line(Line::restore(state)),
            1 => {
                let arc = Arc::restore(state);
                Path::Arc(arc, (state.u32().cast_signed(), state.u32().cast_signed()))
            }
            2 => Path::Steps(Arc::restore(state)),
            _ => {
                state.refuse();
                Path::Line(Line::restore(state))
            }
        };
        Self { path, feed: state.u32(), sum: state.u32(), second: state.u8() }
    }
}

fn add(sum: &mut (i64, i64), (x, z): (i64, i64)) {
    sum.0 += x;
    sum.1 += z;
}

/// A pulse of what an arc has left over: z first, x last.
fn last(rest: &mut (i32, i32)) -> u8 {
    if rest.1 != 0 {
        let is_minus = rest.1 < 0;
        rest.1 -= rest.1.signum();
        return codes::z(is_minus);
    }
    let is_minus = rest.0 < 0;
    rest.0 -= rest.0.signum();
    codes::x(is_minus)
}
