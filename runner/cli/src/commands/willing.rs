//! The partner of a dry run: one that wants what we send, and says all that its protocol has it
//! say. Where there is a simulated machine it is that one, without faults.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use softplug_abi::manifest::{Manifest, OwnedValue, SettingValues, ValueType};
use softplug_abi::{LineErrorKind, LineParameters, Micros, ModemLines};
use softplug_machines::fanuc::{
    CharacterSet, Control, Interface, Options as FanucOptions, Parity, Press, RemoteOptions,
};
use softplug_machines::pulse_lathe::{Lathe, LatheOptions};
use softplug_machines::r3964::rk512::{Area, Computer, Options as Rk512Options};
use softplug_machines::r3964::{Options as R3964Options, Priority, Station};
use softplug_machines::{Partner, Signal, kermit, xmodem};

use crate::failure::Failure;
use crate::line::Assignment;

/// When the partner does its first thing: the job has begun then.
const BEGIN: Micros = Micros::from_millis(10);
/// Most bytes of an area of memory that a job can read: 65,535 words behind word 255.
const AREA_BYTES: usize = (65_535 + 256) * 2;

const SOH: u8 = 0x01;
const STX: u8 = 0x02;
const ETX: u8 = 0x03;
const EOT: u8 = 0x04;
const ACK: u8 = 0x06;
const DC1: u8 = 0x11;
const ETB: u8 = 0x17;

/// What both sides said, in the order in which it began.
#[derive(Clone, Debug)]
pub(super) struct Exchange {
    pieces: Rc<RefCell<Vec<Said>>>,
    /// Characters of one side that follow each other within this are one piece; so both may speak
    /// at once.
    gap: Micros,
}

/// What one side said without a pause.
#[derive(Debug)]
struct Said {
    side: Side,
    last: Micros,
    bytes: Vec<u8>,
}

/// Who said it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Side {
    Us,
    Partner,
}

impl Exchange {
    fn new(line: LineParameters) -> Self {
        // Half a character more than one takes.
        Self { pieces: Rc::default(), gap: Micros(line.characters(3).0 / 2) }
    }

    /// A character of this side: begun, for us, and ended, for the partner, at this time.
    pub(super) fn add(&self, side: Side, at: Micros, byte: u8) {
        let mut pieces = self.pieces.borrow_mut();
        let is_last = pieces.last().is_some_and(|piece| piece.side == side);
        let latest = pieces.iter_mut().rev().find(|piece| piece.side == side);
        match latest {
            Some(piece) if is_last || (self.gap > Micros::ZERO && at - piece.last <= self.gap) => {
                piece.bytes.push(byte);
                piece.last = at;
            }
            _ => pieces.push(Said { side, last: at, bytes: vec![byte] }),
        }
    }

    pub(super) fn pieces(&self) -> Vec<(Side, Vec<u8>)> {
        self.pieces.borrow().iter().map(|piece| (piece.side, piece.bytes.clone())).collect()
    }
}

/// A partner, and what it says.
pub(super) struct Willing {
    machine: Machine,
    exchange: Exchange,
}

enum Machine {
    /// Nobody: the plug-in needs none, or none is known.
    Nobody,
    /// It says so that it is ready, once.
    Ready(Option<u8>),
    R3964(Box<Station>),
    Rk512(Box<Computer>),
    Remote(Box<Control>),
    Blockwise(Blockwise),
    Lathe(Box<Lathe>),
    Xmodem(Box<xmodem::Control>),
    Kermit(Box<kermit::Machine>),
}

