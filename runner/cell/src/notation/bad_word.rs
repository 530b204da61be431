//! What is wrong with a block that coordinates, and what to write.

use thiserror::Error;

use super::MOST_WORDS;

/// Why a block cannot be understood. A text is the block's, or what it says there.
#[derive(Debug, Error)]
pub(super) enum BadWord {
    #[error("the program has more than {MOST_WORDS} words")]
    TooMany,
    #[error("a word cannot be skipped by choice: take the / away")]
    Skipped,
    #[error("words in two notations stand here: give each a block of its own")]
    TwoNotations,
    #[error("\"{}\" is no channel of the cell, which has {known}", name.escape_debug())]
    Channel { name: String, known: String },
    #[error("\"{}\" is no axis of the cell, which has {known}", name.escape_debug())]
    Axis { name: String, known: String },
    #[error("a channel cannot meet itself: name another one")]
    Alone,
    #[error("a channel cannot start itself: its program would wait for its own end")]
    StartsItself,
    #[error("\"{}\" is no mark: give a whole number up to {}", .0.escape_debug(), u32::MAX)]
    Mark(String),
    #[error("\"{}\" names no program", .0.escape_debug())]
    Program(String),
    #[error(
        "\"{}\" cannot be understood: write (SOFTPLUG WAIT mark channels), LOAD channel program, \
         START channel, GET axis, TAKE axis or RELEASE axis",
        .0.escape_debug()
    )]
    Comment(String),
    #[error(
        "\"{}\" cannot be understood: write WAI mark channels, LAD channel program or EXE channel",
        .0.escape_debug()
    )]
    Wai(String),
    #[error("{} has to stand alone in its block, apart from what it names", .0.escape_debug())]
    WaiAmongOthers(String),
    #[error(
        "\"{}\" cannot be understood: write WAITM(mark,channels), INIT(channel,\"program\"), \
         START(channels), GET(axes), GETD(axes) or RELEASE(axes)",
        .0.escape_debug()
    )]
    Siemens(String),
    #[error("{0} has to stand alone in its block, with its arguments in brackets")]
    SiemensAmongOthers(String),
    #[error("{verb} is not understood: the cell knows {known}")]
    SiemensUnknown { verb: String, known: String },
    #[error(
        "\"{}\": a waiting M code has to stand alone in its block, with P and the numbers of the \
         channels that wait, or without for all",
        .0.escape_debug()
    )]
    MCode(String),
}
