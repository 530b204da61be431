//! What a plug-in would have done in a partner's place: it is given what the
//! partner was given, at the same times, in virtual time, and is not heard.

use std::fmt::Write as _;

use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, LineParameters, Micros, ModemLines, NoteLevel};
use softplug_conformance::{bad_kind, modem_lines};
use softplug_link::{LinkFault, LinkHost, LinkOptions, VirtualLine, WireHost};
use softplug_trace::{LineEvent, ModemLevels};

use super::story::{Character, Happening};
use crate::numbers;
use crate::plugin::{AnyFault, AnyInstance};
use crate::recorded::remark;

/// Rooms as a gateway gives them.
const TRANSMIT_ROOM: u32 = 4_096;
const DELIVERY_ROOM: u32 = 16_384;
/// Bytes that are compared between two things given at the most, and shown.
const KEPT: usize = 4_096;
const SHOWN: usize = 16;

/// A plug-in beside the line.
pub(super) struct Rehearsal {
    name: String,
    line: VirtualLine<AnyInstance>,
    parameters: LineParameters,
    watcher: Watcher,
    /// What the partner has sent since it was last given something.
    sent: Vec<u8>,
    modem: ModemLines,
    has_ended: bool,
}

impl Rehearsal {
    pub(super) fn new(
        name: &str,
        instance: AnyInstance,
        settings: SettingValues,
        parameters: LineParameters,
        modem_lines: Option<(ModemLines, ModemLines)>,
        shows_data: bool,
    ) -> Self {
        let options = LinkOptions {
            line: parameters,
            transmit_room: TRANSMIT_ROOM,
            delivery_room: DELIVERY_ROOM,
            modem_lines,
            settings,
        };
        let mut rehearsal = Self {
            name: name.to_owned(),
            line: VirtualLine::new(instance, options, 1),
            parameters,
            watcher: Watcher { shows_data, ..Watcher::default() },
            sent: Vec::new(),
            modem: modem_lines.map_or(ModemLines::default(), |(_, on)| on),
            has_ended: false,
        };
        let opened = rehearsal.line.link.open(Micros::ZERO, &mut rehearsal.watcher);
        rehearsal.look(opened);
        rehearsal
    }

    /// Takes something in at its time since the start; gives what there is to
    /// say before it.
    pub(super) fn take(&mut self, at: Micros, what: &Happening) -> Vec<String> {
        match what {
            Happening::Sent(bytes) => {
                let room = KEPT.saturating_sub(self.sent.len());
                self.sent.extend(bytes.iter().take(room));
                Vec::new()
            }
            Happening::Given(_) | Happening::Burst(_) | Happening::Line(_) => {
                let remarks = self.until(at - Micros(1));
                self.give(at, what);
                remarks
            }
            Happening::SentBreak(_) | Happening::SetLines(_) | Happening::Remark(_) => Vec::new(),
        }
    }

    /// Lets time go on and tells what the plug-in did since something was last
    /// given.
    pub(super) fn until(&mut self, at: Micros) -> Vec<String> {
        if !self.has_ended && at >= self.line.link.now() {
            let run = self.line.run_until(at, &mut self.watcher);
            self.look(run);
        }
        let mut remarks: Vec<_> = self.watcher.effects.drain(..).collect();
        remarks.extend(self.difference());
        self.watcher.bytes.clear();
        self.sent.clear();
        remarks.iter().map(|text| remark(&self.name, text)).collect()
    }

    /// Between two things given: what the plug-in sent, and what the partner did.
    fn difference(&self) -> Option<String> {
        let (would, did) = (&self.watcher.bytes, &self.sent);
        if self.has_ended || would.iter().map(|(_, byte)| byte).eq(did) {
            return None;
        }
        let bytes: Vec<u8> = would.iter().map(|(_, byte)| *byte).collect();
        let mut text = match would.first() {
            Some((first, _)) => {
                format!("would have sent {} at {}", self.shown(&bytes), seconds(*first))
            }
            None => "would have sent nothing".to_owned(),
        };
        if !did.is_empty() {
            let _ = write!(text, ", not {}", self.shown(did));
        }
        Some(text)
    }

    fn shown(&self, bytes: &[u8]) -> String {
        if self.watcher.shows_data {
            hex(bytes)
        } else {
            numbers::things(bytes.len() as u64, "byte")
        }
    }

    fn give(&mut self, at: Micros, what: &Happening) {
        match what {
            Happening::Given(characters) => {
                for character in characters {
                    self.character(at, *character);
                }
                self.tick(at);
            }
            Happening::Burst(characters) => {
                let begun = at - self.parameters.characters(1);
                for (number, character) in (1..).zip(characters) {
                    let at = begun + self.parameters.characters(number);
                    if !self.has_ended {
                        let run = self.line.run_until(at - Micros(1), &mut self.watcher);
                        self.look(run);
                    }
                    self.character(at, *character);
                    self.tick(at);
                }
            }
            Happening::Line(event) => {
                self.event(at, event);
                self.tick(at);
            }
            _ => {}
        }
    }

