//! Two runs of bytes, one above the other, with their differences marked.

/// Bytes in one row.
const WIDTH: usize = 16;

/// The bytes of a text of hex digits; none where it is no such text.
pub(crate) fn parse(digits: &str) -> Option<Vec<u8>> {
    let pairs = digits.as_bytes().chunks(2);
    pairs
        .map(|pair| {
            let [high, low] = pair else { return None };
            let digit = |byte: u8| char::from(byte).to_digit(16);
            Some((digit(*high)? << 4 | digit(*low)?) as u8)
        })
        .collect()
}

/// A byte's place in both sides.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Pair {
    pub(crate) expected: Option<u8>,
    pub(crate) observed: Option<u8>,
}

impl Pair {
    pub(crate) fn differs(self) -> bool {
        self.expected != self.observed
    }
}

/// Both sides, in rows.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Difference {
    pub(crate) rows: Vec<Vec<Pair>>,
}

impl Difference {
    /// Of two texts of hex digits; none where both are empty.
    pub(crate) fn new(expected: &str, observed: &str) -> Option<Self> {
        let (expected, observed) = (parse(expected)?, parse(observed)?);
        let length = expected.len().max(observed.len());
        let pair = |place| Pair {
            expected: expected.get(place).copied(),
            observed: observed.get(place).copied(),
        };
        let pairs: Vec<_> = (0..length).map(pair).collect();
        let rows: Vec<_> = pairs.chunks(WIDTH).map(<[Pair]>::to_vec).collect();
        (length > 0).then_some(Self { rows })
    }

    /// Whether the bytes are the same; their time is not, then.
    pub(crate) fn is_same(&self) -> bool {
        !self.rows.iter().flatten().any(|pair| pair.differs())
    }
}

/// `41`, or `--` for no byte.
pub(crate) fn cell(byte: Option<u8>) -> String {
    byte.map_or_else(|| "--".to_owned(), |byte| format!("{byte:02X}"))
}

/// The byte as a character; a full stop for what cannot be printed, a space for no
/// byte.
pub(crate) fn glyph(byte: Option<u8>) -> char {
    match byte {
        Some(byte @ b' '..=b'~') => char::from(byte),
        Some(_) => '.',
        None => ' ',
    }
}

/// The rows as lines of text: expected, observed, marks.
pub(crate) fn lines(difference: &Difference) -> Vec<String> {
    let mut lines = Vec::new();
    for row in &difference.rows {
        let side = |name: &str, of: fn(&Pair) -> Option<u8>| {
            let cells: String = row.iter().map(|pair| cell(of(pair)) + " ").collect();
            let glyphs: String = row.iter().map(|pair| glyph(of(pair))).collect();
            format!("{name}  {cells}|{glyphs}|")
        };
        lines.push(side("expected", |pair| pair.expected));
        lines.push(side("observed", |pair| pair.observed));
        let marks = row.iter().map(|pair| if pair.differs() { "^^ " } else { "   " });
        let marks = marks.collect::<String>();
        if row.iter().any(|pair| pair.differs()) {
            lines.push(format!("          {}", marks.trim_end()));
        }
    }
    if difference.is_same() {
        lines.push("          the same bytes at another time".to_owned());
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_stand_above_each_other() {
        let difference = Difference::new("414213", "4143").unwrap();
        let expected =
            ["expected  41 42 13 |AB.|", "observed  41 43 -- |AC |", "             ^^ ^^"];
        assert_eq!(lines(&difference), expected);
        let same = Difference::new("41", "41").unwrap();
        assert!(lines(&same).last().unwrap().ends_with("the same bytes at another time"));
    }

    #[test]
    fn long_runs_take_several_rows() {
        let difference = Difference::new(&"00".repeat(17), &"00".repeat(40)).unwrap();
        assert_eq!(difference.rows.iter().map(Vec::len).collect::<Vec<_>>(), [16, 16, 8]);
    }

    #[test]
    fn only_pairs_of_hex_digits_are_bytes() {
        assert_eq!(parse("0aF0"), Some(vec![0x0A, 0xF0]));
        assert_eq!(parse(""), Some(Vec::new()));
        for text in ["1", "0g", "+1", " 1", "é"] {
            assert_eq!(parse(text), None, "{text}");
        }
        assert_eq!(Difference::new("", ""), None);
    }
}