impl Willing {
    /// The partner for the plug-in with these settings, and for a job with these fields.
    pub(super) fn new(
        manifest: &Manifest,
        settings: &SettingValues,
        line: LineParameters,
        fields: &[Assignment],
    ) -> Result<Self, Failure> {
        let set = Set { manifest, settings };
        let speaks = |profile: &str| manifest.profiles.iter().any(|claim| claim.name == profile);
        let machine = if speaks("r3964") || speaks("r3964-simplified") {
            procedure(&set, line, fields)?
        } else if speaks("fanuc-rs232") {
            fanuc(&set, line)?
        } else if speaks("heidenhain-fe") {
            Machine::Blockwise(Blockwise::new(&set, line, fields))
        } else if speaks("pulse-lathe") {
            lathe(&set)?
        } else if speaks("xmodem") {
            let is_crc = set.choice("mode").as_deref() != Some("checksum");
            let options = xmodem::Options { line, is_crc, begins: BEGIN, ..Default::default() };
            Machine::Xmodem(Box::new(xmodem::Control::new(options)))
        } else if speaks("kermit") {
            let options = kermit::Options { line, long: Some(1_000), ..Default::default() };
            Machine::Kermit(Box::new(kermit::Machine::new(options)))
        } else {
            match (set.bool("wait_for_xon"), set.int("xon")) {
                (true, Some(xon)) => Machine::Ready(u8::try_from(xon).ok()),
                _ => Machine::Nobody,
            }
        };
        Ok(Self { machine, exchange: Exchange::new(line) })
    }

    pub(super) fn exchange(&self) -> Exchange {
        self.exchange.clone()
    }

    /// The lathe, if it is one.
    pub(super) fn into_lathe(self) -> Option<Box<Lathe>> {
        match self.machine {
            Machine::Lathe(lathe) => Some(lathe),
            _ => None,
        }
    }

    /// Whether what it says belongs to what is to be seen: telegrams go both ways.
    pub(super) fn is_dialogue(&self) -> bool {
        !matches!(self.machine, Machine::Nobody | Machine::Ready(_) | Machine::Lathe(_))
    }
}

fn procedure(
    set: &Set<'_>,
    line: LineParameters,
    fields: &[Assignment],
) -> Result<Machine, Failure> {
    let priority = match set.choice("priority").as_deref() {
        Some("low") => Priority::High,
        Some("high") => Priority::Low,
        _ => Priority::None,
    };
    let options = R3964Options {
        line,
        bcc: set.bool("bcc"),
        handshake: set.bool("handshake"),
        doubling: set.bool("doubling"),
        priority,
        nak_at_start: false,
        ..R3964Options::default()
    };
    if set.choice("layer").as_deref() != Some("rk512") {
        return Ok(Machine::R3964(Box::new(Station::new(options).map_err(Failure::usage)?)));
    }
    let options = Rk512Options { procedure: options, ..Rk512Options::default() };
    let mut computer = Computer::new(options).map_err(Failure::usage)?;
    let field = |name: &str| {
        fields.iter().find(|field| field.name == name).map(|field| field.value.as_str())
    };
    let block = field("block").and_then(|block| block.parse().ok()).unwrap_or(0);
    let area = match field("area") {
        Some("DX") => Area::Dx(block),
        Some("I" | "E") => Area::Inputs,
        Some("Q" | "A") => Area::Outputs,
        Some("M") => Area::Flags,
        Some("T") => Area::Timers,
        Some("C" | "Z") => Area::Counters,
        _ => Area::Db(block),
    };
    computer.memory.set(area, vec![0; AREA_BYTES]);
    Ok(Machine::Rk512(Box::new(computer)))
}

fn fanuc(set: &Set<'_>, line: LineParameters) -> Result<Machine, Failure> {
    // With DC1 the operator's READ is all that a reader says.
    if set.choice("mode").as_deref() != Some("remote-a") {
        return Ok(Machine::Ready(Some(DC1)));
    }
    let is_software = set.choice("parity").as_deref() == Some("software");
    let options = FanucOptions {
        line,
        interface: Interface::RemoteA,
        parity: if is_software { Parity::Software } else { Parity::Uart },
        characters: CharacterSet::Printable,
        buffer: 4_096,
        remote: RemoteOptions {
            end_code: if set.choice("packet_end").as_deref() == Some("etx") { ETX } else { b'\r' },
            ..RemoteOptions::default()
        },
        panel: vec![(BEGIN, Press::Read)],
        ..FanucOptions::default()
    };
    Ok(Machine::Remote(Box::new(Control::new(options).map_err(Failure::usage)?)))
}

