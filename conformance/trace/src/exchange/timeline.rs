//! A timeline on a line: what all formats share.

use super::error::ExportError;
use super::note::{Left, Notes};
use super::pace::Pace;
use crate::limits;
use crate::model::{
    BadKind, Entry, Expected, Files, Given, Item, Line, LineSettings, ModemLevels, Payload, Piece,
    Trace, What,
};

/// What happens on a line.
pub(super) struct Timeline {
    pub(super) pace: Pace,
    /// Modem lines at the start, as far as they are known.
    pub(super) modem: ModemLevels,
    /// Exported: sorted by time, payloads resolved to hex pairs and damaged
    /// characters. Imported: as they come.
    pub(super) events: Vec<Event>,
}

/// Something that happens on the line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Event {
    /// In µs. The same moment that a trace names for it.
    pub(super) at: i64,
    pub(super) what: What,
    /// Where it was found: a line or a packet, from 1.
    pub(super) place: u32,
}

/// A character on the line.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Character {
    pub(super) byte: u8,
    pub(super) damage: Option<BadKind>,
    /// The moment of the trace: for a received one its end, else its start.
    pub(super) at: i64,
    pub(super) received: bool,
}

impl Timeline {
    pub(super) fn new(line: LineSettings) -> Self {
        Self { pace: Pace::of(&line), modem: ModemLevels::default(), events: Vec::new() }
    }

    /// What happens on the line in a trace. All else is noted.
    pub(super) fn of(
        trace: &Trace,
        files: &impl Files,
        notes: &mut Notes,
    ) -> Result<Self, ExportError> {
        notes.add(Left::FrontMatter, 0);
        let mut timeline = Self::new(trace.front.line);
        timeline.modem = trace.front.modem.clone();
        let mut left = limits::EXPORT_BYTES;
        for line in &trace.body {
            match line {
                Line::Entry(entry) => timeline.add(entry, files, &mut left, notes)?,
                Line::Alternatives(block) => {
                    let mut first = block.branches.iter().take(1).flatten();
                    let place = block.branches.iter().flatten().find_map(Line::entry);
                    notes.add(Left::Alternatives, place.map_or(0, |entry| entry.line.0));
                    first.try_for_each(|line| match line.entry() {
                        Some(entry) => timeline.add(entry, files, &mut left, notes),
                        None => Ok(()),
                    })?;
                }
                Line::Blank | Line::Comment(_) => {}
            }
        }
        timeline.events.sort_by_key(|event| event.at);
        Ok(timeline)
    }

    fn add(
        &mut self,
        entry: &Entry,
        files: &impl Files,
        left: &mut usize,
        notes: &mut Notes,
    ) -> Result<(), ExportError> {
        let place = entry.line.0;
        if matches!(entry.what.sign(), "?" | "=" | "@" | ".") {
            notes.unheld(&entry.what, place);
            return Ok(());
        }
        if entry.when.is_window() {
            notes.add(Left::Windows, place);
        }
        let mut what = entry.what.clone();
        if let Some(payload) = entry.what.payload() {
            let resolved = resolve(payload, *left, files, entry)?;
            *left -= resolved.length().unwrap_or(0) as usize;
            what = what.with_payload(resolved);
        }
        self.events.push(Event { at: entry.when.from.0 as i64, what, place });
        Ok(())
    }
}

/// The payload as hex pairs and damaged characters.
fn resolve(
    payload: &Payload,
    left: usize,
    files: &impl Files,
    entry: &Entry,
) -> Result<Payload, ExportError> {
    // What a generator makes is counted before it is made.
    if payload.length().is_some_and(|length| length > left as u64) {
        return Err(ExportError::TooMuch);
    }
    let pieces = payload
        .pieces(files)
        .map_err(|source| ExportError::Payload { line: entry.line, source })?;
    let resolved = Payload::new(pieces.into_iter().map(|piece| match piece {
        Piece::Bytes(bytes) => Item::Hex(bytes),
        Piece::Bad { kind, byte } => Item::Bad { kind, byte },
    }));
    match resolved.length() {
        Some(length) if length <= left as u64 => Ok(resolved),
        _ => Err(ExportError::TooMuch),
    }
}

impl Event {
    /// The characters that it carries, each with its own moment.
    pub(super) fn characters(&self, pace: Pace) -> impl Iterator<Item = Character> {
        let (payload, received, spread) = match &self.what {
            What::Given(Given::Receive(payload)) => (Some(payload), true, false),
            What::Given(Given::Burst(payload)) => (Some(payload), true, true),
            What::Expected(Expected::Send(payload)) => (Some(payload), false, true),
            _ => (None, false, false),
        };
        payload.into_iter().flat_map(read).enumerate().map(move |(place, (byte, damage))| {
            let at = self.at + if spread { pace.of_characters(place) } else { 0 };
            Character { byte, damage, at, received }
        })
    }
}

/// The characters of a resolved payload.
pub(super) fn read(payload: &Payload) -> impl Iterator<Item = (u8, Option<BadKind>)> {
    payload.items().iter().flat_map(|item| {
        let (bytes, damage): (&[u8], _) = match item {
            Item::Hex(bytes) | Item::Text(bytes) => (bytes, None),
            Item::Bad { kind, byte } => (std::slice::from_ref(byte), Some(*kind)),
            // Only unresolved payloads have them.
            Item::File(_) | Item::Generated(_) => (&[], None),
        };
        bytes.iter().map(move |byte| (*byte, damage))
    })
}
