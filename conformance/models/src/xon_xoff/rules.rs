//! The settings of a session in the words of the page.

use crate::settings::Settings;
use softplug_abi::Micros;

/// What a byte means to whoever sends.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Control {
    /// Send, or go on.
    Xon,
    /// Stop before your next byte.
    Xoff,
}

/// What becomes of a control byte in a program.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum ControlInData {
    Refuse,
    Drop,
    Send,
}

/// All settings, under their names.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) xon: u8,
    pub(super) xoff: u8,
    pub(super) parity_mask: u8,
    pub(super) wait_for_xon: bool,
    /// `None`: a hold may last.
    pub(super) held_timeout: Option<Micros>,
    pub(super) feed_start: Vec<u8>,
    pub(super) feed_end: Vec<u8>,
    pub(super) abort_send: Vec<u8>,
    /// `None`: they are kept.
    pub(super) send_line_end: Option<&'static [u8]>,
    pub(super) send_drop: Vec<u8>,
    pub(super) control_in_data: ControlInData,
    /// `while_sending` is `ignore`.
    pub(super) ignores_echo: bool,
    pub(super) transparent: bool,
    pub(super) escape: u8,
    pub(super) escape_xor: u8,
    pub(super) speak: bool,
    pub(super) low_mark: u32,
    pub(super) high_mark: u32,
    /// `None`: XON is not repeated.
    pub(super) xon_repeat: Option<Micros>,
    /// 0: XOFF is not repeated.
    pub(super) xoff_repeat: usize,
    pub(super) xon_at_open: bool,
    /// `None`: they are kept.
    pub(super) receive_line_end: Option<&'static [u8]>,
    pub(super) receive_drop: Vec<u8>,
    pub(super) end_mark: Vec<u8>,
    pub(super) end_mark_count: usize,
    pub(super) end_quiet: Micros,
    /// `None`: silence alone ends nothing.
    pub(super) quiet_time: Option<Micros>,
    /// `on_line_error` is `fail`.
    pub(super) fails_on_line_error: bool,
}

impl Rules {
    /// Those of a session. `None` where the page says that they make no sense.
    pub(super) fn new(settings: &Settings) -> Option<Self> {
        let byte = |name, otherwise| settings.int(name, otherwise) as u8;
        let bytes = |name| settings.bytes(name, &[]);
        let is_on = |name, otherwise| settings.is_on(name, otherwise);
        let rules = Self {
            xon: byte("xon", 0x11),
            xoff: byte("xoff", 0x13),
            parity_mask: byte("parity_mask", 0xFF),
            wait_for_xon: is_on("wait_for_xon", false),
            held_timeout: span(settings.int("held_timeout", 0)),
            feed_start: bytes("feed_start"),
            feed_end: bytes("feed_end"),
            abort_send: bytes("abort_send"),
            send_line_end: line_end(settings.name("send_line_end", "keep")),
            send_drop: bytes("send_drop"),
            control_in_data: match settings.name("control_in_data", "refuse") {
                "drop" => ControlInData::Drop,
                "send" => ControlInData::Send,
                _ => ControlInData::Refuse,
            },
            ignores_echo: settings.name("while_sending", "deliver") == "ignore",
            transparent: is_on("transparent", false),
            escape: byte("escape", 0x10),
            escape_xor: byte("escape_xor", 0x40),
            speak: is_on("speak", true),
            low_mark: settings.int("low_mark", 1_024) as u32,
            high_mark: settings.int("high_mark", 2_048) as u32,
            // Who has no such settings repeats nothing: that is an optional feature.
            xon_repeat: span(settings.int("xon_repeat", 0)),
            xoff_repeat: settings.int("xoff_repeat", 0) as usize,
            xon_at_open: is_on("xon_at_open", false),
            receive_line_end: line_end(settings.name("receive_line_end", "keep")),
            receive_drop: bytes("receive_drop"),
            end_mark: bytes("end_mark"),
            end_mark_count: settings.int("end_mark_count", 1) as usize,
            end_quiet: Micros::from_millis(settings.int("end_quiet", 500)),
            quiet_time: span(settings.int("quiet_time", 3_000)),
            fails_on_line_error: settings.name("on_line_error", "fail") == "fail",
        };
        rules.make_sense().then_some(rules)
    }

    /// What the byte means, if it is a control byte.
    pub(super) fn control(&self, byte: u8) -> Option<Control> {
        let is = |control: u8| (byte ^ control) & self.parity_mask == 0;
        if is(self.xon) { Some(Control::Xon) } else { is(self.xoff).then_some(Control::Xoff) }
    }

    /// Whether transparent mode escapes the byte: control bytes with either parity
    /// bit, and the escape.
    pub(super) fn is_escaped(&self, byte: u8) -> bool {
        let controls = [self.xon, self.xoff].map(|control| control & 0x7F);
        controls.contains(&(byte & 0x7F)) || byte == self.escape
    }

    /// Others are refused before the link opens.
    fn make_sense(&self) -> bool {
        let are_alike = (self.xon ^ self.xoff) & self.parity_mask == 0;
        !are_alike && (!self.transparent || self.can_escape())
    }

    /// Whether transparent mode is possible.
    fn can_escape(&self) -> bool {
        // Of other masks the page does not say which bytes are escaped.
        let is_known_mask = [0x7F, 0xFF].contains(&self.parity_mask);
        let turned = |byte: u8| self.is_escaped(byte) && self.is_escaped(byte ^ self.escape_xor);
        is_known_mask && self.control(self.escape).is_none() && !(0..=255).any(turned)
    }
}

/// `None` for 0, which is never.
fn span(millis: i64) -> Option<Micros> {
    (millis > 0).then(|| Micros::from_millis(millis))
}

/// `None`: they are kept.
fn line_end(name: &str) -> Option<&'static [u8]> {
    match name {
        "lf" => Some(b"\n"),
        "cr" => Some(b"\r"),
        "crlf" => Some(b"\r\n"),
        "lfcrcr" => Some(b"\n\r\r"),
        _ => None,
    }
}
