//! The header of a command: what is to be transferred, from or to where.

use super::fields;
use softplug_plugin::{State, Values};

/// SEND to a data block.
pub(super) const SEND_DB: u8 = 0x41;
/// SEND to an extended data block.
pub(super) const SEND_DX: u8 = 0x4F;
/// FETCH.
pub(super) const FETCH: u8 = 0x45;
/// First byte of a follow-up and of its reaction.
pub(super) const FOLLOW_UP: u8 = 0xFF;

/// Fields of jobs and requests, by their place in the manifest.
pub(super) const AREA: u8 = 0;
pub(super) const BLOCK: u8 = 1;
pub(super) const OFFSET: u8 = 2;
pub(super) const COUNT: u8 = 3;
pub(super) const FLAG_BYTE: u8 = 4;
pub(super) const FLAG_BIT: u8 = 5;
pub(super) const CPU: u8 = 6;

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
#[derive(Copy, Clone, Debug, Default, State)]
pub(super) struct Header(pub(super) [u8; 10]);

impl Header {
    /// From the fields of a job; `None` if one of them does not fit.
    pub(super) fn from_fields(is_read: bool, fields: &Values<'_>) -> Option<Self> {
        let mut header = [0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF];
        let mut rest = fields.as_bytes();
        while let Some((index, payload)) = fields::take(&mut rest) {
            if index == AREA {
                header[3] = area_type(payload)?;
                continue;
            }
            let [low, high, 0, 0, 0, 0, 0, 0] = *payload else { return None };
            let (place, most) = match index {
                BLOCK => (4, 0xFF),
                OFFSET => (5, 0xFF),
                COUNT => (7, 0xFF),
                // FF stands for none.
                FLAG_BYTE => (8, 0xFE),
                FLAG_BIT => (9, 7),
                _ => (9, 4),
            };
            let byte = match index {
                COUNT if high == 0 && low == 0 => return None,
                COUNT => {
                    header[6] = high;
                    low
                }
                _ if (high > 0 || low > most) => {
                    return None;
                }
                FLAG_BIT => header[9] & 0xF0 | low,
                CPU if low == 0 => return None,
                CPU => header[9] & 0x0F | low << 4,
                _ => low,
            };
            header[place] = byte;
        }
        let is_numbered = matches!(header[3], b'D' | b'X');
        if !is_numbered && header[4] != 0 {
            return None;
        }
        // A flag has a byte and a bit.
        if (header[8] == 0xFF) != (header[9] & 0x0F == 0x0F) {
            return None;
        }
        header[2] = match header[3] {
            1.. if is_read && (header[6] | header[7]) != 0 => FETCH,
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

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_plugin::{Value, ValueWriter};

    fn header(is_read: bool, fields: &[(u8, Value<'_>)]) -> Option<[u8; 10]> {
        let mut buffer = [0; 256];
        let mut writer = ValueWriter::new(&mut buffer);
        for (index, value) in fields {
            writer.push((*index).into(), *value).expect("the buffer is large enough");
        }
        Header::from_fields(is_read, &Values::new(writer.written())).map(|header| header.0)
    }

    fn area(name: &str) -> (u8, Value<'_>) {
        (AREA, Value::Text(name))
    }

    fn number(index: u8, number: i64) -> (u8, Value<'static>) {
        (index, Value::Int(number))
    }

    #[test]
    fn fetch_of_the_vectors() {
        let fields = [area("DB"), number(BLOCK, 5), number(OFFSET, 10), number(COUNT, 7)];
        assert_eq!(header(true, &fields), Some([0, 0, 0x45, 0x44, 5, 0x0A, 0, 7, 0xFF, 0xFF]));
    }

    #[test]
    fn send_needs_no_count() {
        let fields = [area("DB"), number(BLOCK, 16), number(OFFSET, 1), number(COUNT, 258)];
        assert_eq!(header(false, &fields), Some([0, 0, 0x41, 0x44, 0x10, 1, 1, 2, 0xFF, 0xFF]));
        let fields = &fields[..3];
        assert_eq!(header(false, fields), Some([0, 0, 0x41, 0x44, 0x10, 1, 0, 0, 0xFF, 0xFF]));
        let fields = [area("DX"), number(BLOCK, 16)];
        assert_eq!(header(false, &fields), Some([0, 0, 0x4F, 0x58, 0x10, 0, 0, 0, 0xFF, 0xFF]));
    }

    #[test]
    fn areas_have_their_types_and_names() {
        let areas = [
            ("DB", 0x44, "DB", 2),
            ("DX", 0x58, "DX", 2),
            ("I", 0x45, "I", 1),
            ("Q", 0x41, "Q", 1),
            ("M", 0x4D, "M", 1),
            ("T", 0x54, "T", 2),
            ("C", 0x5A, "C", 2),
            ("E", 0x45, "I", 1),
            ("A", 0x41, "Q", 1),
            ("Z", 0x5A, "C", 2),
        ];
        for (name, code, said, unit) in areas {
            let fields = [area(name), number(COUNT, 300)];
            let read = Header(header(true, &fields).expect("every area can be read"));
            assert_eq!((read.area(), read.area_name()), (code, Some(said)), "{name}");
            assert_eq!((read.unit(), read.size()), (unit, 300 * unit), "{name}");
            let write = header(false, &fields[..1]);
            assert_eq!(write.is_some(), ["DB", "DX"].contains(&name), "{name}");
        }
        for name in ["", "D", "db", "DBX", "X", "P", "MM"] {
            assert_eq!(header(true, &[area(name), number(COUNT, 1)]), None, "{name}");
        }
        let wrong = [0, 0, SEND_DB, b'X', 0, 0, 0, 1, 0xFF, 0xFF];
        assert_eq!(Header(wrong).area_name(), None);
        let unknown = [0, 0, FETCH, b'B', 0, 0, 0, 1, 0xFF, 0xFF];
        assert_eq!(Header(unknown).area_name(), None);
    }

    #[test]
    fn flag_and_cpu_share_a_byte() {
        let fields = |bit, cpu| {
            let flag = [number(FLAG_BYTE, 100), number(FLAG_BIT, bit), number(CPU, cpu)];
            [&[area("DB"), number(COUNT, 1)][..], &flag].concat()
        };
        let ends = |fields: &[_]| header(true, fields).map(|header| [header[8], header[9]]);
        assert_eq!(ends(&fields(7, 4)), Some([100, 0x47]));
        assert_eq!(ends(&fields(0, 1)), Some([100, 0x10]));
        assert_eq!(ends(&fields(7, 4)[..4]), Some([100, 0xF7]));
        let only = |field: &[_]| ends(&[&[area("DB"), number(COUNT, 1)][..], field].concat());
        assert_eq!(only(&[number(CPU, 2)]), Some([0xFF, 0x2F]));
        assert_eq!(only(&[number(FLAG_BYTE, 5)]), None, "a flag has a bit");
        assert_eq!(only(&[number(FLAG_BIT, 5)]), None, "a flag has a byte");
        assert_eq!(only(&[number(FLAG_BYTE, 254), number(FLAG_BIT, 5)]), Some([254, 0xF5]));
        assert_eq!(only(&[number(FLAG_BYTE, 255), number(FLAG_BIT, 5)]), None, "FF is none");
    }

    #[test]
    fn areas_without_a_number_have_none() {
        for name in ["I", "Q", "M", "T", "C", "E", "A", "Z"] {
            let fields = |block| [area(name), number(BLOCK, block), number(COUNT, 1)];
            assert_eq!(header(true, &fields(0)).map(|header| header[4]), Some(0), "{name}");
            assert_eq!(header(true, &fields(7)), None, "{name}");
        }
    }

    #[test]
    fn fields_have_ranges() {
        let wrong = [
            (BLOCK, 256),
            (BLOCK, -1),
            (OFFSET, 256),
            (COUNT, 0x1_0000),
            (COUNT, -1),
            (FLAG_BYTE, 255),
            (FLAG_BYTE, 256),
            (FLAG_BIT, 8),
            (CPU, 0),
            (CPU, 5),
            (CPU, i64::MAX),
        ];
        for (index, value) in wrong {
            let count = (COUNT, Value::Int(1));
            let mut fields = vec![area("DB"), count, number(index, value)];
            fields.retain(|field| field.0 != index || *field != count);
            fields.sort_by_key(|field| field.0);
            assert_eq!(header(true, &fields), None, "{index}: {value}");
        }
        assert_eq!(header(true, &[area("DB")]), None, "a read has a count");
        assert_eq!(header(true, &[area("DB"), number(COUNT, 0)]), None);
        assert_eq!(header(false, &[area("DB"), number(COUNT, 0)]), None);
        assert_eq!(header(true, &[number(COUNT, 1)]), None, "an area is needed");
        assert_eq!(header(true, &[]), None);
    }

    #[test]
    fn reactions_may_take_longer_on_slow_lines() {
        let seconds = [
            (300, 10),
            (599, 10),
            (600, 7),
            (1_199, 7),
            (1_200, 5),
            (9_600, 5),
            (38_399, 5),
            (38_400, 3),
            (115_200, 3),
            (0, 20),
        ];
        for (baud, seconds) in seconds {
            assert_eq!(timeout_at(baud), seconds * 1_000, "{baud}");
        }
    }
}
