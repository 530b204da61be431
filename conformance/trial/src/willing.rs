//! The partner of a dry run: one that wants what we send, and says all that its protocol has it
//! say. Where there is a simulated machine it is that one, without faults.

use softplug_abi::{LineErrorKind, Micros, ModemLines};
use softplug_machines::fanuc::{
    CharacterSet, Control, Interface, Options as FanucOptions, Parity, Press, RemoteOptions,
};
use softplug_machines::pulse_lathe::{Lathe, LatheOptions};
use softplug_machines::r3964::rk512::{Area, Computer, Options as Rk512Options};
use softplug_machines::r3964::{Options as R3964Options, Priority, Station};
use softplug_machines::{Partner, Signal, kermit, xmodem};

use crate::blockwise::Blockwise;
use crate::error::PartnerError;
use crate::exchange::{Exchange, Side};
use crate::settings::Set;
use crate::setup::{BEGIN, Setup};

/// Most bytes of an area of memory that a job can read: 65,535 words behind word 255.
const AREA_BYTES: usize = (65_535 + 256) * 2;

const ETX: u8 = 0x03;
const DC1: u8 = 0x11;

/// A partner, and what it says.
pub(crate) struct Willing {
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
    pub(crate) fn new(setup: &Setup<'_>, exchange: Exchange) -> Result<Self, PartnerError> {
        let Setup { manifest, settings, line, .. } = *setup;
        let set = Set { manifest, settings };
        let speaks = |profile: &str| manifest.profiles.iter().any(|claim| claim.name == profile);
        let machine = if speaks("r3964") || speaks("r3964-simplified") {
            procedure(&set, setup)?
        } else if speaks("fanuc-rs232") {
            fanuc(&set, setup)?
        } else if speaks("heidenhain-fe") {
            Machine::Blockwise(Blockwise::new(&set, setup))
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
        Ok(Self { machine, exchange })
    }

    /// The lathe, if it is one.
    pub(crate) fn into_lathe(self) -> Option<Box<Lathe>> {
        match self.machine {
            Machine::Lathe(lathe) => Some(lathe),
            _ => None,
        }
    }

    /// Whether nobody answers. No partner is needed then, or none is known.
    pub(crate) fn is_nobody(&self) -> bool {
        matches!(self.machine, Machine::Nobody)
    }

    /// Whether what it says belongs to what is to be seen: telegrams go both ways.
    pub(crate) fn is_dialogue(&self) -> bool {
        !matches!(self.machine, Machine::Nobody | Machine::Ready(_) | Machine::Lathe(_))
    }
}

fn procedure(set: &Set<'_>, setup: &Setup<'_>) -> Result<Machine, PartnerError> {
    let priority = match set.choice("priority").as_deref() {
        Some("low") => Priority::High,
        Some("high") => Priority::Low,
        _ => Priority::None,
    };
    let options = R3964Options {
        line: setup.line,
        bcc: set.bool("bcc"),
        handshake: set.bool("handshake"),
        doubling: set.bool("doubling"),
        priority,
        nak_at_start: false,
        ..R3964Options::default()
    };
    if set.choice("layer").as_deref() != Some("rk512") {
        return Ok(Machine::R3964(Box::new(Station::new(options)?)));
    }
    let options = Rk512Options { procedure: options, ..Rk512Options::default() };
    let mut computer = Computer::new(options)?;
    let field = |name| setup.field(name);
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

fn fanuc(set: &Set<'_>, setup: &Setup<'_>) -> Result<Machine, PartnerError> {
    // With DC1 the operator's READ is all that a reader says.
    if set.choice("mode").as_deref() != Some("remote-a") {
        return Ok(Machine::Ready(Some(DC1)));
    }
    let is_software = set.choice("parity").as_deref() == Some("software");
    let options = FanucOptions {
        line: setup.line,
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
    Ok(Machine::Remote(Box::new(Control::new(options)?)))
}

/// It does S, T and M, turns its spindle, and has no limits that a program reaches.
fn lathe(set: &Set<'_>) -> Result<Machine, PartnerError> {
    const FAR: (i64, i64) = (i64::MIN / 2, i64::MAX / 2);
    let increments = set.int("spindle_increments").and_then(|own| u64::try_from(own).ok());
    let default = LatheOptions::default();
    let increments = increments.unwrap_or(default.increments);
    let options = LatheOptions { increments, x_limits: FAR, z_limits: FAR, ..default };
    Ok(Machine::Lathe(Box::new(Lathe::new(options)?)))
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
