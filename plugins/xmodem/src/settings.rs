//! The settings, and the manifest with them in it.

use softplug_plugin::{choice, settings};

choice! {
    /// Checks and lengths of blocks.
    pub enum Mode { Auto = "auto", Checksum = "checksum", Crc = "crc", Long = "1k" }
}

choice! {
    /// What becomes of the padding of a file that is received.
    pub enum Padding { Strip = "strip", Keep = "keep" }
}

settings! {
    /// The settings of XMODEM.
    pub struct Settings {
        mode: Mode = "auto", "Checks and blocks: auto lets the receiver choose the check, 1k sends blocks of 1,024 bytes.";
        call: bool = true, "Call for a file whenever nothing else is under way.";
        call_time: i64 = 3000 in 100..=60000 "ms", "Time between two calls for a file.";
        block_time: i64 = 10000 in 100..=600000 "ms", "Time for the next block, and for the answer to EOT.";
        character_time: i64 = 1000 in 10..=60000 "ms", "Silence inside a block that damages it.";
        purge_time: i64 = 1000 in 10..=60000 "ms", "Silence after which the line counts as clear.";
        answer_time: i64 = 60000 in 100..=600000 "ms", "Time for the answer to a block that has left.";
        request_time: i64 = 0 in 0..=86400000 "ms", "How long a job waits for the receiver's call; 0: for ever.";
        repeats: i64 = 10 in 0..=100 "", "How often a block is sent, or asked for, again.";
        pad: i64 = 26 in 0..=255 "", "The byte that fills up the last block; 26 is SUB.";
        padding: Padding = "strip", "What becomes of the padding of a file that is received.";
        end_twice: bool = true, "The first EOT is answered by NAK, the second one counts.";
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"xmodem","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"XMODEM","description":"Files in numbered blocks with checksum or CRC, each answered (XMODEM, XMODEM-CRC, XMODEM-1K).""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"crc-only","text":"Only with CRC: a checksum misses every other damage of two bits.","values":{"mode":"crc"}}],"#,
        r#""jobs":[{"name":"send","text":"Sends a file when the receiver calls for it."}],"#,
        r#""profiles":[{"name":"xmodem","features":[]}],"#,
        r#""needs":{"line_errors":"used"},"#,
        r#""state":{"saves":1,"accepts":[1]},"line":"8N1""#,
    ),
};
