//! The settings, and the manifest with them in it.

use crate::codes::Codes;
use softplug_plugin::{Bytes, choice, settings};

choice! {
    /// How lines end.
    pub enum LineEnd {
        Keep = "keep",
        Lf = "lf",
        Cr = "cr",
        CrLf = "crlf",
        LfCrCr = "lfcrcr",
    }
}

choice! {
    /// What to do with control bytes in a program.
    pub enum ControlInData { Refuse = "refuse", Drop = "drop", Send = "send" }
}

choice! {
    /// What to do with bytes that arrive while we send.
    pub enum WhileSending { Deliver = "deliver", Ignore = "ignore" }
}

choice! {
    /// What a damaged character does to a reception.
    pub enum OnLineError { Fail = "fail", Keep = "keep" }
}

settings! {
    /// The settings of XON/XOFF.
    pub struct Settings {
        xon: i64 = 0x11 in 0..=255 "", "Byte that lets a sender go on (DC1).";
        xoff: i64 = 0x13 in 0..=255 "", "Byte that stops a sender (DC3).";
        parity_mask: i64 = 0xFF in 1..=255 "", "Bits of a control byte that count; 127 takes 93 for 13.";
        wait_for_xon: bool = false, "Send the first byte of a job only after an XON.";
        held_timeout: i64 = 0 in 0..=86400000 "ms", "A job held for longer fails; 0: never.";
        feed_start: Bytes<32> = "", "Sent before the program.";
        feed_end: Bytes<32> = "", "Sent after the program.";
        abort_send: Bytes<32> = "", "Sent after a job was aborted.";
        send_line_end: LineEnd = "keep", "How lines end on the wire.";
        send_drop: Bytes<32> = "", "Bytes of a program that are not sent.";
        control_in_data: ControlInData = "refuse", "A control byte in a program: refuse the job, leave the byte out, or send it.";
        while_sending: WhileSending = "deliver", "Bytes that arrive while we send; an echo can be ignored.";
        transparent: bool = false, "Escape control bytes in both directions.";
        escape: i64 = 0x10 in 0..=255 "", "The escape byte (DLE).";
        escape_xor: i64 = 0x40 in 1..=255 "", "Exclusive-or of an escaped byte.";
        speak: bool = true, "Send XOFF and XON as a receiver.";
        low_mark: i64 = 1024 in 1..=65535 "bytes", "XOFF is sent below this room.";
        high_mark: i64 = 2048 in 1..=65535 "bytes", "XON is sent above this room.";
        xon_repeat: i64 = 1000 in 0..=600000 "ms", "XON is repeated after so long a silence; 0: never.";
        xoff_repeat: i64 = 32 in 0..=65535 "characters", "XOFF is repeated after so many characters in spite of it; 0: never.";
        xon_at_open: bool = false, "Send XON when the link opens.";
        receive_line_end: LineEnd = "keep", "How lines end in what is delivered.";
        receive_drop: Bytes<32> = "", "Received bytes that are not delivered, such as 00 and 7f.";
        end_mark: Bytes<16> = "", "Bytes that end a program, such as 25 (%).";
        end_mark_count: i64 = 1 in 1..=255 "", "How many end marks end a program; 2 where it begins with one.";
        end_quiet: i64 = 500 in 1..=600000 "ms", "Silence after the end mark that ends the reception.";
        quiet_time: i64 = 3000 in 0..=600000 "ms", "Silence that ends the reception, as failed if the end mark is missing; 0: never.";
        on_line_error: OnLineError = "fail", "A damaged character fails the delivery, or is kept.";
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.0","name":"xon-xoff","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"XON/XOFF","description":"Software flow control in both directions.""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"parity","text":"Control bytes with even parity on an 8-bit line.","values":{"parity_mask":127}},"#,
        r#"{"name":"drip-feed","text":"Feeding while cutting: waits for XON, holds for hours.","values":{"wait_for_xon":true,"held_timeout":0}},"#,
        r#"{"name":"memory","text":"Into the control's memory: a hold of two minutes is a fault.","values":{"held_timeout":120000}},"#,
        r#"{"name":"tape","text":"From one percent sign to the next, without blank tape.","values":{"end_mark":"25","end_mark_count":2,"receive_drop":"00 7f"}},"#,
        r#"{"name":"binary","text":"Any bytes, escaped in both directions.","values":{"transparent":true}}],"#,
        r#""jobs":[{"name":"send","text":"Sends a program."}],"#,
        r#""profiles":[{"name":"xon-xoff","features":["transparent","parity-mask","end-mark","line-ends","drop","strings","repeat"]}],"#,
        r#""needs":{"line_errors":"used","check_pass":true},"#,
        r#""state":{"saves":1,"accepts":[1]}"#,
    ),
};

impl Settings {
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        let codes = Codes::new(self);
        if codes.control(codes.xon) == codes.control(codes.xoff) {
            return Err("xon and xoff are the same byte under parity_mask; change one of them");
        }
        if !self.transparent {
            return Ok(());
        }
        if self.parity_mask & 0x7F != 0x7F {
            return Err("parity_mask takes data bytes for control bytes that are not escaped; in \
                transparent mode it is 127 or 255");
        }
        if codes.control(self.escape as u8).is_some() {
            return Err("escape is a control byte; choose another");
        }
        let clashes = |byte| codes.escaped(byte).is_some_and(|[_, byte]| codes.must_escape(byte));
        if (0..=255).any(clashes) {
            return Err("escape_xor turns a control byte into another; choose another");
        }
        Ok(())
    }
}
