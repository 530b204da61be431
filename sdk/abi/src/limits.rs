//! Every limit of the ABI, one number each, with what happens past it.

/// Largest module in bytes. A larger file is refused unread.
pub const MODULE_BYTES: usize = 256 * 1024;

/// Most pages (64 KiB each) of memory a plug-in may declare; minimum and
/// maximum must be equal. More is refused by the lint.
pub const MEMORY_PAGES: u64 = 4;

/// Most function types. More is refused by the lint, before anything is built from the module, as
/// with all that follow up to [`MODULE_WEIGHT`].
pub const TYPES: u64 = 1_024;

/// Most parameters of one function type.
pub const PARAMETERS: u64 = 64;

/// Most functions.
pub const FUNCTIONS: u64 = 4_096;

/// Most globals. An instance's resident size would grow with them.
pub const GLOBALS: u64 = 1_024;

/// Most exports.
pub const EXPORTS: u64 = 256;

/// Most elements of the table, and of all element segments together. An instance's resident
/// size would grow with them.
pub const ELEMENTS: u64 = 1_024;

/// Most element segments, and most data segments.
pub const SEGMENTS: u64 = 1_024;

/// Most parameters and locals of one function. A few bytes can declare thousands.
pub const LOCALS: u64 = 1_024;

/// Most blocks, loops and ifs within each other.
pub const NESTING: u64 = 1_024;

/// Most weight of one function, in the units of `docs/abi.md` (about 1 µs of compiling each).
/// A heavier one is refused by the lint.
pub const FUNCTION_WEIGHT: u64 = 500_000;

/// Most weight of all functions together, in the same units. A heavier module is refused by the
/// lint.
pub const MODULE_WEIGHT: u64 = 1_500_000;

/// Largest manifest in bytes. A larger one is refused by the lint.
pub const MANIFEST_BYTES: usize = 64 * 1024;

/// Smallest and largest input buffer in bytes. Outside: refused at load.
pub const INPUT_BYTES: core::ops::RangeInclusive<u32> = 512..=32_768;

/// Smallest and largest output buffer in bytes. Outside: refused at load.
pub const OUTPUT_BYTES: core::ops::RangeInclusive<u32> = 512..=32_768;

/// Smallest and largest region of last words in bytes. Outside: refused at load.
pub const WORDS_BYTES: core::ops::RangeInclusive<u32> = 64..=1_024;

/// Timers of a plug-in have the ids `0..TIMERS`. Another id is malformed.
pub const TIMERS: u8 = 16;

/// Most bytes in one record's payload: its length field is 16 bits wide.
pub const RECORD_BYTES: usize = u16::MAX as usize;

/// Most bytes that may wait in the urgent queue. More is malformed.
pub const URGENT_BYTES: usize = 16;

/// Most marks that may be outstanding at once. More is malformed.
pub const MARKS: usize = 64;

/// Most events a host delivers at one instant of a link. One more is a fault of
/// the plug-in: it keeps time from going on.
pub const STEPS_PER_INSTANT: u32 = 1_000;

/// Most rounds of `continue` for one event. A plug-in with yet more output is at fault.
pub const OUTPUT_ROUNDS: u32 = 256;

/// Largest saved state in bytes. A larger one is malformed.
pub const STATE_BYTES: u32 = 64 * 1024;

/// Fuel for one event or one round of `continue`: some 1 ms of computing. Past
/// it the instance ends as one whose budget is exhausted.
pub const FUEL_PER_EVENT: u64 = 1_000_000;

/// Most settings in a manifest. More is refused by the lint.
pub const SETTINGS: usize = 128;

/// Most bytes in one value (setting or field) of type text or bytes. A longer
/// one is refused before it reaches the plug-in.
pub const VALUE_BYTES: usize = 400;

/// Most fields of a job or a request. More is refused by the lint.
pub const FIELDS: usize = 16;

/// Most bytes in a note's text. A longer one is malformed.
pub const NOTE_BYTES: usize = 240;

/// Most bytes in a state name. A longer one is malformed.
pub const STATE_NAME_BYTES: usize = 48;

/// Most bytes in a delivery's name. A longer one is malformed.
pub const DELIVERY_NAME_BYTES: usize = 128;

/// Most requests that may be unanswered at once. More is malformed.
pub const REQUESTS: usize = 4;

/// Longest break in µs (10 s). A longer one is malformed.
pub const BREAK_MICROS: u32 = 10_000_000;
