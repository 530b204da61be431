//! Part programs in words of four octal digits: the memory that holds one, how it is checked as it
//! comes, and how it is carried out.

mod form;
mod word;

use crate::arc::Arc;
use crate::block::{Bad, Block, Motion, Next};
use crate::cut::{Path, feed_of_word};
use crate::line::Line;
use crate::settings::Settings;
use crate::status;
use crate::thread::{Thread, Z_PULSE};
use form::Form;
use softplug_plugin::{StateReader, StateWriter, copy};
use word::{Read, WordReader};

/// Words of a part program at most: 22 pages of 128.
pub(crate) const WORDS: usize = 2_816;
/// Bytes of the map of entries: a bit for each word.
const ENTRIES: usize = WORDS / 8;
/// The bits of a word. Above them are four more: those of a loop's three words hold how many runs
/// are left.
const WORD: u16 = 0o7777;

/// A part program and where it is.
#[derive(Clone, Debug)]
pub(crate) struct Octal {
    memory: [u8; 2 * WORDS],
    /// Words that may be entered by a loop: the first ones of blocks that stand in no loop.
    entries: [u8; ENTRIES],
    count: u16,
    reader: WordReader,
    /// The first word of the block that is being read.
    begin: u16,
    has_stm: bool,
    blocks: u32,
    /// The address of the block to begin with.
    start: Option<u16>,
    at: u16,
    stm: u16,
    feed: u16,
}

impl Octal {
    pub(crate) fn new() -> Self {
        Self {
            memory: [0; 2 * WORDS],
            entries: [0; ENTRIES],
            count: 0,
            reader: WordReader::default(),
            begin: 0,
            has_stm: false,
            blocks: 0,
            start: None,
            at: 0,
            stm: 0,
            feed: 0,
        }
    }

    /// Forgets the program.
    pub(crate) fn clear(&mut self) {
        self.entries.fill(0);
        self.reader = WordReader::default();
        (self.count, self.begin, self.has_stm, self.blocks) = (0, 0, false, 0);
        (self.start, self.at) = (None, 0);
    }

    fn word(&self, address: u16) -> u16 {
        let place = 2 * usize::from(address);
        match self.memory.get(place..place + 2) {
            Some([low, high]) => u16::from_le_bytes([*low, *high]),
            _ => 0,
        }
    }

    fn set_word(&mut self, address: u16, word: u16) {
        let place = 2 * usize::from(address);
        copy(self.memory.get_mut(place..).unwrap_or_default(), &word.to_le_bytes());
    }

    fn double(&self, address: u16) -> u32 {
        let (low, high) = (self.word(address), self.word(address + 1));
        u32::from(low & WORD) | u32::from(high & WORD) << 12
    }

    /// Takes a character of the program.
    pub(crate) fn character(&mut self, byte: u8, settings: &Settings) -> Result<(), Bad> {
        let read = self.reader.character(byte);
        self.take(read, settings)
    }

    /// The text is over.
    pub(crate) fn text_ended(&mut self, settings: &Settings) -> Result<(), Bad> {
        let read = if self.reader.is_in_comment() { Read::Bad } else { self.reader.end() };
        self.take(read, settings)?;
        if self.begin != self.count || self.count == 0 {
            return Err(self.bad(status::CUT_OFF));
        }
        if self.start.is_none() {
            return Err(Bad { status: status::NO_SUCH_BLOCK, line: 0, column: 0 });
        }
        Ok(())
    }

    fn bad(&self, status: u16) -> Bad {
        Bad { status, line: self.reader.word_line, column: self.reader.word_column }
    }

    fn take(&mut self, read: Read, settings: &Settings) -> Result<(), Bad> {
        match read {
            Read::Nothing => Ok(()),
            Read::Bad => Err(self.bad(status::NO_WORD)),
            Read::Word(word) => self.check(word, settings).map_err(|status| self.bad(status)),
        }
    }

    /// Puts a word behind the others, if it can stand there.
    fn check(&mut self, word: u16, settings: &Settings) -> Result<(), u16> {
        if usize::from(self.count) == WORDS {
            return Err(status::MEMORY);
        }
        let place = self.count - self.begin;
        if place == 0 {
            self.check_first(word, settings)?;
        } else if let Some((form, _)) = Form::of(self.word(self.begin)) {
            self.check_further(form, place, word)?;
        }
        self.set_word(self.count, word);
        self.count += 1;
        if let Some((form, as_before)) = Form::of(self.word(self.begin))
            && self.count - self.begin == form.words(as_before)
        {
            self.begin = self.count;
        }
        Ok(())
    }

    fn check_first(&mut self, g: u16, settings: &Settings) -> Result<(), u16> {
        let (form, as_before) = Form::of(g).ok_or(status::NO_G)?;
        let needs_one = as_before || matches!(form, Form::Zero { .. });
        if needs_one && !self.has_stm {
            return Err(status::NOTHING_BEFORE);
        }
        self.has_stm |= form != Form::Loop;
        self.mark_entry(self.count, true);
        self.blocks += 1;
        if i64::from(self.blocks) == settings.start_block {
            self.start = Some(self.count);
        }
        Ok(())
    }

    fn check_further(&mut self, form: Form, place: u16, word: u16) -> Result<(), u16> {
        if form == Form::Loop {
            return if place == 1 { check_runs(word) } else { self.check_entry(word) };
        }
        if place == 1 && !matches!(word, 0o0000 | 0o1000 | 0o4000 | 0o5000) {
            return Err(status::NO_GN);
        }
        if form.is_high(place) && word > 0o3777 {
            return Err(status::TOO_LARGE);
        }
        if let (Form::Arc { .. }, 5) = (form, place)
            && self.double(self.begin + 2) < 2
            && self.word(self.begin + 4) < 2
            && word == 0
        {
            return Err(status::NO_RADIUS);
        }
        Ok(())
    }

