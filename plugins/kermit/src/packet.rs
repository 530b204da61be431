//! Packets as they stand on the line: their lengths, their checks.

use crate::coding::{from_char, to_char};
use softplug_plugin::parts::checks;
use softplug_plugin::{State, StateReader, StateWriter, copy};

/// What begins a packet.
pub(crate) const MARK: u8 = 0x01;
/// What we ask to have behind each packet.
pub(crate) const END: u8 = 0x0D;
/// Most characters of a packet.
pub(crate) const MOST: usize = 1_000;
/// The greatest length that one character can tell.
pub(crate) const SHORT: usize = 94;
/// What stands before the data of a long packet, with the mark.
const LONG_HEADER: usize = 7;
/// And without it.
const LONG_LENGTH: usize = LONG_HEADER - 1;
/// What stands before the data of a short one.
const SHORT_HEADER: usize = 4;
/// Characters behind the mark that we can hear: others may count their limit otherwise.
const ROOM: usize = MOST + 16;

/// The check of these characters, of so many characters itself.
pub(crate) fn check(characters: &[u8], kind: u8) -> [u8; 3] {
    if kind == 3 {
        let crc = checks::crc16_kermit(&[characters]);
        return [to_char((crc >> 12) as u8), six(crc >> 6), six(crc)];
    }
    let sum = characters.iter().fold(0_u16, |sum, byte| sum.wrapping_add(u16::from(*byte)));
    if kind == 2 {
        return [six(sum >> 6), six(sum), 0];
    }
    [six((sum & 0xFF) + ((sum & 0xC0) >> 6)), 0, 0]
}

fn six(bits: u16) -> u8 {
    to_char((bits & 0x3F) as u8)
}

/// The packet that goes, with its mark.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Packet {
    bytes: [u8; MOST],
    begin: u16,
    end: u16,
}

impl Packet {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; MOST], begin: 0, end: 0 }
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        self.bytes.get(usize::from(self.begin)..usize::from(self.end)).unwrap_or_default()
    }

    /// Data can be pushed.
    pub(crate) fn clear(&mut self) {
        self.begin = LONG_HEADER as u16;
        self.end = LONG_HEADER as u16;
    }

    pub(crate) fn data_length(&self) -> usize {
        usize::from(self.end).saturating_sub(LONG_HEADER)
    }

    pub(crate) fn push(&mut self, characters: &[u8]) {
        copy(self.bytes.get_mut(usize::from(self.end)..).unwrap_or_default(), characters);
        self.end += characters.len() as u16;
    }

    /// Header and check around the data. A length above `most` needs a long header.
    pub(crate) fn finish(&mut self, kind: u8, number: u8, check_kind: u8, most: usize) {
        let check_length = usize::from(check_kind);
        let data = self.data_length();
        let length = data + check_length + 2;
        let number = to_char(number);
        let is_long = length > most;
        let begin = if is_long { 0 } else { LONG_HEADER - SHORT_HEADER };
        let place = self.bytes.get_mut(begin..).unwrap_or_default();
        if is_long {
            let length = length - 2;
            let (high, low) = (to_char((length / 95) as u8), to_char((length % 95) as u8));
            copy(place, &[MARK, to_char(0), number, kind, high, low]);
            let [header, ..] = check(place.get(1..6).unwrap_or_default(), 1);
            copy(place.get_mut(6..).unwrap_or_default(), &[header]);
        } else {
            copy(place, &[MARK, to_char(length as u8), number, kind]);
        }
        self.begin = begin as u16;
        let tail = check(self.as_slice().get(1..).unwrap_or_default(), check_kind);
        self.push(tail.get(..check_length).unwrap_or_default());
    }
}

impl State for Packet {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.begin);
        state.u16(self.end);
        state.bytes(self.bytes.get(..usize::from(self.end)).unwrap_or_default());
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        (self.begin, self.end) = (state.u16(), state.u16());
        match self.bytes.get_mut(..usize::from(self.end)) {
            Some(own) => copy(own, state.bytes(own.len())),
            None => state.refuse(),
        }
    }
}

/// What a character made of the packet that is heard.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Heard {
    /// It belongs to none.
    Outside,
    /// There is more to come.
    Part,
    /// The last one: the packet is good.
    Good,
    /// The end of something that is no good packet.
    Bad,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, State)]
enum Place {
    Outside,
    Inside,
    /// It can be no packet any more; its end is awaited.
    Spoilt,
}

/// The packet that is being heard, without its mark.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Reader {
    place: Place,
    bytes: [u8; ROOM],
    length: u16,
    /// Characters that it will have, as far as is known.
    whole: u16,
    check_length: u8,
}

