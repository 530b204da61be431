//! Captures of a serial line, LINKTYPE_RTAC_SERIAL in pcapng.

use softplug_abi::LineErrorKind;

use super::Source;
use super::capture::{
    self, BYTE_ORDER, ENHANCED_PACKET, INTERFACE, OPTION_FLAGS, OPTION_RESOLUTION, SECTION, packets,
};
use super::error::{ImportError, ImportFault, Place};
use super::note::{Left, Notes};
use super::pace::Pace;
use super::rtac::{self, Event as Kind, Levels};
use super::timeline::{Event, Timeline, read as characters};
use crate::model::{
    BadKind, Expected, Given, Item, LineEvent, ModemLevels, ModemLine, Payload, What,
};

/// Bytes of a packet that is written, at most: well below what readers take.
const LONGEST: usize = 32 << 10;
/// LINKTYPE_USER0 to 15: plain bytes, as `text2pcap -l 147` makes them.
const PLAIN: std::ops::RangeInclusive<u32> = 147..=162;

/// Times are moments since 1970, so that zero of the trace is the first of January.
pub(super) fn write(timeline: &Timeline, notes: &mut Notes) -> Vec<u8> {
    let mut levels = start(timeline, notes);
    // The first is there so that readers know the modem lines at the start.
    let mut outline = Outline { packets: vec![Packet::status(0, ModemLevels::default())] };
    for event in &timeline.events {
        outline.event(event, timeline.pace, notes);
    }
    outline.packets.sort_by_key(|packet| packet.at);

    let mut file = head();
    for packet in outline.packets {
        levels = levels.with(&packet.changed);
        packet.append(levels, &mut file);
    }
    file
}

/// The modem lines at the start.
fn start(timeline: &Timeline, notes: &mut Notes) -> Levels {
    let mut known = timeline.modem.clone();
    for event in &timeline.events {
        let (What::Expected(Expected::SetLines(levels))
        | What::Given(Given::Line(LineEvent::Modem(levels)))) = &event.what
        else {
            continue;
        };
        for (line, on) in &levels.0 {
            if !known.0.contains_key(line) {
                notes.add(Left::UnknownModemLines, event.place);
                known.0.insert(*line, !on);
            }
        }
    }
    Levels::default().with(&known)
}

/// The blocks before the packets.
fn head() -> Vec<u8> {
    let mut file = Vec::new();
    let mut body = BYTE_ORDER.to_le_bytes().to_vec();
    // Version 1.0, a section of unknown length.
    body.extend([1, 0, 0, 0]);
    body.extend(u64::MAX.to_le_bytes());
    block(SECTION, &body, &mut file);

    let mut body = (rtac::LINK as u16).to_le_bytes().to_vec();
    // No limit to the length of packets.
    body.extend([0; 6]);
    option(&mut body, OPTION_RESOLUTION, &[6]);
    body.extend([0; 4]);
    block(INTERFACE, &body, &mut file);
    file
}

fn block(kind: u32, body: &[u8], file: &mut Vec<u8>) {
    let length = (12 + body.len() as u32).to_le_bytes();
    file.extend(kind.to_le_bytes());
    file.extend(length);
    file.extend(body);
    file.extend(length);
}

/// A packet to write.
struct Packet {
    at: i64,
    kind: Kind,
    received: Option<bool>,
    /// Modem lines that change with it.
    changed: ModemLevels,
    bytes: Vec<u8>,
}

impl Packet {
    fn status(at: i64, changed: ModemLevels) -> Self {
        Self { at, kind: Kind::StatusChange, received: None, changed, bytes: Vec::new() }
    }

    fn append(&self, levels: Levels, file: &mut Vec<u8>) {
        let at = self.at as u64;
        let length = (rtac::HEADER + self.bytes.len()) as u32;
        let mut body = vec![0; 4];
        body.extend(((at >> 32) as u32).to_le_bytes());
        body.extend((at as u32).to_le_bytes());
        body.extend(length.to_le_bytes());
        body.extend(length.to_le_bytes());
        body.extend(rtac::header(at, self.kind, levels));
        body.extend(&self.bytes);
        body.resize(body.len().next_multiple_of(4), 0);
        if let Some(received) = self.received {
            let direction: u32 = if received { 1 } else { 2 };
            option(&mut body, OPTION_FLAGS, &direction.to_le_bytes());
            body.extend([0; 4]);
        }
        block(ENHANCED_PACKET, &body, file);
    }
}

/// The packets of a capture, not yet sorted.
struct Outline {
    packets: Vec<Packet>,
}

impl Outline {
    fn packet(&mut self, at: i64, kind: Kind, received: bool, bytes: &[u8]) {
        let (received, changed) = (Some(received), ModemLevels::default());
        self.packets.push(Packet { at, kind, received, changed, bytes: bytes.to_vec() });
    }

