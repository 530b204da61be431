//! The annotation: what bytes mean as ASCII, for the reader of a line.

use crate::model::{Item, Payload};

/// An annotation goes on with `…` after about so many characters.
const LONGEST: usize = 56;

const CONTROLS: [&str; 32] = [
    "NUL", "SOH", "STX", "ETX", "EOT", "ENQ", "ACK", "BEL", "BS", "HT", "LF", "VT", "FF", "CR",
    "SO", "SI", "DLE", "DC1=XON", "DC2", "DC3=XOFF", "DC4", "NAK", "SYN", "ETB", "CAN", "EM",
    "SUB", "ESC", "FS", "GS", "RS", "US",
];

/// What a byte means as ASCII: `'A'`, `DC1=XON`; bit 8 set is a `*` behind the reading of
/// the lower seven.
///
/// ```
/// assert_eq!(softplug_trace::reading(0x13), "DC3=XOFF");
/// assert_eq!(softplug_trace::reading(0xC1), "'A'*");
/// ```
pub fn reading(byte: u8) -> String {
    let mut annotation = Annotation::default();
    annotation.byte(byte);
    annotation.flush();
    annotation.text
}

/// The annotation of a payload; none where all of it can be read anyway.
pub(crate) fn annotation(payload: &Payload) -> Option<String> {
    let opaque = |item: &Item| matches!(item, Item::Hex(_) | Item::Bad { .. });
    if !payload.items().iter().any(opaque) {
        return None;
    }
    let mut annotation = Annotation::default();
    for item in payload.items() {
        match item {
            Item::Hex(bytes) | Item::Text(bytes) => {
                bytes.iter().take(LONGEST + 1).for_each(|byte| annotation.byte(*byte));
            }
            Item::Bad { byte, .. } => annotation.bad(*byte),
            Item::File(_) | Item::Generated(_) => annotation.word("…"),
        }
        if annotation.text.len() + annotation.run.len() > LONGEST {
            annotation.flush();
            let end = annotation
                .text
                .char_indices()
                .nth(LONGEST)
                .map_or(annotation.text.len(), |(end, _)| end);
            annotation.text.truncate(end);
            annotation.text.push('…');
            return Some(annotation.text);
        }
    }
    annotation.flush();
    Some(annotation.text)
}

/// Words so far and the run of printable characters that is not written yet.
#[derive(Default)]
struct Annotation {
    text: String,
    run: String,
    high: bool,
}

impl Annotation {
    /// Bit 8 set is shown as `*` behind the reading of the lower seven.
    fn byte(&mut self, byte: u8) {
        let (low, high) = (byte & 0x7F, byte >= 0x80);
        if !(b' '..=b'~').contains(&low) {
            self.word(CONTROLS.get(usize::from(low)).copied().unwrap_or("DEL"));
            self.text.push_str(if high { "*" } else { "" });
            return;
        }
        if high != self.high {
            self.flush();
            self.high = high;
        }
        self.run.push(char::from(low));
    }

    fn bad(&mut self, byte: u8) {
        self.word("~");
        match byte & 0x7F {
            low @ b' '..=b'~' => {
                self.text.push('\'');
                self.text.push(char::from(low));
                self.text.push('\'');
            }
            low => self.text.push_str(CONTROLS.get(usize::from(low)).copied().unwrap_or("DEL")),
        }
        self.text.push_str(if byte >= 0x80 { "*" } else { "" });
    }

    fn word(&mut self, word: &str) {
        self.flush();
        self.space();
        self.text.push_str(word);
    }

    fn flush(&mut self) {
        if self.run.is_empty() {
            return;
        }
        self.space();
        self.text.push('\'');
        self.text.push_str(&self.run);
        self.text.push_str(if self.high { "'*" } else { "'" });
        self.run.clear();
    }

    fn space(&mut self) {
        if !self.text.is_empty() {
            self.text.push(' ');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::BadKind;

    #[test]
    fn controls_have_names_and_bit_8_a_star() {
        let read = |bytes: &[u8]| annotation(&Payload::hex(bytes)).unwrap();
        assert_eq!(read(b"AB"), "'AB'");
        assert_eq!(read(&[0x02, 0x10, 0x11, 0x13, 0x0A, 0x7F]), "STX DLE DC1=XON DC3=XOFF LF DEL");
        assert_eq!(read(&[0xA5, 0x0A, 0xCF, 0x30]), "'%'* LF 'O'* '0'");
        assert_eq!(read(&[0x93]), "DC3=XOFF*");
    }

    #[test]
    fn damage_is_marked_and_long_data_left_out() {
        let items = [
            Item::Text(b"G1".to_vec()),
            Item::Bad { kind: BadKind::Parity, byte: 0x31 },
            Item::Bad { kind: BadKind::Framing, byte: 0x8D },
            Item::File(crate::Digest([0; 32])),
        ];
        assert_eq!(annotation(&Payload::new(items)).unwrap(), "'G1' ~'1' ~CR* …");
    }

    #[test]
    fn only_what_cannot_be_read_has_a_gloss() {
        assert_eq!(annotation(&Payload::new([Item::Text(b"AB\n".to_vec())])), None);
        assert_eq!(annotation(&Payload::default()), None);
    }

    #[test]
    fn long_payloads_are_cut() {
        for bytes in [vec![b'A'; 10_000], vec![0x11; 10_000], vec![0xC1; 10_000]] {
            let annotation = annotation(&Payload::hex(&bytes)).unwrap();
            assert_eq!(annotation.chars().count(), LONGEST + 1);
            assert!(annotation.ends_with('…'));
        }
    }
}
