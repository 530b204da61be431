//! Programs in ISO code, translated line by line as they come.

mod arc;
mod number;
#[cfg(test)]
mod tests;
mod words;

use crate::block::{Bad, Block, Motion, Next};
use crate::cut::{FASTEST, Path};
use crate::line::Line;
use crate::settings::{PERIODS_A_MILLI, Settings};
use crate::status;
use crate::thread::Thread;
use core::cell::Cell;
use number::{nearest, root, rounded};
use softplug_plugin::{StateReader, StateWriter, copy};
use words::{ONE, Refused, Words};

/// Text that waits, in bytes.
pub(crate) const TEXT: usize = 1_024;
/// Characters of a line at most, its end aside.
const LINE: usize = 200;
/// Parts of a step a period in one step a minute, as a fraction: 2²⁰ / 240,000.
const PARTS: (u64, u64) = (8_192, 1_875);
/// A pulse of z, in 0.1 µm; one of x is half of that, and as much in diameter.
const PULSE: i64 = 100;

/// A place, exactly: x as a diameter, both in 0.1 µm.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
struct Place {
    x: i64,
    z: i64,
}

impl Place {
    /// In pulses of x and z.
    fn pulses(self) -> (i32, i32) {
        (nearest(self.x, PULSE) as i32, nearest(self.z, PULSE) as i32)
    }
}

/// The words of a motion that stay in force.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Mode {
    Fast,
    Feed,
    Arc { clockwise: bool },
    Thread,
}

/// A program, and where it is.
#[derive(Clone, Debug)]
pub(crate) struct Iso {
    text: [u8; TEXT],
    length: usize,
    has_ended: bool,
    line: u32,
    blocks: u32,
    is_over: bool,
    mode: Mode,
    is_incremental: bool,
    place: Place,
    speed: Option<u8>,
    tool: Option<u8>,
    /// In 0.1 µm a minute, and a turn. 0: none was given.
    feed: u32,
    pitch: u32,
}

impl Iso {
    pub(crate) fn new() -> Self {
        Self {
            text: [0; TEXT],
            length: 0,
            has_ended: false,
            line: 0,
            blocks: 0,
            is_over: false,
            mode: Mode::Fast,
            is_incremental: false,
            place: Place::default(),
            speed: None,
            tool: None,
            feed: 0,
            pitch: 0,
        }
    }

    /// Begins anew at a place in pulses of x and z.
    pub(crate) fn clear(&mut self, x: i64, z: i64) {
        (self.length, self.line, self.blocks) = (0, 0, 0);
        (self.has_ended, self.is_over, self.is_incremental) = (false, false, false);
        (self.mode, self.speed, self.tool) = (Mode::Fast, None, None);
        (self.feed, self.pitch) = (0, 0);
        self.place = Place { x: x * PULSE, z: z * PULSE };
    }

    /// Bytes of text that it takes.
    pub(crate) fn room(&self) -> usize {
        TEXT - self.length
    }

    pub(crate) fn take_text(&mut self, bytes: &[u8]) {
        copy(self.text.get_mut(self.length..).unwrap_or_default(), bytes);
        self.length = (self.length + bytes.len()).min(TEXT);
    }