/// It does S, T and M, turns its spindle, and has no limits that a program reaches.
fn lathe(set: &Set<'_>) -> Result<Machine, Failure> {
    const FAR: (i64, i64) = (i64::MIN / 2, i64::MAX / 2);
    let increments = set.int("spindle_increments").and_then(|own| u64::try_from(own).ok());
    let default = LatheOptions::default();
    let increments = increments.unwrap_or(default.increments);
    let options = LatheOptions { increments, x_limits: FAR, z_limits: FAR, ..default };
    Ok(Machine::Lathe(Box::new(Lathe::new(options).map_err(Failure::usage)?)))
}

/// Values of settings by name; what the plug-in does not have is off.
struct Set<'a> {
    manifest: &'a Manifest,
    settings: &'a SettingValues,
}

impl Set<'_> {
    fn value(&self, name: &str) -> Option<&OwnedValue> {
        let at = self.manifest.settings.iter().position(|setting| setting.name == name)?;
        self.settings.as_slice().get(at)
    }

    fn bool(&self, name: &str) -> bool {
        matches!(self.value(name), Some(OwnedValue::Bool(true)))
    }

    fn int(&self, name: &str) -> Option<i64> {
        match self.value(name) {
            Some(OwnedValue::Int(value)) => Some(*value),
            _ => None,
        }
    }

    fn choice(&self, name: &str) -> Option<String> {
        let setting = self.manifest.settings.iter().find(|setting| setting.name == name)?;
        match (&setting.kind, self.value(name)?) {
            (ValueType::Choice, OwnedValue::Choice(at)) => {
                setting.choices.get(usize::from(*at)).map(ToString::to_string)
            }
            _ => None,
        }
    }
}

impl Partner for Willing {
    fn receive(&mut self, now: Micros, byte: u8) {
        match &mut self.machine {
            Machine::Nobody | Machine::Ready(_) => {}
            Machine::R3964(station) => station.receive(now, byte),
            Machine::Rk512(computer) => computer.receive(now, byte),
            Machine::Remote(control) => control.receive(now, byte),
            Machine::Blockwise(control) => control.receive(now, byte),
            Machine::Lathe(lathe) => lathe.receive(now, byte),
            Machine::Xmodem(control) => control.receive(now, byte),
            Machine::Kermit(machine) => machine.receive(now, byte),
        }
    }

    fn receive_damaged(&mut self, now: Micros, _kind: LineErrorKind, byte: Option<u8>) {
        if let Some(byte) = byte {
            self.receive(now, byte);
        }
    }

    fn next_event(&self) -> Option<Micros> {
        match &self.machine {
            Machine::Nobody | Machine::Ready(None) => None,
            Machine::Ready(Some(_)) => Some(BEGIN),
            Machine::R3964(station) => station.next_event(),
            Machine::Rk512(computer) => computer.next_event(),
            Machine::Remote(control) => control.next_event(),
            Machine::Blockwise(control) => control.leaving.front().map(|(at, _)| *at),
            Machine::Lathe(lathe) => lathe.next_event(),
            Machine::Xmodem(control) => control.next_event(),
            Machine::Kermit(machine) => machine.next_event(),
        }
    }