    fn event(&mut self, event: &Event, pace: Pace, notes: &mut Notes) {
        let at = event.at;
        match &event.what {
            What::Given(Given::Receive(payload)) => {
                for item in payload.items() {
                    self.received(at, item, event.place, notes);
                }
            }
            What::Given(Given::Burst(payload)) => self.burst(event, payload, pace, notes),
            What::Expected(Expected::Send(payload)) => {
                let bytes: Vec<u8> = characters(payload).map(|(byte, _)| byte).collect();
                let longest = pace.cut(LONGEST);
                for (place, bytes) in bytes.chunks(longest).enumerate() {
                    let at = at + pace.of_characters(place * longest);
                    self.packet(at, Kind::SendStart, false, bytes);
                }
            }
            What::Expected(Expected::SetLines(levels))
            | What::Given(Given::Line(LineEvent::Modem(levels))) => {
                self.packets.push(Packet::status(at, levels.clone()));
            }
            What::Expected(Expected::SendBreak(_)) => {
                notes.add(Left::BreakLength, event.place);
                self.packet(at, Kind::Break, false, &[]);
            }
            What::Given(Given::Line(LineEvent::Error { kind, byte, span })) => {
                self.line_error(event, *kind, *byte, *span, notes);
            }
            what => notes.unheld(what, event.place),
        }
    }

    /// Characters of one moment.
    fn received(&mut self, at: i64, item: &Item, place: u32, notes: &mut Notes) {
        match item {
            Item::Bad { kind, byte } => {
                let kind = match kind {
                    BadKind::Parity => Kind::Parity,
                    BadKind::Framing => Kind::Framing,
                    BadKind::ParityOrFraming => {
                        notes.add(Left::EitherError, place);
                        Kind::Framing
                    }
                };
                self.packet(at, kind, true, &[*byte]);
            }
            Item::Hex(bytes) | Item::Text(bytes) => {
                for bytes in bytes.chunks(LONGEST) {
                    self.packet(at, Kind::ReceiveEnd, true, bytes);
                }
            }
            Item::File(_) | Item::Generated(_) => {}
        }
    }

    /// Characters that follow each other: as packets from the start bit of their
    /// first on, or, where that would be before zero or one is damaged, singly.
    fn burst(&mut self, event: &Event, payload: &Payload, pace: Pace, notes: &mut Notes) {
        let start = event.at - pace.of_characters(1);
        match payload.items() {
            [Item::Hex(bytes)] if start >= 0 => {
                let longest = pace.cut(LONGEST);
                for (place, bytes) in bytes.chunks(longest).enumerate() {
                    let at = start + pace.of_characters(place * longest);
                    self.packet(at, Kind::ReceiveStart, true, bytes);
                }
            }
            _ => {
                for character in event.characters(pace) {
                    let byte = character.byte;
                    let item = match character.damage {
                        Some(kind) => Item::Bad { kind, byte },
                        None => Item::Hex(vec![byte]),
                    };
                    self.received(character.at, &item, event.place, notes);
                }
            }
        }
    }

    fn line_error(
        &mut self,
        event: &Event,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
        notes: &mut Notes,
    ) {
        let (kind, holds_byte) = match kind {
            LineErrorKind::Parity => (Kind::Parity, true),
            LineErrorKind::Framing => (Kind::Framing, true),
            LineErrorKind::ParityOrFraming => {
                notes.add(Left::EitherError, event.place);
                (Kind::Framing, true)
            }
            LineErrorKind::Overrun => (Kind::Overflow, false),
            LineErrorKind::Break => (Kind::Break, false),
        };
        // With a span the byte is one of those that were received: a second time it
        // must not be there.
        let bytes: Vec<u8> = byte.into_iter().filter(|_| holds_byte && span == 0).collect();
        if span > 0 || bytes.len() != byte.iter().count() {
            notes.add(Left::ErrorPlace, event.place);
        }
        self.packet(event.at, kind, true, &bytes);
    }
}

fn option(body: &mut Vec<u8>, code: u16, value: &[u8]) {
    body.extend(code.to_le_bytes());
    body.extend((value.len() as u16).to_le_bytes());
    body.extend(value);
    body.resize(body.len().next_multiple_of(4), 0);
}

