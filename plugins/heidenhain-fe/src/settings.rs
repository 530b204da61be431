//! The settings, and the manifest with them in it.

use softplug_plugin::{choice, settings};

choice! {
    /// Who makes and checks the parity bit.
    pub enum Parity { Port = "port", Even = "even" }
}

choice! {
    /// How the lines of a delivery end.
    pub enum LineEnd { Lf = "lf", CrLf = "crlf" }
}

settings! {
    /// The settings of blockwise transfer.
    pub struct Settings {
        parity: Parity = "port", "The parity bit: made by the port (7E2), or here on an 8-bit line.";
        repeats: i64 = 3 in 0..=15 "", "How often a block that was refused is sent, or asked for, again.";
        answer_time: i64 = 10000 in 100..=600000 "ms", "Time for the answer to a block that has left.";
        character_time: i64 = 1000 in 10..=60000 "ms", "Silence inside a block that damages it.";
        block_time: i64 = 30000 in 0..=600000 "ms", "Silence between two blocks that ends a reception; 0: never.";
        request_time: i64 = 0 in 0..=86400000 "ms", "How long a job waits until the control asks for it; 0: for ever.";
        job_time: i64 = 5000 in 100..=600000 "ms", "How long the control waits for a program that was granted.";
        dc1: bool = true, "DC1 stands behind each block and asks for the answer.";
        bcc_space: bool = false, "A space stands before ETB where the check character would be a control character.";
        line_end: LineEnd = "lf", "How lines end in what is delivered.";
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"heidenhain-fe","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"Heidenhain FE","description":"Blockwise transfer with block check and answers (FE1 mode).""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"late-controls","text":"Controls that repeat up to 15 times.","values":{"repeats":15}},"#,
        r#"{"name":"pty","text":"An 8-bit line: the parity bit is made here.","values":{"parity":"even"}}],"#,
        r#""jobs":[{"name":"send","text":"Sends a program when the control asks for it.","fields":["#,
        r#"{"name":"name","type":"text","text":"Only if the control asks for this name."}]}],"#,
        r#""requests":[{"name":"program","text":"The control asks for a program.","fields":["#,
        r#"{"name":"name","type":"text","text":"Its name."},"#,
        r#"{"name":"kind","type":"text","text":"Its kind: H a dialog program."}]}],"#,
        r#""profiles":[{"name":"heidenhain-fe","features":["parity","bcc-space"]}],"#,
        r#""needs":{"line_errors":"used","software_parity":true,"check_pass":true},"#,
        r#""state":{"saves":5,"accepts":[5]},"line":"7E2","#,
        r#""line_when":[{"when":{"parity":"even"},"line":"8N2"}]"#,
    ),
};