    fn advance(&mut self, now: Micros) {
        match &mut self.machine {
            Machine::Nobody | Machine::Ready(_) | Machine::Blockwise(_) => {}
            Machine::R3964(station) => station.advance(now),
            Machine::Rk512(computer) => computer.advance(now),
            Machine::Remote(control) => control.advance(now),
            Machine::Lathe(lathe) => lathe.advance(now),
            Machine::Xmodem(control) => control.advance(now),
            Machine::Kermit(machine) => machine.advance(now),
        }
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        match self.poll_signal(now)? {
            Signal::Character(byte) => Some(byte),
            _ => None,
        }
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        let signal = match &mut self.machine {
            Machine::Ready(byte) if now >= BEGIN => byte.take().map(Signal::Character),
            Machine::Nobody | Machine::Ready(_) => None,
            Machine::R3964(station) => station.poll_signal(now),
            Machine::Rk512(computer) => computer.poll_signal(now),
            Machine::Remote(control) => control.poll_signal(now),
            Machine::Lathe(lathe) => lathe.poll_signal(now),
            Machine::Xmodem(control) => control.poll_signal(now),
            Machine::Kermit(machine) => machine.poll_signal(now),
            Machine::Blockwise(control) => {
                let next = control.leaving.pop_front_if(|(at, _)| *at <= now);
                next.map(|(_, byte)| Signal::Character(byte))
            }
        };
        if let Some(Signal::Character(byte)) = signal {
            self.exchange.add(Side::Partner, now, byte);
        }
        signal
    }

    fn modem_lines(&mut self, now: Micros, lines: ModemLines, on: ModemLines) {
        if let Machine::Remote(control) = &mut self.machine {
            Partner::modem_lines(&mut **control, now, lines, on);
        }
    }
}

/// A control with blockwise transfer that asks for a program and acknowledges each block of it.
#[derive(Debug)]
struct Blockwise {
    line: LineParameters,
    /// It waits for DC1 before it answers.
    dc1: bool,
    /// The parity bit is a character's eighth.
    has_parity: bool,
    place: Place,
    leaving: VecDeque<(Micros, u8)>,
}

/// Where in a block it reads.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Place {
    Outside,
    Text,
    Check,
    Behind,
}

impl Blockwise {
    fn new(set: &Set<'_>, line: LineParameters, fields: &[Assignment]) -> Self {
        let mut control = Self {
            line,
            dc1: set.bool("dc1"),
            has_parity: set.choice("parity").as_deref() == Some("even"),
            place: Place::Outside,
            leaving: VecDeque::new(),
        };
        let name = fields.iter().find(|field| field.name == "name");
        let name = name.map_or("1", |field| field.value.as_str());
        let mut header = vec![SOH, b'H'];
        header.extend(name.bytes());
        header.push(b'E');
        if set.bool("bcc_space") && check(&header) ^ ETB < 0x20 {
            header.push(b' ');
        }
        header.push(ETB);
        header.push(check(&header));
        if control.dc1 {
            header.push(DC1);
        }
        for byte in header {
            control.say(BEGIN, byte);
        }
        control
    }

    /// A character leaves behind those before it.
    fn say(&mut self, now: Micros, byte: u8) {
        let before = self.leaving.back().map_or(now, |(at, _)| (*at).max(now));
        let odd = byte.count_ones() as u8 & 1;
        let byte = if self.has_parity { byte | odd << 7 } else { byte };
        self.leaving.push_back((before + self.line.characters(1), byte));
    }

    fn receive(&mut self, now: Micros, byte: u8) {
        let byte = byte & 0x7F;
        self.place = match (self.place, byte) {
            (Place::Text, ETB) => Place::Check,
            (Place::Outside | Place::Behind, STX) | (Place::Text, _) => Place::Text,
            (Place::Check, _) if self.dc1 => Place::Behind,
            (Place::Check, _) | (Place::Behind, DC1) => {
                self.say(now, ACK);
                Place::Outside
            }
            // ETX EOT ends the program.
            (_, ETX | EOT) | (Place::Outside | Place::Behind, _) => Place::Outside,
        };
    }
}

/// Even parity over all characters so far.
fn check(characters: &[u8]) -> u8 {
    characters.iter().fold(0, |check, character| check ^ character)
}