impl Reader {
    pub(crate) const fn new() -> Self {
        Self { place: Place::Outside, bytes: [0; ROOM], length: 0, whole: 0, check_length: 1 }
    }

    pub(crate) fn is_inside(&self) -> bool {
        self.place != Place::Outside
    }

    /// What is heard is none.
    pub(crate) fn forget(&mut self) {
        self.place = Place::Outside;
    }

    /// A character of it is damaged.
    pub(crate) fn spoil(&mut self) {
        if self.is_inside() {
            self.place = Place::Spoilt;
        }
    }

    /// What is left behind the characters that change nothing: of one that can be no packet any more, all
    /// up to its end.
    pub(crate) fn pass_over<'a>(&self, characters: &'a [u8]) -> &'a [u8] {
        if self.place != Place::Spoilt {
            return characters;
        }
        let at = characters.iter().position(|byte| matches!(*byte, MARK | END));
        characters.get(at.unwrap_or(characters.len())..).unwrap_or_default()
    }

    /// One character; `check_of` tells the check of a packet of this type.
    pub(crate) fn take(&mut self, byte: u8, check_of: impl Fn(u8) -> u8) -> Heard {
        match (self.place, byte) {
            (_, MARK) => {
                self.place = Place::Inside;
                self.length = 0;
                Heard::Part
            }
            (Place::Outside, _) => Heard::Outside,
            (_, END) => {
                self.place = Place::Outside;
                Heard::Bad
            }
            (Place::Spoilt, _) => Heard::Part,
            (Place::Inside, _) => self.take_inside(byte, check_of),
        }
    }

    fn take_inside(&mut self, byte: u8, check_of: impl Fn(u8) -> u8) -> Heard {
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
            self.length += 1;
        }
        // The length stands in the first character, or in the whole header.
        if matches!(usize::from(self.length), 1 | LONG_LENGTH) {
            let Some(whole) = self.whole() else {
                self.place = Place::Spoilt;
                return Heard::Part;
            };
            self.whole = whole as u16;
        }
        if self.length != self.whole {
            return Heard::Part;
        }
        self.check_length = match (self.kind(), from_char(self.bytes[0])) {
            (b'N', length @ 3..=5) => length - 2,
            (kind, _) => check_of(kind),
        };
        if self.is_checked() {
            self.place = Place::Outside;
            return Heard::Good;
        }
        self.place = Place::Spoilt;
        Heard::Part
    }

    /// Characters that it will have, as far as is known: more than there are until it is.
    /// `None`: it is no packet.
    fn whole(&self) -> Option<usize> {
        let length = usize::from(from_char(self.bytes[0]));
        let header = LONG_LENGTH;
        match length {
            _ if self.bytes[0] < 32 => None,
            0 if usize::from(self.length) < header => Some(header),
            0 => {
                let [_, _, _, high, low, own, ..] = self.bytes;
                let [expected, ..] = check(self.bytes.get(..header - 1)?, 1);
                let long = usize::from(from_char(high)) * 95 + usize::from(from_char(low));
                let is_right = own == expected && long > 0 && header + long <= ROOM;
                is_right.then_some(header + long)
            }
            3..=SHORT => Some(length + 1),
            _ => None,
        }
    }

    fn header(&self) -> usize {
        if self.bytes[0] == to_char(0) { LONG_LENGTH } else { SHORT_HEADER - 1 }
    }

    fn is_checked(&self) -> bool {
        let end = usize::from(self.length).saturating_sub(usize::from(self.check_length));
        let (Some(all), Some(own)) =
            (self.bytes.get(..end), self.bytes.get(end..usize::from(self.length)))
        else {
            return false;
        };
        let expected = check(all, self.check_length);
        let is_number = matches!(self.bytes[1], 32..=95);
        end >= self.header() && is_number && expected.get(..own.len()) == Some(own)
    }

    /// All of it, without the mark.
    pub(crate) fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    pub(crate) fn kind(&self) -> u8 {
        self.bytes[2]
    }

    pub(crate) fn number(&self) -> u8 {
        from_char(self.bytes[1])
    }

    pub(crate) fn data(&self) -> &[u8] {
        let end = usize::from(self.length).saturating_sub(usize::from(self.check_length));
        self.bytes.get(self.header()..end).unwrap_or_default()
    }
}

impl State for Reader {
    fn save(&self, state: &mut StateWriter<'_>) {
        self.place.save(state);
        state.u8(self.check_length);
        state.u16(self.length);
        state.u16(self.whole);
        state.bytes(self.as_slice());
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.place.restore(state);
        self.check_length = state.u8();
        (self.length, self.whole) = (state.u16(), state.u16());
        match self.bytes.get_mut(..usize::from(self.length)) {
            Some(own) => copy(own, state.bytes(own.len())),
            None => state.refuse(),
        }
    }
}
