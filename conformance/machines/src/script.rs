//! A partner that plays a script: it says each of its lines once the other side has said what
//! stands before it.
//!
//! ```
//! use softplug_abi::Micros;
//! use softplug_machines::script::{Line, Script};
//! use softplug_machines::{Partner, Signal};
//!
//! // STX is answered with DLE a millisecond later.
//! let answer = vec![Signal::Character(0x10)];
//! let line = Line { behind: 1, gap: Micros(1_000), apart: Micros(0), signals: answer };
//! let mut script = Script::new(vec![0x02, b'G'], vec![line]);
//! assert_eq!(script.next_event(), None);
//! script.receive(Micros(500), 0x02);
//! assert_eq!(script.next_event(), Some(Micros(1_500)));
//! assert_eq!(script.poll_signal(Micros(1_500)), Some(Signal::Character(0x10)));
//! script.receive(Micros(1_600), b'X');
//! assert_eq!(script.report().differs, Some(1));
//! ```

use std::collections::VecDeque;

use softplug_abi::Micros;

use crate::{Partner, Signal};

/// What the partner says at one time.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Line {
    /// Characters of the other side that must have come before.
    pub behind: usize,
    /// How long behind the latest of what was before, from either side.
    pub gap: Micros,
    /// How far its characters are apart.
    pub apart: Micros,
    /// The characters.
    pub signals: Vec<Signal>,
}

/// How far a script has come.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Report {
    /// Characters of the other side that were expected, and came so.
    pub came: usize,
    /// The place of the first character that is another one, or one too many, counted from 0. From
    /// there on the partner is silent.
    pub differs: Option<usize>,
    /// What came in that place.
    pub other: Option<u8>,
    /// Lines that were said.
    pub said: usize,
    /// Whether all was said and all has come.
    pub is_over: bool,
}

/// The partner.
#[derive(Debug)]
pub struct Script {
    expected: Vec<u8>,
    lines: VecDeque<Line>,
    /// The line that is being said.
    saying: VecDeque<(Micros, Signal)>,
    /// When the latest character came or went.
    latest: Micros,
    has_begun: bool,
    report: Report,
}

impl Script {
    /// A partner that expects these characters, and says these lines between them.
    pub fn new(expected: Vec<u8>, lines: Vec<Line>) -> Self {
        let is_over = expected.is_empty() && lines.is_empty();
        Self {
            expected,
            lines: lines.into(),
            saying: VecDeque::new(),
            latest: Micros::ZERO,
            has_begun: false,
            report: Report { is_over, ..Report::default() },
        }
    }

    /// How far it has come.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The script begins now: before, nobody was there. What comes begins it as well.
    pub fn begin(&mut self, now: Micros) {
        if !self.has_begun {
            (self.has_begun, self.latest) = (true, now);
        }
    }

    /// When the next line is due, if all has come that is before it.
    fn due(&self) -> Option<Micros> {
        let line = self.lines.front()?;
        let may_begin = self.has_begun || line.behind > 0;
        let is_next = may_begin && self.report.came >= line.behind && self.saying.is_empty();
        (is_next && self.report.differs.is_none()).then(|| self.latest + line.gap)
    }

    fn look_whether_over(&mut self) {
        self.report.is_over = self.report.differs.is_none()
            && self.report.came == self.expected.len()
            && self.lines.is_empty()
            && self.saying.is_empty();
    }
}

impl Partner for Script {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.begin(now);
        if self.report.differs.is_some() {
            return;
        }
        if self.expected.get(self.report.came) == Some(&byte) {
            self.report.came += 1;
            self.latest = self.latest.max(now);
        } else {
            self.report.differs = Some(self.report.came);
            self.report.other = Some(byte);
        }
        self.look_whether_over();
    }

    fn next_event(&self) -> Option<Micros> {
        self.saying.front().map(|(at, _)| *at).or_else(|| self.due())
    }

    fn advance(&mut self, now: Micros) {
        if let Some(due) = self.due().filter(|due| *due <= now)
            && let Some(line) = self.lines.pop_front()
        {
            let mut at = due;
            for signal in line.signals {
                self.saying.push_back((at, signal));
                at = at + line.apart;
            }
            self.report.said += 1;
        }
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        match self.poll_signal(now)? {
            Signal::Character(byte) => Some(byte),
            Signal::LineError { byte, .. } => byte,
            Signal::ModemLines { .. } => None,
        }
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.advance(now);
        let (at, signal) = self.saying.pop_front_if(|(at, _)| *at <= now)?;
        self.latest = self.latest.max(at);
        self.look_whether_over();
        Some(signal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(behind: usize, gap: i64, text: &str) -> Line {
        let signals = text.bytes().map(Signal::Character).collect();
        Line { behind, gap: Micros(gap), apart: Micros(10), signals }
    }

    fn said(script: &mut Script, until: i64) -> String {
        let mut text = String::new();
        while let Some(at) = script.next_event().filter(|at| at.0 <= until) {
            script.advance(at);
            while let Some(byte) = script.poll_transmit(at) {
                text.push(char::from(byte));
            }
        }
        text
    }

    #[test]
    fn a_line_waits_for_what_is_before_it_and_no_longer() {
        let mut script = Script::new(b"abc".to_vec(), vec![line(0, 5, "1"), line(2, 100, "23")]);
        assert_eq!(said(&mut script, 1_000), "", "nobody is there yet");
        script.begin(Micros(1_000));
        assert_eq!(said(&mut script, 2_000), "1");
        script.receive(Micros(3_000), b'a');
        assert_eq!(said(&mut script, 5_000), "");
        script.receive(Micros(5_000), b'b');
        script.receive(Micros(5_050), b'c');
        assert_eq!(script.next_event(), Some(Micros(5_150)));
        assert!(!script.report().is_over);
        assert_eq!(said(&mut script, 6_000), "23");
        assert!(script.report().is_over);
    }

    #[test]
    fn one_character_too_many_is_a_difference_and_ends_it() {
        let mut script = Script::new(b"a".to_vec(), vec![line(1, 0, "x")]);
        script.receive(Micros(1), b'a');
        assert_eq!(said(&mut script, 10), "x");
        assert!(script.report().is_over);
        script.receive(Micros(20), b'b');
        let Report { differs, other, is_over, .. } = script.report();
        assert_eq!((*differs, *other, *is_over), (Some(1), Some(b'b'), false));
    }
}
