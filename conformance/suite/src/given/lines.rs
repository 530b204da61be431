//! The trace's words for lines in those of the ABI, and the other way round.

use softplug_abi::{LineErrorKind, LineParameters, Micros, ModemLines};
use softplug_trace::{
    Assignment, BadKind, Entry, Given, Item, LineEvent, LineSettings, ModemLevels, ModemLine,
    Payload, SourceLine, Time, What, When,
};

/// The characters on the line of a trace.
///
/// ```
/// use softplug_abi::LineParameters;
/// use softplug_conformance::line_parameters;
/// use softplug_trace::FrontMatter;
///
/// let front = "id: a.b\ntitle: A\nprofile: a\nclauses: a.b\nlevel: must\nline: 9600 8N1\nsince: 1\n\
///              origin: hand-written\n";
/// let front = FrontMatter::parse(front)?;
/// assert_eq!(line_parameters(&front.line), LineParameters::new(9_600));
/// # Ok::<(), softplug_trace::ParseError>(())
/// ```
pub fn line_parameters(line: &LineSettings) -> LineParameters {
    LineParameters {
        baud: line.baud,
        data_bits: line.data_bits,
        parity: line.parity,
        stop_half_bits: line.stop_half_bits,
    }
}

/// The other way round, with the port's depth.
pub(crate) fn line_settings(line: LineParameters, depth: usize) -> LineSettings {
    LineSettings { depth: depth as u32, ..line.into() }
}

/// Something at one time.
pub(crate) fn entry(at: Micros, what: What) -> Entry {
    Entry { when: When::at(Time(at.0.max(0) as u64)), what, line: SourceLine::default() }
}

/// Names with values.
pub(crate) fn assignments(pairs: &[(String, String)]) -> Vec<Assignment> {
    let pair =
        |(name, value): &(String, String)| Assignment { name: name.clone(), value: value.clone() };
    pairs.iter().map(pair).collect()
}

/// The lines that a trace names, and those of them that are on.
///
/// ```
/// use softplug_abi::ModemLines;
/// use softplug_conformance::modem_lines;
/// use softplug_trace::{ModemLevels, ModemLine};
///
/// let levels = ModemLevels([(ModemLine::Cts, true), (ModemLine::Dsr, false)].into());
/// let named = ModemLines::CTS.union(ModemLines::DSR);
/// assert_eq!(modem_lines(&levels), (named, ModemLines::CTS));
/// ```
pub fn modem_lines(levels: &ModemLevels) -> (ModemLines, ModemLines) {
    let none = (ModemLines::default(), ModemLines::default());
    levels.0.iter().fold(none, |(named, on), (line, level)| {
        let line = match line {
            ModemLine::Cts => ModemLines::CTS,
            ModemLine::Dsr => ModemLines::DSR,
            ModemLine::Dcd => ModemLines::DCD,
            ModemLine::Ri => ModemLines::RI,
            ModemLine::Rts => ModemLines::RTS,
            ModemLine::Dtr => ModemLines::DTR,
        };
        (named.union(line), if *level { on.union(line) } else { on })
    })
}

/// The other way round.
pub(crate) fn modem_levels(named: ModemLines, on: ModemLines) -> ModemLevels {
    let lines = [
        (ModemLines::CTS, ModemLine::Cts),
        (ModemLines::DSR, ModemLine::Dsr),
        (ModemLines::DCD, ModemLine::Dcd),
        (ModemLines::RI, ModemLine::Ri),
    ];
    let named = lines.into_iter().filter(|(line, _)| named.contains(*line));
    ModemLevels(named.map(|(line, name)| (name, on.contains(line))).collect())
}

/// The other way round, for our own lines.
pub(crate) fn output_levels(named: ModemLines, on: ModemLines) -> ModemLevels {
    let lines = [(ModemLines::RTS, ModemLine::Rts), (ModemLines::DTR, ModemLine::Dtr)];
    let named = lines.into_iter().filter(|(line, _)| named.contains(*line));
    ModemLevels(named.map(|(line, name)| (name, on.contains(line))).collect())
}

/// What was wrong with a character that came damaged.
///
/// ```
/// use softplug_abi::LineErrorKind;
/// use softplug_conformance::{bad_kind, damage};
/// use softplug_trace::BadKind;
///
/// assert_eq!(bad_kind(BadKind::Parity), LineErrorKind::Parity);
/// assert_eq!(damage(LineErrorKind::Parity), Some(BadKind::Parity));
/// // What damages no character has a line of its own.
/// assert_eq!(damage(LineErrorKind::Break), None);
/// ```
pub fn bad_kind(kind: BadKind) -> LineErrorKind {
    match kind {
        BadKind::Parity => LineErrorKind::Parity,
        BadKind::Framing => LineErrorKind::Framing,
        BadKind::ParityOrFraming => LineErrorKind::ParityOrFraming,
    }
}

/// How a trace writes a damaged character beside it; `None`: nothing is wrong with one.
///
/// The example of [`bad_kind`] shows it.
pub fn damage(kind: LineErrorKind) -> Option<BadKind> {
    match kind {
        LineErrorKind::Parity => Some(BadKind::Parity),
        LineErrorKind::Framing => Some(BadKind::Framing),
        LineErrorKind::ParityOrFraming => Some(BadKind::ParityOrFraming),
        LineErrorKind::Overrun | LineErrorKind::Break => None,
    }
}

/// A damaged character, an overrun or a break.
pub(crate) fn damaged(kind: LineErrorKind, byte: Option<u8>, span: u32) -> Given {
    if let Some(kind) = damage(kind).filter(|_| span == 0) {
        return Given::Receive(Payload::new(byte.map(|byte| Item::Bad { kind, byte })));
    }
    Given::Line(LineEvent::Error { kind, byte, span })
}