    fn character(&mut self, at: Micros, (byte, bad): Character) {
        if self.has_ended {
            return;
        }
        let (link, watcher) = (&mut self.line.link, &mut self.watcher);
        let at = at.max(link.now());
        let given = match bad {
            None => link.received(at, &[byte], watcher),
            Some(kind) => link.line_error(at, bad_kind(kind), Some(byte), 0, watcher),
        };
        self.look(given);
    }

    fn event(&mut self, at: Micros, event: &LineEvent) {
        if self.has_ended {
            return;
        }
        let (link, watcher) = (&mut self.line.link, &mut self.watcher);
        let at = at.max(link.now());
        let given = match event {
            LineEvent::Modem(levels) => {
                self.modem = changed(self.modem, levels);
                let known = ModemLines(0x0F);
                link.modem_lines(at, known, self.modem, watcher)
            }
            LineEvent::Error { kind, byte, span } => {
                link.line_error(at, *kind, *byte, *span, watcher)
            }
            LineEvent::Down(_) | LineEvent::Up => Ok(()),
        };
        self.look(given);
    }

    fn tick(&mut self, at: Micros) {
        if !self.has_ended {
            let at = at.max(self.line.link.now());
            let ticked = self.line.transmit(at, &mut self.watcher);
            self.look(ticked);
        }
    }

    /// A plug-in that has trapped says no more.
    fn look(&mut self, result: Result<(), LinkFault<AnyFault>>) {
        if let Err(fault) = result {
            self.has_ended = true;
            let fault = fault.to_string();
            self.watcher.effects.push(format!("cannot go on: {}", fault.escape_debug()));
        }
    }
}

/// Keeps what concerns a person who reads the trace, and of data only how much.
#[derive(Default)]
struct Watcher {
    /// Whether what is said may hold data.
    shows_data: bool,
    effects: Vec<String>,
    bytes: Vec<(Micros, u8)>,
    delivered: u64,
    waiting: u32,
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for Watcher {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        let at = seconds(now);
        let effect = match action {
            Action::DeliveryBegin { .. } => {
                self.delivered = 0;
                return;
            }
            Action::Deliver { bytes, .. } => {
                self.delivered += bytes.len() as u64;
                self.waiting += bytes.len() as u32;
                return;
            }
            Action::DeliveryEnd { failure, .. } => {
                let bytes = self.delivered;
                match failure {
                    None => format!("would have delivered {bytes} bytes at {at}"),
                    Some(failure) => {
                        format!(
                            "would have delivered {bytes} bytes at {at}, failed: {}",
                            failure.name()
                        )
                    }
                }
            }
            Action::Request { .. } => format!("would have asked the host at {at}"),
            Action::Break { micros } => format!("would have sent a break of {micros} µs at {at}"),
            Action::Note { level: NoteLevel::Error | NoteLevel::Warning, code, text } => {
                let text = if self.shows_data {
                    text.escape_debug().to_string()
                } else {
                    format!("{code:04X}")
                };
                format!("would have noted at {at}: {text}")
            }
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Hold
            | Action::Release
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::ModemLines { .. }
            | Action::Want { .. }
            | Action::DeliveryName { .. }
            | Action::JobDone { .. }
            | Action::JobFailed { .. }
            | Action::CheckResult { .. }
            | Action::Withdraw { .. }
            | Action::Note { .. }
            | Action::State { .. }
            | Action::Saved { .. } => return,
        };
        if self.effects.len() < KEPT {
            self.effects.push(effect);
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.waiting)
    }
}

impl WireHost for Watcher {
    fn on_wire(&mut self, start: Micros, byte: u8) {
        if self.bytes.len() < KEPT {
            self.bytes.push((start, byte));
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    let mut text = String::new();
    for byte in bytes.iter().take(SHOWN) {
        let _ = write!(text, "{}{byte:02X}", if text.is_empty() { "" } else { " " });
    }
    if bytes.len() > SHOWN {
        let _ = write!(text, " … ({} bytes)", bytes.len());
    }
    text
}

fn seconds(at: Micros) -> String {
    let at = at.0.max(0);
    format!("{}.{:06}", at / 1_000_000, at % 1_000_000)
}

fn changed(on: ModemLines, levels: &ModemLevels) -> ModemLines {
    let (named, set) = modem_lines(levels);
    ModemLines(on.0 & !named.0).union(set)
}
