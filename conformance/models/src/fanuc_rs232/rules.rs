//! The settings of a session in the words of the page.

use crate::settings::Settings;
use softplug_abi::Micros;

/// A code of the page's table.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Code {
    Iso,
    Eia,
}

/// Who makes ISO's parity.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Parity {
    /// The port.
    Uart,
    /// We do.
    Software,
    /// Nobody.
    None,
}

/// What becomes of a character outside the code.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Unsupported {
    Refuse,
    Space,
    Drop,
}

/// What becomes of N numbers.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum BlockNumbers {
    Keep,
    Strip,
    Renumber,
}

/// How the control's output is held.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum OutputFlow {
    Dc3,
    Rts,
    None,
}

/// All settings of the reader and the punch, under their names.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) code: Code,
    /// `None`: it is found out.
    pub(super) receive_code: Option<Code>,
    pub(super) parity: Parity,
    pub(super) plain_codes: bool,
    pub(super) eob: &'static [u8],
    pub(super) line_end: &'static [u8],
    pub(super) leader: usize,
    pub(super) trailer: usize,
    pub(super) tv_pad: bool,
    pub(super) tv_check: bool,
    pub(super) tv_cr: bool,
    pub(super) tv_comments: bool,
    pub(super) upper: bool,
    pub(super) unsupported: Unsupported,
    pub(super) replace: Vec<(u8, u8)>,
    pub(super) ascii: bool,
    pub(super) eia_codes: Vec<(u8, u8)>,
    pub(super) percent: bool,
    /// `after_end` is `drop`.
    pub(super) drops_after_end: bool,
    pub(super) block_numbers: BlockNumbers,
    pub(super) number_step: u64,
    /// `None`: a job may wait.
    pub(super) dc1_timeout: Option<Micros>,
    /// `None`: a hold may last.
    pub(super) held_timeout: Option<Micros>,
    /// `None`: the final DC3 is not awaited.
    pub(super) end_wait: Option<Micros>,
    pub(super) watch_dsr: bool,
    pub(super) output_flow: OutputFlow,
    /// DC1 or DC2.
    pub(super) resume_code: u8,
    pub(super) need_dc2: bool,
    pub(super) answer_dc2: bool,
    pub(super) end_quiet: Micros,
    pub(super) after_dc4: Micros,
    /// `None`: silence fails nothing.
    pub(super) quiet_time: Option<Micros>,
    /// `programs` is `split`.
    pub(super) splits_programs: bool,
    /// `on_line_error` is `fail`.
    pub(super) fails_on_line_error: bool,
    pub(super) request_program: u64,
    pub(super) request_pattern: String,
}

impl Rules {
    /// Those of a session. `None` where the page says that they make no sense, and
    /// for the remote buffer with packets.
    pub(super) fn new(settings: &Settings) -> Option<Self> {
        let is_on = |name, otherwise| settings.is_on(name, otherwise);
        let int = |name, otherwise| settings.int(name, otherwise);
        let is = |name, otherwise, value| settings.name(name, otherwise) == value;
        // Protocol A has a model of its own.
        if is("mode", "reader", "remote-a") {
            return None;
        }
        let request_pattern = settings.name("request_pattern", "(SEND *)").to_owned();
        if !request_pattern.is_empty() && request_pattern.matches('*').count() != 1 {
            return None;
        }
        Some(Self {
            code: if is("code", "iso", "eia") { Code::Eia } else { Code::Iso },
            receive_code: match settings.name("receive_code", "auto") {
                "iso" => Some(Code::Iso),
                "eia" => Some(Code::Eia),
                _ => None,
            },
            parity: match settings.name("parity", "uart") {
                "software" => Parity::Software,
                "none" => Parity::None,
                _ => Parity::Uart,
            },
            plain_codes: is_on("plain_codes", false),
            eob: match settings.name("eob", "lf") {
                "crlf" => b"\r\n",
                "lfcrcr" => b"\n\r\r",
                "lfcr" => b"\n\r",
                "cr" => b"\r",
                _ => b"\n",
            },
            line_end: if is("line_end", "lf", "crlf") { b"\r\n" } else { b"\n" },
            leader: int("leader", 0) as usize,
            trailer: int("trailer", 0) as usize,
            tv_pad: is_on("tv_pad", false),
            tv_check: is_on("tv_check", false),
            tv_cr: is_on("tv_cr", true),
            tv_comments: is_on("tv_comments", true),
            upper: is_on("upper", true),
            unsupported: match settings.name("unsupported", "refuse") {
                "space" => Unsupported::Space,
                "drop" => Unsupported::Drop,
                _ => Unsupported::Refuse,
            },
            replace: pairs(&settings.bytes("replace", &[]))?,
            ascii: is_on("ascii", false),
            eia_codes: pairs(&settings.bytes("eia_codes", &[]))?,
            percent: is_on("percent", true),
            drops_after_end: is("after_end", "refuse", "drop"),
            block_numbers: match settings.name("block_numbers", "keep") {
                "strip" => BlockNumbers::Strip,
                "renumber" => BlockNumbers::Renumber,
                _ => BlockNumbers::Keep,
            },
            number_step: int("number_step", 10) as u64,
            dc1_timeout: span(int("dc1_timeout", 0)),
            held_timeout: span(int("held_timeout", 0)),
            end_wait: span(int("end_wait", 0)),
            watch_dsr: is_on("watch_dsr", false),
            output_flow: match settings.name("output_flow", "dc3") {
                "rts" => OutputFlow::Rts,
                "none" => OutputFlow::None,
                _ => OutputFlow::Dc3,
            },
            resume_code: if is("resume_code", "dc1", "dc2") { 0x12 } else { 0x11 },
            need_dc2: is_on("need_dc2", true),
            answer_dc2: is_on("answer_dc2", false),
            end_quiet: Micros::from_millis(int("end_quiet", 500)),
            after_dc4: Micros::from_millis(int("after_dc4", 200)),
            quiet_time: span(int("quiet_time", 10_000)),
            splits_programs: is("programs", "keep", "split"),
            fails_on_line_error: is("on_line_error", "fail", "fail"),
            request_program: int("request_program", 9_999) as u64,
            request_pattern,
        })
    }
}

/// `None` for 0, which is never.
fn span(millis: i64) -> Option<Micros> {
    (millis > 0).then(|| Micros::from_millis(millis))
}

/// `None` for an odd number of bytes.
fn pairs(bytes: &[u8]) -> Option<Vec<(u8, u8)>> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|[from, to]| (*from, *to)).collect())
}
