//! What the tap saw, as lines of a trace: as the partner on one side saw it.
//!
//! A port that keeps a rate says when it has read a character, or is given one;
//! when it was on the wire follows from the rate. Lines wait here until none can
//! come any more that began earlier.

use std::collections::VecDeque;

use softplug_abi::{LineErrorKind, LineParameters, Micros, ModemLines};
use softplug_conformance::damage;
use softplug_live::Input;
use softplug_live::tap::{Event, Side};
use softplug_trace::{BadKind, LineEvent, ModemLevels, ModemLine};

/// Characters that one read of a port with a rate can bring.
const READ: u64 = 64;
/// Characters of a line of the trace at the most.
const LINE: usize = 4_096;
/// A break as it is written; how long it was nobody measured.
const BREAK_MICROS: u32 = 250_000;

/// A character, and what is wrong with it.
pub(super) type Character = (u8, Option<BadKind>);

/// Something that happened, as the plug-in's side saw it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Happening {
    /// Reached the side, all at once.
    Given(Vec<Character>),
    /// Reached the side at the line rate; the time is the end of the first.
    Burst(Vec<Character>),
    /// The side sent it; the time is the start of the first.
    Sent(Vec<u8>),
    /// The side sent a break.
    SentBreak(u32),
    /// The side set its lines.
    SetLines(ModemLevels),
    /// The line or the port.
    Line(LineEvent),
    /// For people.
    Remark(String),
}

/// Orders what the tap tells.
#[derive(Debug)]
pub(super) struct Story {
    side: Side,
    line: LineParameters,
    /// Whether the side's port keeps the rate.
    has_rate: bool,
    /// When the side's receiver and sender are free again.
    receiver_free: Micros,
    sender_free: Micros,
    lines: [Option<ModemLines>; 2],
    waiting: VecDeque<(Micros, Happening)>,
}

impl Story {
    pub(super) fn new(side: Side, line: LineParameters, has_rate: bool) -> Self {
        let (receiver_free, sender_free) = (Micros::ZERO, Micros::ZERO);
        let has_rate = has_rate && line.baud > 0;
        let waiting = VecDeque::new();
        Self { side, line, has_rate, receiver_free, sender_free, lines: [None; 2], waiting }
    }

    /// The lines of the partner on `from` at the start.
    pub(super) fn lines_at_start(&mut self, from: Side, on: ModemLines) {
        self.lines[usize::from(from != self.side)] = Some(on);
    }

    /// Takes an event in.
    pub(super) fn tell(&mut self, now: Micros, event: &Event<'_>) {
        match event {
            Event::Passed { to, what } if *to == self.side => self.given(now, what),
            Event::Heard { from, what } if *from == self.side => self.sent(now, what),
            Event::Lines { from, on, .. } => self.lines(now, *from, *on),
            Event::Cannot { side, what } => {
                self.put(
                    now,
                    Happening::Remark(format!(" The port on side {side} cannot {what}.")),
                );
            }
            Event::Passed { .. } | Event::Heard { .. } => {}
        }
    }

    /// Puts something in at its place.
    pub(super) fn put(&mut self, at: Micros, what: Happening) {
        let place = self.waiting.partition_point(|(other, _)| *other <= at);
        self.waiting.insert(place, (at, what));
    }

    /// The next happening to which nothing earlier can be added any more.
    pub(super) fn next(&mut self, now: Micros) -> Option<(Micros, Happening)> {
        let sure = if self.has_rate { now - self.line.characters(2 * READ) } else { now };
        self.waiting.pop_front_if(|(at, _)| *at < sure)
    }

    /// Everything else, at the end.
    pub(super) fn rest(&mut self) -> impl Iterator<Item = (Micros, Happening)> + use<> {
        std::mem::take(&mut self.waiting).into_iter()
    }

    fn given(&mut self, now: Micros, what: &Input<'_>) {
        match *what {
            Input::Bytes(bytes) => {
                self.given_characters(now, bytes.iter().map(|byte| (*byte, None)).collect());
            }
            Input::LineError { kind, byte: Some(byte), span: 0 } if damage(kind).is_some() => {
                self.given_characters(now, vec![(byte, damage(kind))]);
            }
            Input::LineError { kind, byte, span } => {
                let at = now.max(self.receiver_free);
                self.put(at, Happening::Line(LineEvent::Error { kind, byte, span }));
            }
        }
    }

