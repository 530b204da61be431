//! The header of a command: what is to be transferred, from or to where.

use softplug_plugin::{Micros, StateReader, StateWriter, Values};

/// SEND to a data block.
pub(super) const SEND_DB: u8 = 0x41;
/// SEND to an extended data block.
pub(super) const SEND_DX: u8 = 0x4F;
/// FETCH.
pub(super) const FETCH: u8 = 0x45;
/// First byte of a follow-up and of its reaction.
pub(super) const FOLLOW_UP: u8 = 0xFF;

/// Fields of jobs and requests, by their place in the manifest.
pub(super) const AREA: u16 = 0;
pub(super) const BLOCK: u16 = 1;
pub(super) const OFFSET: u16 = 2;
pub(super) const COUNT: u16 = 3;
pub(super) const FLAG_BYTE: u16 = 4;
pub(super) const FLAG_BIT: u16 = 5;
pub(super) const CPU: u16 = 6;
pub(super) const DATA: u16 = 7;

const TYPE_DB: u8 = b'D';
const TYPE_DX: u8 = b'X';

/// Areas by name, also by their German ones, and their type. The first name of
/// a type is the one that we say.
const AREAS: [(&[u8], u8); 10] = [
    (b"DB", TYPE_DB),
    (b"DX", TYPE_DX),
    (b"I", b'E'),
    (b"Q", b'A'),
    (b"M", b'M'),
    (b"T", b'T'),
    (b"C", b'Z'),
    (b"E", b'E'),
    (b"A", b'A'),
    (b"Z", b'Z'),
];

/// A command without its data.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Header {
    pub(super) command: u8,
    pub(super) area: u8,
    /// Number of the data block.
    pub(super) block: u8,
    /// First word or byte. A follow-up's may be larger than a first one's.
    pub(super) offset: u32,
    /// Words or bytes.
    pub(super) count: u16,
    /// Coordination flag; FF: none.
    pub(super) flag: u8,
    /// CPU and the flag's bit; F: none.
    pub(super) cpu_bit: u8,
}

impl Header {
    /// From the fields of a job; `None` if one of them does not fit.
    pub(super) fn from_fields(is_read: bool, fields: &Values<'_>) -> Option<Self> {
        let mut area = 0;
        let mut numbers = [0, 0, 0, 0, 0xFF, 0x0F, 0x0F];
        for field in fields.clone().raw() {
            let field = field.ok()?;
            if field.index == AREA {
                let name = field.text()?.as_bytes();
                area = AREAS.iter().find(|(own, _)| is_same(own, name))?.1;
                continue;
            }
            let most = match field.index {
                COUNT => 0xFFFF,
                FLAG_BIT => 7,
                CPU => 4,
                _ => 0xFF,
            };
            let least = i64::from(matches!(field.index, COUNT | CPU));
            let number = field.int().filter(|number| (least..=most).contains(number))?;
            *numbers.get_mut(usize::from(field.index))? = number;
        }
        let [_, block, offset, count, flag, bit, cpu] = numbers;
        let command = match (is_read, area) {
            (true, 1..) => FETCH,
            (false, TYPE_DB) => SEND_DB,
            (false, TYPE_DX) => SEND_DX,
            _ => return None,
        };
        if is_read && count == 0 {
            return None;
        }
        Some(Self {
            command,
            area,
            block: block as u8,
            offset: offset as u32,
            count: count as u16,
            flag: flag as u8,
            cpu_bit: (cpu << 4 | bit) as u8,
        })
    }

    pub(super) fn from_bytes(bytes: [u8; 10]) -> Self {
        let [_, _, command, area, block, offset, high, low, flag, cpu_bit] = bytes;
        let count = u16::from_be_bytes([high, low]);
        Self { command, area, block, offset: offset.into(), count, flag, cpu_bit }
    }

    pub(super) fn to_bytes(self) -> [u8; 10] {
        let [high, low] = self.count.to_be_bytes();
        let offset = self.offset as u8;
        [0, 0, self.command, self.area, self.block, offset, high, low, self.flag, self.cpu_bit]
    }

    /// The area's name; `None`: there is no such area, or this command does not
    /// go with it.
    pub(super) fn area_name(self) -> Option<&'static str> {
        let fits = match self.command {
            SEND_DB => self.area == TYPE_DB,
            SEND_DX => self.area == TYPE_DX,
            _ => true,
        };
        let (name, _) = AREAS.iter().find(|(_, area)| *area == self.area && fits)?;
        core::str::from_utf8(name).ok()
    }

    pub(super) fn is_read(self) -> bool {
        self.command == FETCH
    }

    /// Bytes of one unit of count and offset.
    pub(super) fn unit(self) -> u32 {
        let is_words = matches!(self.area, TYPE_DB | TYPE_DX | b'T' | b'Z');
        if is_words { 2 } else { 1 }
    }

    pub(super) fn save(self, state: &mut StateWriter<'_>) {
        state.bytes(&self.to_bytes());
        state.u32(self.offset);
    }

    pub(super) fn restore(state: &mut StateReader<'_>) -> Self {
        let bytes = state.bytes(10).first_chunk().copied().unwrap_or_default();
        Self { offset: state.u32(), ..Self::from_bytes(bytes) }
    }
}

/// Without the comparison of slices, which is larger than what it is for.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    one.len() == other.len() && one.iter().zip(other).all(|(one, other)| one == other)
}

/// How long a reaction may take where it goes by the line rate. At rates in
/// between the slower one's time holds; without a rate, the longest of all.
pub(crate) fn timeout_at(baud: u32) -> Micros {
    let seconds = match baud {
        0 => 20,
        1..600 => 10,
        600..1_200 => 7,
        1_200..38_400 => 5,
        38_400.. => 3,
    };
    Micros::from_millis(seconds * 1_000)
}