pub(super) fn read(
    source: Source<'_>,
    timeline: &mut Timeline,
    notes: &mut Notes,
) -> Result<(), ImportError> {
    let mut line = Lines { file: source.name, interface: None, levels: None, used: 0 };
    let mut first = None;
    packets(source, notes, |packet, notes| {
        let serial = packet.link == rtac::LINK;
        if !serial && !PLAIN.contains(&packet.link) {
            notes.add(Left::OtherPackets, packet.number);
            return Ok(());
        }
        if *line.interface.get_or_insert(packet.interface) != packet.interface {
            return Err(line.fault(&packet, ImportFault::SecondLine));
        }
        if serial {
            let levels = line.serial(&packet, timeline, notes)?;
            first.get_or_insert(levels);
            return Ok(());
        }
        let payload = Payload::hex(packet.bytes);
        let what = match packet.received {
            Some(true) => What::Given(Given::Receive(payload)),
            Some(false) => What::Expected(Expected::Send(payload)),
            None => return Err(line.fault(&packet, ImportFault::NoDirection)),
        };
        timeline.events.push(Event { at: packet.at, what, place: packet.number });
        Ok(())
    })?;
    // A line that is never on is most likely not connected.
    timeline.modem = first.unwrap_or_default().select(ModemLine::INPUTS, line.used);
    Ok(())
}

/// The serial line of a capture.
struct Lines<'a> {
    file: &'a str,
    /// The interface that it is.
    interface: Option<usize>,
    /// Modem lines in the packet before.
    levels: Option<Levels>,
    /// Modem lines that are on at least once.
    used: u8,
}

impl Lines<'_> {
    fn fault(&self, packet: &capture::Packet<'_>, fault: ImportFault) -> ImportError {
        ImportError { file: self.file.to_owned(), place: Place::Byte(packet.offset), fault }
    }

    /// What a packet of the line says; its modem lines.
    fn serial(
        &mut self,
        packet: &capture::Packet<'_>,
        timeline: &mut Timeline,
        notes: &mut Notes,
    ) -> Result<Levels, ImportError> {
        let Some((kind, levels, bytes)) = rtac::parse(packet.bytes) else {
            let fault = ImportFault::CutShort("the header of an event, which has twelve bytes");
            return Err(self.fault(packet, fault));
        };
        let place = packet.number;
        let mut add = |at: i64, what: What| timeline.events.push(Event { at, what, place });
        let before = self.levels.replace(levels).unwrap_or(levels);
        self.used |= levels.0;
        let changed = levels.changed_from(before, ModemLine::INPUTS);
        if changed != ModemLevels::default() {
            add(packet.at, What::Given(Given::Line(LineEvent::Modem(changed))));
        }
        let changed = levels.changed_from(before, ModemLine::OUTPUTS);
        if changed != ModemLevels::default() {
            add(packet.at, What::Expected(Expected::SetLines(changed)));
        }
        let Some(kind) = kind else {
            notes.add(Left::UnknownEvents, place);
            return Ok(levels);
        };
        let error =
            |kind, span| What::Given(Given::Line(LineEvent::Error { kind, byte: None, span }));
        let payload = Payload::hex(bytes);
        let mut stray = false;
        match kind {
            Kind::SendStart if !bytes.is_empty() => {
                add(packet.at, What::Expected(Expected::Send(payload)));
            }
            Kind::SendEnd if !bytes.is_empty() => {
                let length = timeline.pace.of_characters(bytes.len());
                add(packet.at - length, What::Expected(Expected::Send(payload)));
            }
            Kind::ReceiveStart if !bytes.is_empty() => {
                add(packet.at + timeline.pace.of_characters(1), What::Given(Given::Burst(payload)));
            }
            Kind::ReceiveEnd if !bytes.is_empty() => {
                add(packet.at, What::Given(Given::Receive(payload)));
            }
            Kind::Parity | Kind::Framing => {
                let (bad, kind) = match kind {
                    Kind::Parity => (BadKind::Parity, LineErrorKind::Parity),
                    _ => (BadKind::Framing, LineErrorKind::Framing),
                };
                match bytes {
                    [] => add(packet.at, error(kind, 0)),
                    [byte] => {
                        let item = Item::Bad { kind: bad, byte: *byte };
                        add(packet.at, What::Given(Given::Receive(Payload::new([item]))));
                    }
                    // It does not say which.
                    several => {
                        add(packet.at, What::Given(Given::Receive(payload)));
                        add(packet.at, error(kind, several.len() as u32));
                    }
                }
            }
            Kind::Break if packet.received == Some(false) => notes.add(Left::SentBreaks, place),
            Kind::Break => {
                stray = !bytes.is_empty();
                add(packet.at, error(LineErrorKind::Break, 0));
            }
            Kind::Overflow => {
                stray = !bytes.is_empty();
                add(packet.at, error(LineErrorKind::Overrun, 0));
            }
            Kind::DataLost => {
                stray = !bytes.is_empty();
                notes.add(Left::LostByCapture, place);
            }
            Kind::StatusChange | Kind::Complete => stray = !bytes.is_empty(),
            Kind::SendStart | Kind::SendEnd | Kind::ReceiveStart | Kind::ReceiveEnd => {}
        }
        if stray {
            notes.add(Left::StrayBytes, place);
        }
        Ok(levels)
    }
}
