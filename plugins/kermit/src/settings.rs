//! The settings, and the manifest with them in it.

use softplug_plugin::{choice, settings};

choice! {
    /// What becomes of the ends of lines.
    pub enum Mode { Binary = "binary", Text = "text" }
}

choice! {
    /// When bytes above 127 travel as two characters.
    pub enum EighthBit { Auto = "auto", Prefix = "prefix" }
}

settings! {
    /// The settings of Kermit.
    pub struct Settings {
        mode: Mode = "binary", "binary leaves all bytes as they are; text sends LF as CR LF, and takes it so.";
        check: i64 = 3 in 1..=3 "", "The best block check: 1 and 2 are sums, 3 is a CRC.";
        crc_only: bool = false, "Refuse a transfer in which the other side does not agree to check 3.";
        packet_length: i64 = 1000 in 20..=1000 "", "The most characters of a packet; up to 94 there are no long packets.";
        eighth_bit: EighthBit = "auto", "auto prefixes bytes above 127 where the line has seven bits or the other side asks.";
        repeat_prefix: bool = true, "Runs of equal bytes travel as a count.";
        answer_time: i64 = 10000 in 100..=600000 "ms", "Time for the answer to a packet that has left; then it goes again.";
        packet_time: i64 = 15000 in 100..=600000 "ms", "Time for the next packet; then it is asked for.";
        character_time: i64 = 1000 in 10..=60000 "ms", "Silence inside a packet that damages it.";
        begin_time: i64 = 0 in 0..=86400000 "ms", "How long a job waits for a receiver; 0: for ever.";
        job_time: i64 = 5000 in 100..=600000 "ms", "How long the machine waits for a program that was granted.";
        repeats: i64 = 10 in 0..=100 "", "How often a packet is sent, or asked for, again.";
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"kermit","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"Kermit","description":"Named files in numbered packets, each answered; also on 7-bit lines.""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"crc-only","text":"Only with CRC: check 1 misses one damage of 64.","values":{"crc_only":true}},"#,
        r#"{"name":"text","text":"Ends of lines are CR LF on the line and LF here.","values":{"mode":"text"}}],"#,
        r#""jobs":[{"name":"send","text":"Sends a file.","fields":["#,
        r#"{"name":"name","type":"text","text":"Its name for the receiver; PROGRAM without."}]}],"#,
        r#""requests":[{"name":"program","text":"The machine asks for a file.","fields":["#,
        r#"{"name":"name","type":"text","text":"Its name."}]}],"#,
        r#""profiles":[{"name":"kermit","features":[]}],"#,
        r#""needs":{"line_errors":"used"},"#,
        r#""state":{"saves":2,"accepts":[2]},"line":"8N1""#,
    ),
};
