//! A program as what it asks for, one thing after the other.

use super::pulses::{Due, Step, cut, line, sum};
use super::rules::Rules;

/// What comes next.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Item {
    Bytes(Vec<Due>),
    /// S, T or M, which waits for its echo.
    Command(u8),
    /// So many pulses of z, at a pitch in 0.1 µm a turn.
    Thread {
        sign: i64,
        pulses: u64,
        pitch: u64,
    },
    BlockEnd,
    /// What the model does not go through: it is not judged any more.
    Unknown,
}

/// Why a program is refused: status, line and column.
pub(super) type Bad = (u16, u32, u32);

/// A block of either language.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Block {
    pub(super) speed: Option<u8>,
    pub(super) tool: Option<u8>,
    pub(super) function: u8,
    pub(super) feed: u64,
    pub(super) travel: u64,
    pub(super) with_offset: bool,
    pub(super) dwell: u64,
    pub(super) motion: Motion,
}

#[derive(Clone, PartialEq, Debug)]
pub(super) enum Motion {
    Nothing,
    Steps(Vec<Step>, &'static str),
    Thread {
        sign: i64,
        pulses: u64,
        pitch: u64,
    },
    Zero {
        x: bool,
        z: bool,
    },
    /// More pulses than the model goes through.
    Huge,
}

/// Pulses of a block that a model goes through at most.
pub(super) const MOST_PULSES: u64 = 50_000;

/// Blocks that a model goes through at most, and the bytes that it makes of them.
pub(super) const MOST_BLOCKS: usize = 3_000;
pub(super) const MOST_BYTES: usize = 60_000;
/// Blocks in a row that send nothing: past so many others have their turn.
const MOST_EMPTY: usize = 60;

/// Makes items of blocks, which are carried out one after the other.
pub(super) struct Course<'a> {
    rules: &'a Rules,
    items: Vec<Item>,
    /// In pulses of x and z.
    pub(super) place: (i64, i64),
    speed: Option<u8>,
    tool: Option<u8>,
    offset: (i64, i64),
    bytes: usize,
    empty: usize,
    is_unknown: bool,
}

impl<'a> Course<'a> {
    pub(super) fn new(rules: &'a Rules, place: (i64, i64)) -> Self {
        Self {
            rules,
            items: Vec::new(),
            place,
            speed: None,
            tool: None,
            offset: (0, 0),
            bytes: 0,
            empty: 0,
            is_unknown: false,
        }
    }

    /// All items. Behind them the program is over.
    pub(super) fn items(self) -> Vec<Item> {
        self.items
    }

    fn send(&mut self, bytes: Vec<Due>) {
        self.bytes += bytes.len();
        if !bytes.is_empty() {
            self.items.push(Item::Bytes(bytes));
        }
    }

    fn command(&mut self, code: u8) {
        self.bytes += 1;
        self.items.push(Item::Command(code));
    }

    fn cut(&mut self, steps: &[Step], feed: u64, clause: &'static str) {
        let by = sum(steps);
        self.place = (self.place.0 + by.0, self.place.1 + by.1);
        self.send(cut(steps, feed, clause));
    }

    fn commands(&mut self, block: &Block) {
        if block.speed.is_some() && block.speed != self.speed {
            self.speed = block.speed;
            self.command(0x80 + block.speed.unwrap_or(0));
        }
        if block.tool.is_some() && block.tool != self.tool {
            self.tool = block.tool;
            self.command(0xC0 + block.tool.unwrap_or(0));
        }
        if block.function != 0 {
            self.command(0xD0 + block.function);
        }
    }

    /// To where the first block begins: S, T, M, then z, then x.
    pub(super) fn begin_at(&mut self, block: &Block, place: (i64, i64)) {
        const CLAUSE: &str = "pulse-lathe.run.start-block";
        self.commands(block);
        let (x, z) = (place.0 - self.place.0, place.1 - self.place.1);
        self.cut(&line(0, z), block.travel, CLAUSE);
        self.cut(&line(x, 0), block.travel, CLAUSE);
        self.items.push(Item::BlockEnd);
    }

    pub(super) fn block(&mut self, block: &Block) {
        const OFFSET: &str = "pulse-lathe.words.offset";
        let before = self.bytes;
        self.commands(block);
        if let Motion::Zero { x, z } = block.motion {
            const ZERO: &str = "pulse-lathe.words.zero";
            if x {
                self.offset.0 = 0;
                self.cut(&line(-self.place.0, 0), block.travel, ZERO);
            }
            if z {
                self.offset.1 = 0;
                self.cut(&line(0, -self.place.1), block.travel, ZERO);
            }
        } else {
            let tool = if block.with_offset { self.tool.unwrap_or(0) } else { 0 };
            let wanted = self.rules.offsets[usize::from(tool)];
            let (x, z) = (wanted.0 - self.offset.0, wanted.1 - self.offset.1);
            self.cut(&line(x, 0), block.travel, OFFSET);
            self.cut(&line(0, z), block.travel, OFFSET);
            self.offset = wanted;
        }
        match &block.motion {
            Motion::Nothing | Motion::Zero { .. } | Motion::Thread { pulses: 0, .. } => {}
            Motion::Huge => self.give_up(),
            Motion::Steps(steps, clause) => self.cut(steps, block.feed, clause),
            Motion::Thread { sign, pulses, pitch } => {
                self.place.1 += sign * *pulses as i64;
                self.bytes += *pulses as usize;
                self.items.push(Item::Thread { sign: *sign, pulses: *pulses, pitch: *pitch });
            }
        }
        let dwell = vec![(0x00, "pulse-lathe.words.dwell"); block.dwell as usize];
        self.send(dwell);
        self.items.push(Item::BlockEnd);
        self.empty = if self.bytes == before { self.empty + 1 } else { 0 };
        if self.is_too_long() {
            self.items.push(Item::Unknown);
        }
    }

    /// Whether the model leaves it at that.
    pub(super) fn is_too_long(&self) -> bool {
        self.bytes > MOST_BYTES || self.empty > MOST_EMPTY || self.is_unknown
    }

    pub(super) fn give_up(&mut self) {
        self.is_unknown = true;
        self.items.push(Item::Unknown);
    }
}
