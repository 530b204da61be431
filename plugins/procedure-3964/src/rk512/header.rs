//! The header of a command: what is to be transferred, from or to where.

use softplug_plugin::Values;

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

/// The type of an area, by its English or its German name.
fn area_type(name: &[u8]) -> Option<u8> {
    let area = match name {
        b"DB" => b'D',
        b"DX" => b'X',
        b"I" | b"E" => b'E',
        b"Q" | b"A" => b'A',
        b"M" => b'M',
        b"T" => b'T',
        b"C" | b"Z" => b'Z',
        _ => return None,
    };
    Some(area)
}

/// A command without its data, as on the wire: 00, 00, command, type, block,
/// offset, count (high byte first), flag byte, and CPU and flag bit in a nibble each.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Header(pub(super) [u8; 10]);

impl Header {
    /// From the fields of a job; `None` if one of them does not fit.
    #[inline(never)]
    pub(super) fn from_fields(is_read: bool, fields: &Values<'_>) -> Option<Self> {
        // The area is the first field and must be there. Its record has a head of
        // six bytes and is looked at as bytes: what it may be is short.
        let [0, 0, _, _, length, 0, text @ ..] = fields.as_bytes() else { return None };
        let area = area_type(text.get(..usize::from(*length))?)?;
        let mut header = [0, 0, 0, area, 0, 0, 0, 0, 0xFF, 0xFF];
        for field in fields.clone().raw() {
            let field = field.ok()?;
            if field.index == AREA {
                continue;
            }
            let number = u16::try_from(field.int()?).ok()?;
            let (place, most) = match field.index {
                BLOCK => (4, 0xFF),
                OFFSET => (5, 0xFF),
                COUNT => (7, 0xFFFF),
                FLAG_BYTE => (8, 0xFF),
                FLAG_BIT => (9, 7),
                _ => (9, 4),
            };
            let mut byte = number as u8;
            match field.index {
                COUNT => header[6] = (number >> 8) as u8,
                FLAG_BIT => byte |= header[9] & 0xF0,
                CPU if byte == 0 => return None,
                CPU => byte = byte << 4 | header[9] & 0x0F,
                _ => {}
            }
            if number > most {
                return None;
            }
            header[place] = byte;
        }
        header[2] = match area {
            _ if is_read && (header[6] | header[7]) != 0 => FETCH,
            b'D' if !is_read => SEND_DB,
            b'X' if !is_read => SEND_DX,
            _ => return None,
        };
        Some(Self(header))
    }

    pub(super) fn command(self) -> u8 {
        self.0[2]
    }

    pub(super) fn area(self) -> u8 {
        self.0[3]
    }

    /// The area's name; `None`: there is no such area, or this command does not
    /// go with it.
    pub(super) fn area_name(self) -> Option<&'static str> {
        let place = b"DXEAMTZ".iter().position(|area| *area == self.area())?;
        let fits = match self.command() {
            SEND_DB => place == 0,
            SEND_DX => place == 1,
            _ => true,
        };
        let (start, end) =
            if place < 2 { (2 * place, 2 * place + 2) } else { (place + 2, place + 3) };
        "DBDXIQMTC".get(start..end).filter(|_| fits)
    }

    pub(super) fn is_read(self) -> bool {
        self.command() == FETCH
    }

    /// Bytes of one unit of count and offset.
    pub(super) fn unit(self) -> u32 {
        if matches!(self.area(), b'D' | b'X' | b'T' | b'Z') { 2 } else { 1 }
    }

    /// All of its data in bytes.
    pub(super) fn size(self) -> u32 {
        u32::from(u16::from_be_bytes([self.0[6], self.0[7]])) * self.unit()
    }
}

/// How long a reaction may take, in ms, where it goes by the line rate. At rates in
/// between the slower one's time holds; without a rate, the longest of all.
pub(crate) fn timeout_at(baud: u32) -> i64 {
    let seconds = match baud {
        0 => 20,
        1..600 => 10,
        600..1_200 => 7,
        1_200..38_400 => 5,
        38_400.. => 3,
    };
    seconds * 1_000
}