    pub(crate) fn text_ended(&mut self) {
        self.has_ended = true;
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Blocks so far.
    pub(crate) fn blocks(&self) -> u32 {
        self.blocks
    }

    /// The next line.
    pub(crate) fn next(&mut self, settings: &Settings) -> Result<Next, Bad> {
        if self.is_over {
            self.length = 0;
            return Ok(if self.has_ended { Next::End } else { Next::Text });
        }
        let text = self.text.get(..self.length).unwrap_or_default();
        let end = text.iter().position(|byte| *byte == b'\n');
        let is_last = end.is_none();
        if is_last && !self.has_ended && self.length <= LINE {
            return Ok(Next::Text);
        }
        let end = end.unwrap_or(self.length);
        if is_last && self.has_ended && end == 0 {
            self.is_over = true;
            return Ok(Next::Nothing);
        }
        self.line += 1;
        let read = self.translate(end, settings);
        let taken = (end + 1).min(self.length);
        self.drop_first(taken);
        let line = self.line;
        read.map_err(|(status, column)| Bad { status, line, column })
    }

    /// Moves the text to the front; the first bytes fall away.
    fn drop_first(&mut self, count: usize) {
        let cells = Cell::from_mut(self.text.as_mut_slice()).as_slice_of_cells();
        for (to, from) in cells.iter().zip(cells.get(count..self.length).unwrap_or_default()) {
            to.set(from.get());
        }
        self.length -= count;
    }

    fn translate(&mut self, end: usize, settings: &Settings) -> Result<Next, Refused> {
        let line = self.text.get(..end).unwrap_or_default();
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if line.len() > LINE {
            return Err((status::LONG_LINE, LINE as u32 + 1));
        }
        let words = Words::read(line)?;
        if !words.is_block {
            return Ok(Next::Nothing);
        }
        self.blocks += 1;
        self.block(words, settings).map(Next::Block)
    }

    fn block(&mut self, mut words: Words, settings: &Settings) -> Result<Block, Refused> {
        let once = self.codes(&words)?;
        self.modal(&mut words)?;
        let mut block = Block {
            speed: self.speed,
            tool: self.tool,
            travel: FASTEST,
            with_offset: true,
            ..Block::default()
        };
        match words.take(b'M') {
            None => {}
            Some((function, _)) if function == 2 * ONE || function == 30 * ONE => {
                self.is_over = true;
            }
            Some((function, _)) if function % ONE == 0 && (0..=15 * ONE).contains(&function) => {
                block.function = (function / ONE) as u8;
            }
            Some((_, column)) => return Err((status::OUT_OF_RANGE, column)),
        }
        match once {
            Some(Once::Dwell) => block.dwell = dwell(&mut words)?,
            Some(Once::Zero) => {
                block.motion = self.zero(&mut words)?;
                block.with_offset = false;
            }
            None => self.motion(&mut words, settings, &mut block)?,
        }
        words.none_left()?;
        Ok(block)
    }

    /// What the G codes put in force; what one does once is returned.
    fn codes(&mut self, words: &Words) -> Result<Option<Once>, Refused> {
        let (mut once, mut has_mode, mut has_reference) = (None, false, false);
        for (code, column) in words.codes() {
            let mode = match code / ONE {
                _ if code % ONE != 0 => return Err((status::UNKNOWN, column)),
                0 => Mode::Fast,
                1 => Mode::Feed,
                2 => Mode::Arc { clockwise: true },
                3 => Mode::Arc { clockwise: false },
                33 => Mode::Thread,
                90 | 91 => {
                    if has_reference {
                        return Err((status::CONFLICT, column));
                    }
                    has_reference = true;
                    self.is_incremental = code == 91 * ONE;
                    continue;
                }
                4 | 28 => {
                    if once.is_some() {
                        return Err((status::CONFLICT, column));
                    }
                    once = Some(if code == 4 * ONE { Once::Dwell } else { Once::Zero });
                    continue;
                }
                _ => return Err((status::UNKNOWN, column)),
            };
            if has_mode {
                return Err((status::CONFLICT, column));
            }
            has_mode = true;
            self.mode = mode;
        }
        Ok(once)
    }

    /// F, S and T.
    fn modal(&mut self, words: &mut Words) -> Result<(), Refused> {
        if let Some((feed, column)) = words.take(b'F') {
            if feed <= 0 {
                return Err((status::OUT_OF_RANGE, column));
            }
            let own = if self.mode == Mode::Thread { &mut self.pitch } else { &mut self.feed };
            *own = feed as u32;
        }
        if let Some(speed) = words.take_whole(b'S', 63)? {
            self.speed = Some(speed as u8);
        }
        if let Some(tool) = words.take_whole(b'T', 7)? {
            self.tool = Some(tool as u8);
        }
        Ok(())
    }

    fn zero(&mut self, words: &mut Words) -> Result<Motion, Refused> {
        let (mut x, mut z) = (false, false);
        for letter in *b"XUZW" {
            if let Some((value, column)) = words.take(letter) {
                if value != 0 {
                    return Err((status::OUT_OF_RANGE, column));
                }
                let axis = if matches!(letter, b'X' | b'U') { &mut x } else { &mut z };
                *axis = true;
            }
        }
        if !x && !z {
            (x, z) = (true, true);
        }
        if x {
            self.place.x = 0;
        }
        if z {
            self.place.z = 0;
        }
        Ok(Motion::Zero { x, z })
    }

    /// Where the line goes.
    fn target(&self, words: &mut Words, settings: &Settings) -> Result<Place, Refused> {
        let mut place = self.place;
        let scale = if settings.diameter { 1 } else { 2 };
        for (own, absolute, by, scale) in
            [(&mut place.x, b'X', b'U', scale), (&mut place.z, b'Z', b'W', 1)]
        {
            let (to, by) = (words.take(absolute), words.take(by));
            if let (Some((_, one)), Some((_, other))) = (to, by) {
                return Err((status::CONFLICT, one.max(other)));
            }
            match (to, by) {
                (Some((value, _)), _) if !self.is_incremental => *own = value * scale,
                (Some((value, _)), _) | (_, Some((value, _))) => *own += value * scale,
                (None, None) => {}
            }
            if own.abs() >= 20_000 * ONE {
                let column = to.or(by).map_or(1, |(_, column)| column);
                return Err((status::OUT_OF_RANGE, column));
            }
        }
        Ok(place)
    }

    fn motion(
        &mut self,
        words: &mut Words,
        settings: &Settings,
        block: &mut Block,
    ) -> Result<(), Refused> {
        let is_arc = matches!(self.mode, Mode::Arc { .. });
        let names_place = b"XZUW".iter().any(|letter| words.has(*letter));
        if !names_place && !(is_arc && (words.has(b'I') || words.has(b'K'))) {
            return Ok(());
        }
        let target = self.target(words, settings)?;
        let (from, to) = (self.place.pulses(), target.pulses());
        let (x, z) = (to.0 - from.0, to.1 - from.1);
        match self.mode {
            Mode::Fast => (block.feed, block.motion) = (FASTEST, line(x, z)),
            Mode::Feed => {
                block.motion = line(x, z);
                let longer = x.unsigned_abs().max(z.unsigned_abs());
                let (x, z) = (u64::from(x.unsigned_abs()) * 50, u64::from(z.unsigned_abs()) * 100);
                block.feed = self.rate(longer, root(x * x + z * z).max(1))?;
            }
            Mode::Arc { clockwise } => {
                let arc = arc::read(words, clockwise, self.place, target)?;
                block.motion = Motion::Cut(Path::Arc(arc, (x, z)));
                block.feed = self.rate(1, PULSE as u64)?;
            }
            Mode::Thread => {
                if x != 0 {
                    return Err((status::CONFLICT, 1));
                }
                if self.pitch == 0 {
                    return Err((status::NO_FEED, 1));
                }
                let thread =
                    Thread::new(z < 0, z.unsigned_abs(), self.pitch, settings.increments());
                block.motion = Motion::Thread(thread);
            }
        }
        self.place = target;
        Ok(())
    }

    /// The rate of an axis that makes so many steps over a length in 0.1 µm, in parts of one a
    /// period.
    fn rate(&self, steps: u32, length: u64) -> Result<u32, Refused> {
        if self.feed == 0 {
            return Err((status::NO_FEED, 1));
        }
        // Steps are fewer than 2²², a feed is less than 2²⁷: this is less than 2⁶².
        let steps = u64::from(steps) * u64::from(self.feed) * PARTS.0;
        let rate = rounded(steps, length * PARTS.1);
        Ok(rate.clamp(1, u64::from(FASTEST)) as u32)
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.length as u16);
        state.bytes(self.text.get(..self.length).unwrap_or_default());
        state.bool(self.has_ended);
        state.u32(self.line);
        state.u32(self.blocks);
        state.bool(self.is_over);
        state.u8(match self.mode {
            Mode::Fast => 0,
            Mode::Feed => 1,
            Mode::Arc { clockwise: true } => 2,
            Mode::Arc { clockwise: false } => 3,
            Mode::Thread => 33,
        });
        state.bool(self.is_incremental);
        state.u64(self.place.x.cast_unsigned());
        state.u64(self.place.z.cast_unsigned());
        state.u8(self.speed.unwrap_or(u8::MAX));
        state.u8(self.tool.unwrap_or(u8::MAX));
        state.u32(self.feed);
        state.u32(self.pitch);
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) {
        self.length = usize::from(state.u16());
        if self.length > TEXT {
            return state.refuse();
        }
        copy(&mut self.text, state.bytes(self.length));
        self.has_ended = state.bool();
        self.line = state.u32();
        self.blocks = state.u32();
        self.is_over = state.bool();
        self.mode = match state.u8() {
            0 => Mode::Fast,
            1 => Mode::Feed,
            2 => Mode::Arc { clockwise: true },
            3 => Mode::Arc { clockwise: false },
            33 => Mode::Thread,
            _ => return state.refuse(),
        };
        self.is_incremental = state.bool();
        self.place = Place { x: state.u64().cast_signed(), z: state.u64().cast_signed() };
        self.speed = Some(state.u8()).filter(|value| *value != u8::MAX);
        self.tool = Some(state.u8()).filter(|value| *value != u8::MAX);
        self.feed = state.u32();
        self.pitch = state.u32();
    }
}

/// What a G code does in its own line alone.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Once {
    Dwell,
    Zero,
}

fn line(x: i32, z: i32) -> Motion {
    Motion::Cut(Path::Line(Line::between(x, z)))
}

/// The periods of G04.
fn dwell(words: &mut Words) -> Result<u32, Refused> {
    let seconds = match (words.take(b'X'), words.take(b'U')) {
        (None, seconds) | (seconds, None) => seconds,
        (Some((_, one)), Some((_, other))) => return Err((status::CONFLICT, one.max(other))),
    };
    let (millis, column) = match (seconds, words.take(b'P')) {
        (Some((value, column)), None) => (value * 1_000, column),
        (None, Some((value, column))) => (value, column),
        (Some((_, one)), Some((_, other))) => return Err((status::CONFLICT, one.max(other))),
        (None, None) => return Err((status::UNKNOWN, 1)),
    };
    // 2³² periods are twelve days.
    let periods = u32::try_from(millis * PERIODS_A_MILLI / ONE);
    periods.map_err(|_| (status::OUT_OF_RANGE, column))
}
