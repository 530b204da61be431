//! How large a trace may be. Beyond these the parser refuses; nothing in a
//! trace makes it take more memory or time than they allow.

/// Bytes of a file.
pub const FILE_BYTES: usize = 16 << 20;
/// Bytes of a line, without its end.
pub const LINE_BYTES: usize = 64 << 10;
/// Lines of a file.
pub const LINES: usize = 500_000;
/// Bytes that one `gen:` item makes or one `file:` item names.
pub const ITEM_BYTES: u64 = 16 << 20;
/// Bytes that all `gen:` items of a trace make together.
pub const GENERATED_BYTES: u64 = 32 << 20;
/// Combinations of alternatives of a trace.
pub const VARIANTS: usize = 64;
/// Bytes of a name: an id, a clause, a profile, a setting, a code.
pub const NAME_BYTES: usize = 128;
/// Characters of a title.
pub const TITLE_CHARACTERS: usize = 120;
/// The latest time in whole seconds (some 31 years).
pub const SECONDS: u64 = 999_999_999;
/// The longest break that a plug-in may send, in µs.
pub const BREAK_MICROS: u32 = 10_000_000;
/// Bytes of a file of another format that is imported.
pub const IMPORT_BYTES: usize = 64 << 20;
/// Bytes on the line of a trace that is exported.
pub const EXPORT_BYTES: usize = 8 << 20;
/// Interfaces of a capture that is imported.
pub const INTERFACES: usize = 1_024;