    fn given_characters(&mut self, now: Micros, characters: Vec<Character>) {
        if !self.has_rate {
            if let Some((at, Happening::Given(before))) = self.waiting.back_mut()
                && *at == now
                && before.len() + characters.len() <= LINE
            {
                before.extend(characters);
                return;
            }
            self.put(now, Happening::Given(characters));
            return;
        }
        let start = now.max(self.receiver_free);
        self.receiver_free = start + self.line.characters(characters.len() as u64);
        // A run that goes on where the last one ended is the same burst.
        let last = self.waiting.iter_mut().rev().find_map(|(at, what)| match what {
            Happening::Burst(before) => Some((*at, before)),
            _ => None,
        });
        if let Some((at, before)) = last {
            let begun = at - self.line.characters(1);
            let end = begun + self.line.characters(before.len() as u64);
            if end == start && before.len() + characters.len() <= LINE {
                before.extend(characters);
                return;
            }
        }
        self.put(start + self.line.characters(1), Happening::Burst(characters));
    }

    fn sent(&mut self, now: Micros, what: &Input<'_>) {
        let (bytes, remark) = match what {
            Input::Bytes(bytes) => (bytes.to_vec(), None),
            Input::LineError { kind, byte: Some(byte), .. } => {
                let name = kind.name();
                (vec![*byte], Some(format!(" The next byte came with a line error: {name}.")))
            }
            Input::LineError { kind: LineErrorKind::Break, .. } => {
                self.put(
                    now,
                    Happening::Remark(" How long the break was is not known.".to_owned()),
                );
                self.put(now, Happening::SentBreak(BREAK_MICROS));
                return;
            }
            Input::LineError { kind, .. } => {
                let name = kind.name();
                self.put(now, Happening::Remark(format!(" The port reports: {name}.")));
                return;
            }
        };
        if let Some(remark) = remark {
            self.put(now, Happening::Remark(remark));
        }
        self.sent_bytes(now, bytes);
    }

    fn sent_bytes(&mut self, now: Micros, bytes: Vec<u8>) {
        if !self.has_rate {
            self.put(now, Happening::Sent(bytes));
            return;
        }
        let length = self.line.characters(bytes.len() as u64);
        let start = (now - length).max(self.sender_free);
        // A port tells of characters in lots: a gap of less than one is none.
        let last = self.waiting.iter_mut().rev().find_map(|(at, what)| match what {
            Happening::Sent(before) => Some((*at, before)),
            _ => None,
        });
        if let Some((at, before)) = last
            && start - self.sender_free < self.line.characters(1)
            && before.len() + bytes.len() <= LINE
        {
            before.extend(bytes);
            self.sender_free = at + self.line.characters(before.len() as u64);
            return;
        }
        self.sender_free = start + length;
        self.put(start, Happening::Sent(bytes));
    }

    fn lines(&mut self, now: Micros, from: Side, on: ModemLines) {
        let seen = &mut self.lines[usize::from(from != self.side)];
        let before = seen.replace(on);
        let changed = before.map_or(ModemLines::ALL.0, |before| before.0 ^ on.0);
        let what = if from == self.side {
            Happening::SetLines(levels(&OUTPUTS, ModemLines(changed), on))
        } else {
            Happening::Line(LineEvent::Modem(levels(&INPUTS, ModemLines(changed), on)))
        };
        let is_empty = matches!(
            &what,
            Happening::SetLines(levels) | Happening::Line(LineEvent::Modem(levels))
                if levels.0.is_empty()
        );
        if !is_empty {
            self.put(now, what);
        }
    }
}

/// What a side is given: lines cross on their way through the tap and again
/// into the partner's port, and so keep their names.
const INPUTS: [(ModemLines, ModemLine); 4] = [
    (ModemLines::CTS, ModemLine::Cts),
    (ModemLines::DSR, ModemLine::Dsr),
    (ModemLines::DCD, ModemLine::Dcd),
    (ModemLines::RI, ModemLine::Ri),
];
/// What a side sets, as our port sees it.
const OUTPUTS: [(ModemLines, ModemLine); 2] =
    [(ModemLines::CTS, ModemLine::Rts), (ModemLines::DSR, ModemLine::Dtr)];

