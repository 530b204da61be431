//! The settings, and the manifest with them in it.

use crate::status::status_texts;
use softplug_plugin::{choice, settings};

choice! {
    /// The language of part programs.
    pub enum Input { Octal = "octal", Iso = "iso" }
}

choice! {
    /// What follows from a queue that ran empty inside a cut.
    pub enum Underrun { Note = "note", Stop = "stop" }
}

settings! {
    /// The settings of a pulse lathe.
    pub struct Settings {
        input: Input = "octal", "Words of four octal digits, or ISO code.";
        start_block: i64 = 1 in 1..=1000000 "", "The block to begin with, counted from 1.";
        single_block: bool = false, "Wait for a start behind each block.";
        diameter: bool = true, "X and U of ISO code are diameters.";
        dwell: i64 = 500 in 0..=60000 "ms", "A dwell of GN.";
        spindle_increments: i64 = 1024 in 1..=65535 "", "Increments of a turn of the spindle.";
        echo_time: i64 = 10000 in 10..=600000 "ms", "Time for S, T or M.";
        ahead: i64 = 100 in 4..=250 "ms", "Pulses that wait in the queue.";
        underrun: Underrun = "note", "A queue that ran empty inside a cut: tell it, or stop, too.";
        x_offset_1: i64 = 0 in -100000..=100000 "", "Tool 1: offset in x, in pulses.";
        z_offset_1: i64 = 0 in -100000..=100000 "", "Tool 1: offset in z, in pulses.";
        x_offset_2: i64 = 0 in -100000..=100000 "", "Tool 2: offset in x, in pulses.";
        z_offset_2: i64 = 0 in -100000..=100000 "", "Tool 2: offset in z, in pulses.";
        x_offset_3: i64 = 0 in -100000..=100000 "", "Tool 3: offset in x, in pulses.";
        z_offset_3: i64 = 0 in -100000..=100000 "", "Tool 3: offset in z, in pulses.";
        x_offset_4: i64 = 0 in -100000..=100000 "", "Tool 4: offset in x, in pulses.";
        z_offset_4: i64 = 0 in -100000..=100000 "", "Tool 4: offset in z, in pulses.";
        x_offset_5: i64 = 0 in -100000..=100000 "", "Tool 5: offset in x, in pulses.";
        z_offset_5: i64 = 0 in -100000..=100000 "", "Tool 5: offset in z, in pulses.";
        x_offset_6: i64 = 0 in -100000..=100000 "", "Tool 6: offset in x, in pulses.";
        z_offset_6: i64 = 0 in -100000..=100000 "", "Tool 6: offset in z, in pulses.";
        x_offset_7: i64 = 0 in -100000..=100000 "", "Tool 7: offset in x, in pulses.";
        z_offset_7: i64 = 0 in -100000..=100000 "", "Tool 7: offset in z, in pulses.";
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"pulse-lathe","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"Pulse lathe","description":"Part programs as pulses of x and z, a byte for each period of 250 µs.""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":[{"name":"iso","text":"Programs in ISO code.","values":{"input":"iso"}}],"#,
        r#""jobs":[{"name":"send","text":"Carries out a part program."}],"#,
        r#""profiles":[{"name":"pulse-lathe","features":["iso"]}],"#,
        status_texts!(),
        r#""needs":{"check_pass":true},"#,
        r#""state":{"saves":2,"accepts":[2]},"line":"40000 8N1""#,
    ),
};

/// Bytes a millisecond.
pub(crate) const PERIODS_A_MILLI: i64 = 4;

impl Settings {
    pub(crate) fn dwell_periods(&self) -> u32 {
        (self.dwell * PERIODS_A_MILLI) as u32
    }

    pub(crate) fn increments(&self) -> u32 {
        self.spindle_increments as u32
    }

    /// Bytes that wait in the queue at most.
    pub(crate) fn bytes_ahead(&self) -> u32 {
        (self.ahead * PERIODS_A_MILLI) as u32
    }

    /// The offset of a tool, in pulses of x and z.
    pub(crate) fn offset(&self, tool: u8) -> (i32, i32) {
        let (x, z) = match tool {
            1 => (self.x_offset_1, self.z_offset_1),
            2 => (self.x_offset_2, self.z_offset_2),
            3 => (self.x_offset_3, self.z_offset_3),
            4 => (self.x_offset_4, self.z_offset_4),
            5 => (self.x_offset_5, self.z_offset_5),
            6 => (self.x_offset_6, self.z_offset_6),
            7 => (self.x_offset_7, self.z_offset_7),
            _ => (0, 0),
        };
        (x as i32, z as i32)
    }
}