    /// A loop goes back to a block before it that is in no other loop, or begins one.
    fn check_entry(&mut self, entry: u16) -> Result<(), u16> {
        if entry >= self.begin || !self.is_entry(entry) {
            return Err(status::NO_ENTRY);
        }
        for inside in entry + 1..=self.begin {
            self.mark_entry(inside, false);
        }
        Ok(())
    }

    fn is_entry(&self, address: u16) -> bool {
        let bits = self.entries.get(usize::from(address / 8)).copied().unwrap_or_default();
        bits & 1 << (address % 8) != 0
    }

    fn mark_entry(&mut self, address: u16, is_entry: bool) {
        let Some(bits) = self.entries.get_mut(usize::from(address / 8)) else { return };
        let bit = 1 << (address % 8);
        if is_entry { *bits |= bit } else { *bits &= !bit }
    }

    /// Whether the block to begin with comes next.
    pub(crate) fn is_at_start(&self) -> bool {
        self.start == Some(self.at)
    }

    /// What is carried out next.
    pub(crate) fn next(&mut self, settings: &Settings) -> Next {
        if self.at >= self.count {
            return Next::End;
        }
        let begin = self.at;
        let Some((form, as_before)) = Form::of(self.word(begin) & WORD) else { return Next::End };
        self.at += form.words(as_before);
        if form == Form::Loop {
            self.go_round(begin);
            return Next::Nothing;
        }
        let is_zero = matches!(form, Form::Zero { .. });
        if !as_before && !is_zero {
            self.stm = self.word(self.at - 2);
            self.feed = self.word(self.at - 1);
        }
        let gn = if is_zero { 0 } else { self.word(begin + 1) };
        let feed = feed_of_word(self.feed);
        Next::Block(Block {
            speed: Some((self.stm >> 6) as u8),
            tool: Some((self.stm >> 3 & 7) as u8),
            function: if as_before || is_zero { 0 } else { (self.stm & 7) as u8 },
            feed,
            travel: feed,
            with_offset: gn & 0o4000 != 0,
            dwell: if gn & 0o1000 != 0 { settings.dwell_periods() } else { 0 },
            motion: self.motion(form, begin, settings),
        })
    }

    fn motion(&self, form: Form, begin: u16, settings: &Settings) -> Motion {
        let pulses = self.double(begin + 2);
        match form {
            Form::Loop => Motion::Nothing,
            Form::Zero { x, z } => Motion::Zero { x, z },
            Form::Axis { is_z, is_minus } => {
                let way = pulses as i32 * if is_minus { -1 } else { 1 };
                let line = if is_z { Line::between(0, way) } else { Line::between(way, 0) };
                Motion::Cut(Path::Line(line))
            }
            Form::Thread { is_minus } => {
                let pitch = if self.feed == 0 { 0o10000 } else { u32::from(self.feed) };
                let pitch = pitch * Z_PULSE as u32;
                Motion::Thread(Thread::new(is_minus, pulses, pitch, settings.increments()))
            }
            Form::Taper { z_is_main, x_minus, z_minus } => {
                let alpha = self.word(begin + 4);
                Motion::Cut(Path::Line(Line::taper(z_is_main, x_minus, z_minus, pulses, alpha)))
            }
            Form::Arc { clockwise, quadrant } => {
                let (x, steps) = (self.double(begin + 4), self.double(begin + 6));
                Motion::Cut(Path::Steps(Arc::steps(clockwise, quadrant, pulses, x, steps)))
            }
        }
    }

    /// At a loop: back to its entry while runs are left.
    fn go_round(&mut self, begin: u16) {
        let left = (0..3).fold(0, |left, at| left | (self.word(begin + at) >> 12) << (4 * at));
        let left = if left == 0 { self.word(begin + 1) & WORD } else { left } - 1;
        for at in 0..3 {
            let word = self.word(begin + at) & WORD;
            self.set_word(begin + at, word | (left >> (4 * at) & 0xF) << 12);
        }
        if left > 0 {
            self.at = self.word(begin + 2) & WORD;
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.count);
        state.bytes(self.memory.get(..2 * usize::from(self.count)).unwrap_or_default());
        state.bytes(self.entries.get(..usize::from(self.count) / 8 + 1).unwrap_or(&self.entries));
        self.reader.save(state);
        state.u16(self.begin);
        state.bool(self.has_stm);
        state.u32(self.blocks);
        state.u16(self.start.unwrap_or(u16::MAX));
        for value in [self.at, self.stm, self.feed] {
            state.u16(value);
        }
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) {
        self.count = state.u16();
        if usize::from(self.count) > WORDS {
            return state.refuse();
        }
        copy(&mut self.memory, state.bytes(2 * usize::from(self.count)));
        copy(&mut self.entries, state.bytes((usize::from(self.count) / 8 + 1).min(ENTRIES)));
        self.reader = WordReader::restore(state);
        self.begin = state.u16();
        self.has_stm = state.bool();
        self.blocks = state.u32();
        self.start = Some(state.u16()).filter(|address| *address != u16::MAX);
        self.at = state.u16();
        self.stm = state.u16();
        self.feed = state.u16();
        if self.begin > self.count || self.at > self.count {
            state.refuse();
        }
    }
}

fn check_runs(runs: u16) -> Result<(), u16> {
    if runs == 0 { Err(status::NO_RUNS) } else { Ok(()) }
}
