//! The partner of Heidenhain's blockwise transfer.

use std::collections::VecDeque;

use softplug_abi::{LineParameters, Micros};

use crate::settings::Set;
use crate::setup::{BEGIN, Setup};

const SOH: u8 = 0x01;
const STX: u8 = 0x02;
const ETX: u8 = 0x03;
const EOT: u8 = 0x04;
const ACK: u8 = 0x06;
const DC1: u8 = 0x11;
const ETB: u8 = 0x17;

/// A control with blockwise transfer that asks for a program and acknowledges each block of it.
#[derive(Debug)]
pub(crate) struct Blockwise {
    line: LineParameters,
    /// It waits for DC1 before it answers.
    dc1: bool,
    /// The parity bit is a character's eighth.
    has_parity: bool,
    place: Place,
    pub(crate) leaving: VecDeque<(Micros, u8)>,
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
    pub(crate) fn new(set: &Set<'_>, setup: &Setup<'_>) -> Self {
        let mut control = Self {
            line: setup.line,
            dc1: set.bool("dc1"),
            has_parity: set.choice("parity").as_deref() == Some("even"),
            place: Place::Outside,
            leaving: VecDeque::new(),
        };
        let name = setup.field("name").unwrap_or("1");
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

    pub(crate) fn receive(&mut self, now: Micros, byte: u8) {
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
