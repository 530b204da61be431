//! A program in either language.

use crate::block::{Bad, Next};
use crate::iso::Iso;
use crate::octal::Octal;
use crate::settings::{Input, Settings};
use crate::status;
use softplug_plugin::{StateReader, StateWriter};

/// Bytes of text that are taken at a time.
const PIECE: usize = 512;

/// What is carried out, and where it is.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one, in a place of its own")]
pub(crate) enum Program {
    /// The whole program, read before anything is sent: loops go back.
    Octal(Octal),
    /// A line at a time.
    Iso(Iso),
}

impl Program {
    pub(crate) fn new(input: Input) -> Self {
        match input {
            Input::Octal => Self::Octal(Octal::new()),
            Input::Iso => Self::Iso(Iso::new()),
        }
    }

    /// Begins anew, with the axes at a place in pulses of x and z.
    pub(crate) fn clear(&mut self, x: i64, z: i64) {
        match self {
            Self::Octal(program) => program.clear(),
            Self::Iso(program) => program.clear(x, z),
        }
    }

    /// Bytes of text that it takes now.
    pub(crate) fn room(&self) -> usize {
        match self {
            Self::Octal(_) => PIECE,
            Self::Iso(program) => program.room().min(PIECE),
        }
    }

    pub(crate) fn text(&mut self, bytes: &[u8], settings: &Settings) -> Result<(), Bad> {
        match self {
            Self::Octal(program) => {
                bytes.iter().try_for_each(|byte| program.character(*byte, settings))
            }
            Self::Iso(program) => {
                program.take_text(bytes);
                Ok(())
            }
        }
    }

    pub(crate) fn text_ended(&mut self, settings: &Settings) -> Result<(), Bad> {
        match self {
            Self::Octal(program) => program.text_ended(settings),
            Self::Iso(program) => {
                program.text_ended();
                Ok(())
            }
        }
    }

    /// Looks at all text that is there, without carrying anything out.
    pub(crate) fn check(&mut self, settings: &Settings) -> Result<(), Bad> {
        let Self::Iso(program) = self else { return Ok(()) };
        loop {
            match program.next(settings)? {
                Next::Block(_) | Next::Nothing => {}
                Next::End if i64::from(program.blocks()) < settings.start_block => {
                    let is_empty = program.blocks() == 0;
                    let status = if is_empty { status::CUT_OFF } else { status::NO_SUCH_BLOCK };
                    return Err(Bad { status, line: 0, column: 0 });
                }
                Next::Text | Next::End => return Ok(()),
            }
        }
    }

    /// Whether it can begin while text is still to come.
    pub(crate) fn is_streamed(&self) -> bool {
        matches!(self, Self::Iso(_))
    }

    /// Whether all text has come.
    pub(crate) fn has_ended(&self) -> bool {
        match self {
            Self::Octal(_) => true,
            Self::Iso(program) => program.has_ended(),
        }
    }

    pub(crate) fn next(&mut self, settings: &Settings) -> Result<Next, Bad> {
        match self {
            Self::Octal(program) => Ok(program.next(settings)),
            Self::Iso(program) => program.next(settings),
        }
    }

    /// Whether the block that comes next is the one to begin with.
    pub(crate) fn is_at_start(&self, settings: &Settings) -> bool {
        match self {
            Self::Octal(program) => program.is_at_start(),
            Self::Iso(program) => i64::from(program.blocks()) + 1 >= settings.start_block,
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        match self {
            Self::Octal(program) => program.save(state),
            Self::Iso(program) => program.save(state),
        }
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) {
        match self {
            Self::Octal(program) => program.restore(state),
            Self::Iso(program) => program.restore(state),
        }
    }
}
