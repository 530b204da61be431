//! The plug-in's status codes. Their texts stand in the manifest.

pub(crate) const NO_WORD: u16 = 1;
pub(crate) const NO_G: u16 = 2;
pub(crate) const NO_GN: u16 = 3;
pub(crate) const TOO_LARGE: u16 = 4;
pub(crate) const NO_RADIUS: u16 = 5;
pub(crate) const NOTHING_BEFORE: u16 = 6;
pub(crate) const NO_RUNS: u16 = 7;
pub(crate) const NO_ENTRY: u16 = 8;
pub(crate) const MEMORY: u16 = 9;
pub(crate) const CUT_OFF: u16 = 10;
pub(crate) const NO_SUCH_BLOCK: u16 = 11;

pub(crate) const UNREADABLE: u16 = 12;
pub(crate) const UNKNOWN: u16 = 13;
pub(crate) const OUT_OF_RANGE: u16 = 14;
pub(crate) const NO_FEED: u16 = 15;
pub(crate) const NO_ARC: u16 = 16;
pub(crate) const CONFLICT: u16 = 17;
pub(crate) const LONG_LINE: u16 = 18;

pub(crate) const FAST_SPINDLE: u16 = 20;
pub(crate) const OPERATOR: u16 = 21;
pub(crate) const LIMIT: u16 = 22;
pub(crate) const UNDERRUN: u16 = 23;

/// Their part of the manifest.
macro_rules! status_texts { () => { concat!(
    r#""status":["#,
    r#"{"code":1,"name":"no word","text":"not four octal digits; words stand apart, comments in ( )"},"#,
    r#"{"code":2,"name":"no G","text":"a block begins here, but this is no G; count the words before it"},"#,
    r#"{"code":3,"name":"no GN","text":"GN is 0000, 1000, 4000 or 5000"},"#,
    r#"{"code":4,"name":"too large","text":"a high word is at most 3777; the direction stands in G"},"#,
    r#"{"code":5,"name":"no radius","text":"Nz and Nx are both less than 2"},"#,
    r#"{"code":6,"name":"nothing before","text":"no block before has S, T, M and F; write them here"},"#,
    r#"{"code":7,"name":"no runs","text":"E is how often the section is run, at least 0001"},"#,
    r#"{"code":8,"name":"no entry","text":"D is the number, from 0000, of the first word of an earlier block outside other loops"},"#,
    r#"{"code":9,"name":"memory","text":"at most 2816 words; divide the program, or use loops"},"#,
    r#"{"code":10,"name":"cut off","text":"the program ends within a block, or has none"},"#,
    r#"{"code":11,"name":"no such block","text":"start_block is beyond the last block"},"#,
    r#"{"code":12,"name":"unreadable","text":"neither a letter with a number nor a comment"},"#,
    r#"{"code":13,"name":"unknown","text":"this word means nothing here; take it out"},"#,
    r#"{"code":14,"name":"out of range","text":"the number is too small or too large here, or has more than four decimals"},"#,
    r#"{"code":15,"name":"no feed","text":"no feed or pitch up to here; write F"},"#,
    r#"{"code":16,"name":"no arc","text":"I and K, or R, do not fit: the end is not on the circle, or it is too small"},"#,
    r#"{"code":17,"name":"conflict","text":"this word does not go with another one of its line"},"#,
    r#"{"code":18,"name":"long line","text":"a line has at most 200 characters"},"#,
    r#"{"code":20,"name":"fast spindle","text":"the spindle is too fast for this pitch; take a lower speed step"},"#,
    r#"{"code":21,"name":"operator","text":"the operator has stopped it"},"#,
    r#"{"code":22,"name":"limit switch","text":"an axis is at its limit switch; look where it stands"},"#,
    r#"{"code":23,"name":"underrun","text":"the queue ran empty inside a cut; raise ahead"}],"#,
) } }
pub(crate) use status_texts;