/// The lines that a side is given at the start.
pub(super) fn inputs(on: ModemLines) -> ModemLevels {
    levels(&INPUTS, ModemLines::ALL, on)
}

fn levels(names: &[(ModemLines, ModemLine)], which: ModemLines, on: ModemLines) -> ModemLevels {
    let named = names.iter().filter(|(line, _)| which.contains(*line));
    ModemLevels(named.map(|(line, name)| (*name, on.contains(*line))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(has_rate: bool, events: &[(i64, Event<'_>)]) -> Vec<(i64, Happening)> {
        let mut story = Story::new(Side::A, LineParameters::new(9_600), has_rate);
        let mut all = Vec::new();
        for (now, event) in events {
            story.tell(Micros(*now), event);
            while let Some(next) = story.next(Micros(*now)) {
                all.push(next);
            }
        }
        all.extend(story.rest());
        assert!(all.is_sorted_by_key(|(at, _)| *at), "{all:?}");
        all.into_iter().map(|(at, what)| (at.0, what)).collect()
    }

    fn passed(bytes: &[u8]) -> Event<'_> {
        Event::Passed { to: Side::A, what: Input::Bytes(bytes) }
    }

    fn heard(bytes: &[u8]) -> Event<'_> {
        Event::Heard { from: Side::A, what: Input::Bytes(bytes) }
    }

    fn good(bytes: &[u8]) -> Vec<Character> {
        bytes.iter().map(|byte| (*byte, None)).collect()
    }

    #[test]
    fn without_a_rate_times_are_those_of_the_tap() {
        let other = Event::Heard { from: Side::B, what: Input::Bytes(b"AB") };
        let story =
            told(false, &[(5, other), (10, passed(b"A")), (10, passed(b"B")), (12, heard(b"CD"))]);
        assert_eq!(
            story,
            [(10, Happening::Given(good(b"AB"))), (12, Happening::Sent(b"CD".to_vec()))]
        );
    }

    #[test]
    fn with_a_rate_times_are_those_of_the_wire() {
        // Characters take 1,041.67 µs.
        let events = [
            (100_000, passed(b"A")),
            (100_300, passed(b"BC")),
            (110_000, heard(b"x")),
            (111_500, heard(b"yz")),
            (200_000, heard(b"!")),
        ];
        let burst = Happening::Burst(good(b"ABC"));
        let sent = |bytes: &[u8]| Happening::Sent(bytes.to_vec());
        assert_eq!(
            told(true, &events),
            [(101_042, burst), (108_958, sent(b"xyz")), (198_958, sent(b"!"))]
        );
    }

    #[test]
    fn damage_breaks_and_lines_keep_their_place() {
        let error = |kind, byte| Input::LineError { kind, byte, span: 0 };
        let parity = || error(LineErrorKind::Parity, Some(b'1'));
        let lines = |from, on| Event::Lines { from, known: ModemLines::CTS, on };
        let events = [
            (1, Event::Passed { to: Side::A, what: parity() }),
            (2, Event::Passed { to: Side::A, what: error(LineErrorKind::Break, None) }),
            (3, Event::Heard { from: Side::A, what: error(LineErrorKind::Break, None) }),
            (4, lines(Side::B, ModemLines::CTS)),
            (5, lines(Side::B, ModemLines::default())),
            (6, lines(Side::A, ModemLines::CTS)),
        ];
        let story = told(false, &events);
        let kinds: Vec<_> = story.iter().map(|(at, _)| *at).collect();
        assert_eq!(kinds, [1, 2, 3, 3, 4, 5, 6]);
        assert_eq!(story[0].1, Happening::Given(vec![(b'1', Some(BadKind::Parity))]));
        assert_eq!(story[3].1, Happening::SentBreak(BREAK_MICROS));
        let off = ModemLevels([(ModemLine::Cts, false)].into());
        assert_eq!(story[5].1, Happening::Line(LineEvent::Modem(off)));
        let Happening::SetLines(set) = &story[6].1 else { panic!("{story:?}") };
        assert_eq!(set.0.get(&ModemLine::Rts), Some(&true));
    }
}
