//! How much a machine's file may have.

/// Most bytes of a file that are read. Longer ones are refused before they are parsed.
pub const MOST_FILE_BYTES: usize = 64 << 10;
/// Most bytes of a text that is shown.
pub const MOST_TEXT: usize = 500;
/// Most characters of a name.
pub(crate) const MOST_NAME: usize = 40;
