//! A block, whatever language it was written in.

use crate::cut::Path;
use crate::thread::Thread;
use softplug_plugin::{StateReader, StateWriter};

/// What a block moves.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) enum Motion {
    #[default]
    Nothing,
    Cut(Path),
    Thread(Thread),
    /// Back to zero, of one axis or both: first x, then z.
    Zero {
        x: bool,
        z: bool,
    },
    /// To where the first block begins, by so many pulses: first z, then x.
    Way {
        x: i32,
        z: i32,
    },
}

/// A block, with all that is in force in it.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Block {
    pub(crate) speed: Option<u8>,
    pub(crate) tool: Option<u8>,
    /// 0: none.
    pub(crate) function: u8,
    /// Of its cut.
    pub(crate) feed: u32,
    /// Of an offset, a return and the way to a first block.
    pub(crate) travel: u32,
    pub(crate) with_offset: bool,
    /// Periods at the end.
    pub(crate) dwell: u32,
    pub(crate) motion: Motion,
}

/// Why a program is refused, and where: from 1, 0 for the program as a whole.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Bad {
    pub(crate) status: u16,
    pub(crate) line: u32,
    pub(crate) column: u32,
}

/// What comes next of a program.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Next {
    Block(Block),
    /// The program is over.
    End,
    /// More text is needed.
    Text,
    /// It goes on, but nothing came of this.
    Nothing,
}

/// A number below 255, or none.
pub(crate) fn save_option(state: &mut StateWriter<'_>, value: Option<u8>) {
    state.u8(value.unwrap_or(u8::MAX));
}

/// What [`save_option`] has written.
pub(crate) fn restore_option(state: &mut StateReader<'_>) -> Option<u8> {
    Some(state.u8()).filter(|value| *value != u8::MAX)
}

impl Block {
    /// Its cut is kept elsewhere once it has begun; here it is saved as a whole.
    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        save_option(state, self.speed);
        save_option(state, self.tool);
        state.u8(self.function);
        state.u32(self.feed);
        state.u32(self.travel);
        state.bool(self.with_offset);
        state.u32(self.dwell);
        match &self.motion {
            Motion::Nothing => state.u8(0),
            Motion::Cut(path) => {
                state.u8(1);
                crate::cut::Cut::new(*path, 1).save(state);
            }
            Motion::Thread(thread) => {
                state.u8(2);
                thread.save(state);
            }
            Motion::Way { x, z } => {
                state.u8(3);
                state.u32(x.cast_unsigned());
                state.u32(z.cast_unsigned());
            }
            Motion::Zero { x, z } => state.u8(4 | u8::from(*x) | u8::from(*z) << 1),
        }
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Self {
        Self {
            speed: restore_option(state),
            tool: restore_option(state),
            function: state.u8(),
            feed: state.u32(),
            travel: state.u32(),
            with_offset: state.bool(),
            dwell: state.u32(),
            motion: match state.u8() {
                0 => Motion::Nothing,
                1 => Motion::Cut(crate::cut::Cut::restore(state).path()),
                2 => Motion::Thread(Thread::restore(state)),
                3 => Motion::Way { x: state.u32().cast_signed(), z: state.u32().cast_signed() },
                axes @ 4..8 => Motion::Zero { x: axes & 1 != 0, z: axes & 2 != 0 },
                _ => {
                    state.refuse();
                    Motion::Nothing
                }
            },
        }
    }
}
