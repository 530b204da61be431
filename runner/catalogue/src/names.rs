//! How programs are named in their text: notations, each a form such as `O{number}`.
//!
//! A name that is read here is what a program says of itself. It is from the line: whoever makes a
//! file of it has to make it safe first.

use std::fmt::{self, Write as _};
use std::str::FromStr;

use crate::error::NotationError;

/// Bytes of a program that are looked at: it says its name near its beginning.
pub const HEAD_BYTES: usize = 2_048;
/// Lines with something in them that are looked at.
const LINES: usize = 10;
/// Most digits of a number.
const DIGITS: usize = 8;
/// Digits of a number that is written, where nothing else is said.
const USUAL_DIGITS: usize = 4;
/// Most characters of a name that is read.
const LONGEST: usize = 120;
/// Most characters of a form.
const LONGEST_FORM: usize = 80;

/// Notations that are read where nothing else is said, what is surer first. Not among them, as any
/// text has such lines: `({name})` and `PROGRAM {name}`.
pub const KNOWN_NOTATIONS: [&str; 13] = [
    "%_N_{name}",
    "O{number}",
    ":{number}",
    "O<{name}>",
    "<{name}>",
    "${name}.MIN%",
    "0 BEGIN PGM {name} MM",
    "0 BEGIN PGM {name} INCH",
    "%PM{line}N{number}",
    "%MPF{number}",
    "%SPF{number}",
    "%{name},",
    "%{name}",
];

/// One way in which a program says its name.
///
/// A form is text as it stands in a line, with one `{number}` (up to eight digits) or `{name}` in
/// it; `{line}` is the beginning of the next line. A blank stands for one or more. Capitals and small
/// letters are the same.
///
/// ```
/// use softplug_catalogue::Notation;
///
/// let notation: Notation = "O<{name}>".parse()?;
/// assert_eq!(notation.read(b"%\r\nO<FLANGE_7>(REV B)\r\n"), Some("FLANGE_7".to_owned()));
/// assert_eq!(notation.write("FLANGE_7", None), Some("O<FLANGE_7>".to_owned()));
/// assert!("O1234".parse::<Notation>().is_err());
/// # Ok::<(), softplug_catalogue::NotationError>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Notation {
    form: String,
    parts: Vec<Part>,
}

#[derive(Clone, PartialEq, Eq, Debug)]
enum Part {
    Literal(String),
    Number,
    Name,
    Line,
}

impl FromStr for Notation {
    type Err = NotationError;

    fn from_str(form: &str) -> Result<Self, NotationError> {
        let bad = || NotationError { form: form.chars().take(LONGEST_FORM).collect() };
        if form.chars().count() > LONGEST_FORM || form.chars().any(char::is_control) {
            return Err(bad());
        }
        let (mut parts, mut rest) = (Vec::new(), form);
        while !rest.is_empty() {
            let literal = rest.find('{').unwrap_or(rest.len());
            if literal > 0 {
                parts.push(Part::Literal(rest[..literal].to_owned()));
            }
            rest = &rest[literal..];
            let Some(inner) = rest.strip_prefix('{') else { break };
            let (key, after) = inner.split_once('}').ok_or_else(bad)?;
            parts.push(match key {
                "number" => Part::Number,
                "name" => Part::Name,
                "line" => Part::Line,
                _ => return Err(bad()),
            });
            rest = after;
        }
        let is_said = |part: &&Part| matches!(part, Part::Number | Part::Name);
        if parts.iter().filter(is_said).count() != 1 || form.contains("}{name}{") {
            return Err(bad());
        }
        Ok(Self { form: form.to_owned(), parts })
    }
}

impl fmt::Display for Notation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.form)
    }
}

impl Notation {
    /// The name that a program says near its beginning in this notation. A number is read with its
    /// letter, as in `O1234`; a colon counts as the O that it stands for. An ending that is joined
    /// with `_`, as in `%_N_{name}_MPF`, belongs to the name.
    pub fn read(&self, text: &[u8]) -> Option<String> {
        let text = head(text);
        let lines = lines(&text);
        (0..lines.len()).find_map(|at| self.read_at(&lines, at))
    }

    /// The text by which a program says this name: for one of digits `digits` of them, 4 where
    /// nothing else is said. `None`: the name cannot be said in this notation.
    pub fn write(&self, name: &str, digits: Option<u8>) -> Option<String> {
        let mut text = String::new();
        for (at, part) in self.parts.iter().enumerate() {
            match part {
                Part::Literal(literal) => text.push_str(literal),
                Part::Line => text.push('\n'),
                Part::Number => {
                    let number = number(name)?;
                    let digits = digits.map_or(USUAL_DIGITS, usize::from);
                    let _ = write!(text, "{number:0>digits$}");
                }
                Part::Name => {
                    let end = self.ending(at);
                    let name = strip_ending(name, end).unwrap_or(name);
                    let until = self.delimiter(at);
                    let is_fit =
                        |c: char| until.map_or(is_word(c), |until| is_text(c) && c != until);
                    let is_short = name.chars().count() <= LONGEST;
                    if name.is_empty() || !is_short || !name.chars().all(is_fit) {
                        return None;
                    }
                    text.push_str(name);
                }
            }
        }
        Some(text)
    }

    fn read_at(&self, lines: &[&str], at: usize) -> Option<String> {
        let line = lines[at];
        // Its programs do not say their names in their text.
        if !self.parts.iter().any(|part| matches!(part, Part::Literal(_))) {
            return None;
        }
        // So weak that only the first line counts.
        let is_weak =
            matches!(&self.parts[..], [Part::Literal(sign), Part::Name, ..] if sign == "%");
        if is_weak && at > 0 {
            return None;
        }
        let begins_with = |c: char| self.form.starts_with(c);
        let bare = line.strip_prefix('%').map(str::trim_start).filter(|_| !begins_with('%'));
        let block = without_block_number(bare.unwrap_or(line)).filter(|_| !begins_with('N'));
        let ways = [Some(line), bare, block];
        ways.into_iter().flatten().find_map(|line| self.matches(line, &lines[at + 1..]))
    }

    fn matches(&self, line: &str, next: &[&str]) -> Option<String> {
        let (mut rest, mut next, mut said) = (line, next.iter(), None);
        for (at, part) in self.parts.iter().enumerate() {
            match part {
                Part::Literal(literal) => rest = behind(rest, literal)?,
                Part::Line => rest = next.next()?,
                Part::Number => {
                    let count = rest.bytes().take_while(u8::is_ascii_digit).count();
                    let is_last = at + 1 == self.parts.len();
                    let is_word = is_last && rest[count..].starts_with(char::is_alphanumeric);
                    if !(1..=DIGITS).contains(&count) || is_word {
                        return None;
                    }
                    said = Some(format!("{}{}", self.letter(at), &rest[..count]));
                    rest = &rest[count..];
                }
                Part::Name => {
                    let (name, after) = self.name_at(rest, at)?;
                    said = Some(name);
                    rest = after;
                }
            }
        }
        said
    }

    /// What stands before a number in its name.
    fn letter(&self, at: usize) -> &str {
        let Some(Part::Literal(before)) = at.checked_sub(1).map(|before| &self.parts[before])
        else {
            return "";
        };
        if before.ends_with(':') {
            return "O";
        }
        before.rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default()
    }

    fn name_at<'a>(&self, rest: &'a str, at: usize) -> Option<(String, &'a str)> {
        let end = match self.delimiter(at) {
            Some(until) => rest.find(until)?,
            None => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
        };
        let mut run = &rest[..end];
        // A literal that could be a part of the name ends it where it comes last.
        if let Some(Part::Literal(next)) = self.parts.get(at + 1)
            && self.delimiter(at).is_none()
        {
            let places = (0..=run.len()).rev().filter(|place| rest.is_char_boundary(*place));
            let mut ends = places.filter(|place| behind(&rest[*place..], next).is_some());
            run = &rest[..ends.next()?];
        }
        let name = run.trim();
        let is_fit = (1..=LONGEST).contains(&name.chars().count())
            && name.chars().all(is_text)
            && name.contains(char::is_alphanumeric);
        is_fit.then(|| (format!("{name}{}", self.ending(at)), &rest[run.len()..]))
    }

    /// The sign behind a name, where it is none that a name could have.
    fn delimiter(&self, at: usize) -> Option<char> {
        let Some(Part::Literal(next)) = self.parts.get(at + 1) else { return None };
        next.chars().next().filter(|c| !is_word(*c))
    }

    /// What is joined to a name and belongs to it.
    fn ending(&self, at: usize) -> &str {
        match self.parts.get(at + 1) {
            Some(Part::Literal(next)) if next.starts_with('_') => next,
            _ => "",
        }
    }
}

/// The notations of a machine, in the order in which they are tried.
///
/// ```
/// use softplug_catalogue::Notations;
///
/// let notations = Notations::known();
/// assert_eq!(notations.name_in(b"%\nO1234 (PART A)\n").as_deref(), Some("O1234"));
/// assert_eq!(notations.name_in(b"0 BEGIN PGM FLANSCH MM\n").as_deref(), Some("FLANSCH"));
/// assert_eq!(notations.name_in(b"G1 X1\n"), None);
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Notations(Vec<Notation>);

impl Default for Notations {
    fn default() -> Self {
        Self::known()
    }
}

impl Notations {
    /// Those of [`KNOWN_NOTATIONS`].
    pub fn known() -> Self {
        let known = KNOWN_NOTATIONS.iter().map(|form| form.parse());
        Self(known.map(|known| known.expect("a test reads each of them")).collect())
    }

    /// These, and no others.
    pub fn of(notations: Vec<Notation>) -> Self {
        Self(notations)
    }

    /// These first, then the known ones.
    pub fn before_known(mut notations: Vec<Notation>) -> Self {
        notations.extend(Self::known().0);
        Self(notations)
    }

    /// The name that a program says near its beginning.
    pub fn name_in(&self, text: &[u8]) -> Option<String> {
        let text = head(text);
        let lines = lines(&text);
        let read = |at: usize| self.0.iter().find_map(|notation| notation.read_at(&lines, at));
        (0..lines.len()).find_map(read)
    }
}

/// Whether two names are one program: numbers with and without letter and leading zeros are the same,
/// and so are capitals and small letters.
///
/// ```
/// use softplug_catalogue::is_same_program;
///
/// assert!(is_same_program("O0012", "12") && is_same_program(":12", "o0012"));
/// assert!(is_same_program("Welle", "WELLE") && !is_same_program("O12", "O120"));
/// ```
pub fn is_same_program(one: &str, other: &str) -> bool {
    match (number(one), number(other)) {
        (Some(one), Some(other)) => one == other,
        (None, None) => one.to_uppercase() == other.to_uppercase(),
        _ => false,
    }
}

/// The number of a program, without letter and leading zeros.
fn number(name: &str) -> Option<&str> {
    let digits = name.strip_prefix(['O', 'o', ':']).unwrap_or(name);
    let is_number =
        (1..=DIGITS).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
    let plain = digits.trim_start_matches('0');
    is_number.then_some(if plain.is_empty() { "0" } else { plain })
}

/// The beginning as text: UTF-8, or else seven bits of each byte, as the eighth may be parity.
fn head(text: &[u8]) -> String {
    let head = &text[..text.len().min(HEAD_BYTES)];
    match std::str::from_utf8(head) {
        Ok(text) => text.to_owned(),
        // Cut in the middle of a character.
        Err(error) if error.error_len().is_none() => {
            String::from_utf8_lossy(&head[..error.valid_up_to()]).into_owned()
        }
        Err(_) => head.iter().map(|byte| (byte & 0x7f) as char).collect(),
    }
}

fn lines(text: &str) -> Vec<&str> {
    let lines = text.split(['\n', '\r']);
    let lines = lines.map(|line| line.trim_matches(|c: char| c.is_control() || c == ' '));
    lines.filter(|line| !line.is_empty()).take(LINES).collect()
}

/// What follows `literal` in `text`; a blank is one or more.
fn behind<'a>(text: &'a str, literal: &str) -> Option<&'a str> {
    let mut rest = text;
    for c in literal.chars() {
        if c == ' ' {
            let plain = rest.trim_start_matches([' ', '\t']);
            if plain.len() == rest.len() {
                return None;
            }
            rest = plain;
        } else {
            let next = rest.chars().next().filter(|next| next.eq_ignore_ascii_case(&c))?;
            rest = &rest[next.len_utf8()..];
        }
    }
    // A word that goes on is another one.
    let goes_on = literal.len() > 1
        && literal.ends_with(|c: char| c.is_ascii_alphabetic())
        && literal.starts_with(['_', ' '])
        && rest.starts_with(is_word);
    (!goes_on).then_some(rest)
}

fn strip_ending<'a>(name: &'a str, end: &str) -> Option<&'a str> {
    let at = name.len().checked_sub(end.len())?;
    let is_end =
        !end.is_empty() && name.is_char_boundary(at) && name[at..].eq_ignore_ascii_case(end);
    is_end.then(|| &name[..at])
}

/// Without the number of a block, such as `N10`.
fn without_block_number(line: &str) -> Option<&str> {
    let digits = line.strip_prefix(['N', 'n'])?;
    let rest = digits.trim_start_matches(|c: char| c.is_ascii_digit());
    (rest.len() < digits.len()).then(|| rest.trim_start())
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '+' | '#')
}

fn is_text(c: char) -> bool {
    !c.is_control()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn known(text: &str) -> Option<String> {
        Notations::known().name_in(text.as_bytes())
    }

    #[test]
    fn a_program_says_its_name_in_each_of_the_notations() {
        for (text, name) in [
            ("%\nO1234 (PART A)\nN10", "O1234"),
            ("\0\0\r\n%\r\n:0007\r\nN10", "O0007"),
            ("%\nO12345\nG0", "O12345"),
            ("%O12\n", "O12"),
            ("%O1234(NAME)\nN10", "O1234"),
            ("%\nN1O1234(PART)\n", "O1234"),
            ("N1:77\n", "O77"),
            ("%\nO<FLANGE_7+A.1>\n", "FLANGE_7+A.1"),
            ("%\n<SHAFT 12>(REV)\n", "SHAFT 12"),
            ("%_N_WELLE_12_MPF\n;$PATH=/_N_MPF_DIR\n", "WELLE_12_MPF"),
            ("%_N_L100_SPF\n", "L100_SPF"),
            ("%MPF123\n", "MPF123"),
            ("%SPF7\n", "SPF7"),
            ("$PART-1.MIN%\nG0\n", "PART-1"),
            ("0 BEGIN PGM FLANSCH MM\n", "FLANSCH"),
            ("0  BEGIN PGM PLATE INCH \n", "PLATE"),
            ("%PM\nN9001\nN1 G17", "N9001"),
            ("%BRACKET,MX,\nN10", "BRACKET"),
            ("%PLATTE G71 *\nN10", "PLATTE"),
            ("%100\nN10", "100"),
        ] {
            assert_eq!(known(text).as_deref(), Some(name), "{text:?}");
        }
        let with_parity: Vec<u8> = b"%\nO1234\nN10"
            .iter()
            .map(|byte| if byte.count_ones() % 2 == 1 { byte | 0x80 } else { *byte })
            .collect();
        assert_eq!(Notations::known().name_in(&with_parity).as_deref(), Some("O1234"));
    }

    #[test]
    fn what_is_no_name_is_none() {
        for text in [
            "%\nN10 G1 X10\nN20 O\n",
            "O123456789\n",
            "OXYGEN\nO12B\n",
            "",
            "%\n%\n",
            "%\n(PART A)\nG0 X1\n",
            "G1 X1\n%PART\n",
            "<>\n",
            "O<\n",
            "%\nPROGRAM X\n",
            "% PART\n",
            "$.MIN%\n",
        ] {
            assert_eq!(known(text), None, "{text:?}");
        }
        let late = format!("{}O1234\n", "G1 X1\n".repeat(LINES));
        assert_eq!(known(&late), None);
    }

    #[test]
    fn a_machine_has_notations_of_its_own_that_go_first() {
        let of = |form: &str, text: &[u8]| form.parse::<Notation>().unwrap().read(text);
        assert_eq!(of("({name})", b"%\n(DECKEL 7)\nG0").as_deref(), Some("DECKEL 7"));
        assert_eq!(of("PROGRAM {name}", b"program bolt_3\nG0").as_deref(), Some("bolt_3"));
        assert_eq!(of("%_N_{name}_MPF", b"%_N_A_MPF_B_MPF\n").as_deref(), Some("A_MPF_B_MPF"));
        assert_eq!(of("N1O{number}", b"N1O1234\n").as_deref(), Some("O1234"));
        assert_eq!(of("{name}", b"G1\n"), None);
        assert_eq!(of("%_N_{name}_MPF", b"%_N_A_SPF\n"), None);
        assert_eq!(of("%_N_{name}_MPF", b"%_N_A_MPFX\n"), None);
        let own = Notations::before_known(vec!["({name})".parse().unwrap()]);
        assert_eq!(own.name_in(b"%\n(DECKEL)\nO1\n").as_deref(), Some("DECKEL"));
        assert_eq!(own.name_in(b"%\nO1\n").as_deref(), Some("O1"));
        let only = Notations::of(vec!["({name})".parse().unwrap()]);
        assert_eq!(only.name_in(b"%\nO1\n"), None);
    }

    #[test]
    fn a_name_is_written_as_it_is_read() {
        for (form, name, text) in [
            ("O{number}", "O12", Some("O0012")),
            ("O{number}", "12", Some("O0012")),
            (":{number}", "O1234", Some(":1234")),
            ("O{number}", "PART", None),
            ("O{number}", "123456789", None),
            ("<{name}>", "A B", Some("<A B>")),
            ("<{name}>", "A>B", None),
            ("%_N_{name}_MPF", "WELLE", Some("%_N_WELLE_MPF")),
            ("%_N_{name}_MPF", "WELLE_MPF", Some("%_N_WELLE_MPF")),
            ("%_N_{name}_MPF", "W E", None),
            ("${name}.MIN%", "PART", Some("$PART.MIN%")),
            ("0 BEGIN PGM {name} MM", "X", Some("0 BEGIN PGM X MM")),
            ("%PM{line}N{number}", "9001", Some("%PM\nN9001")),
            ("<{name}>", "", None),
            ("<{name}>", "A\n", None),
        ] {
            let notation: Notation = form.parse().unwrap();
            assert_eq!(notation.write(name, None).as_deref(), text, "{form} {name}");
        }
        let haas: Notation = "O{number}".parse().unwrap();
        assert_eq!(haas.write("7", Some(5)).as_deref(), Some("O00007"));
    }

    #[test]
    fn a_form_says_one_thing() {
        for form in ["", "O", "{number}{name}", "{name}{name}", "O{digits}", "O{number", "\n{name}"]
        {
            assert!(form.parse::<Notation>().is_err(), "{form:?}");
        }
        let error = "O1234".parse::<Notation>().unwrap_err().to_string();
        assert_eq!(
            error,
            "\"O1234\" is no notation of a name: write one {number} or {name} into it, as in O{number} or <{name}>"
        );
        assert!("x".repeat(81).parse::<Notation>().is_err());
    }

    proptest! {
        #[test]
        fn whatever_comes_a_name_is_short_and_has_no_control_characters(
            text in proptest::collection::vec(any::<u8>(), 0..3_000),
            form in "[%O<$(]?\\{name\\}[>)_%, ]?",
        ) {
            let own = Notations::before_known(form.parse().into_iter().collect());
            if let Some(name) = own.name_in(&text) {
                prop_assert!(name.chars().count() <= LONGEST + LONGEST_FORM);
                prop_assert!(!name.is_empty() && !name.contains(char::is_control), "{:?}", name);
            }
        }

        #[test]
        fn what_is_written_is_read_again(name in "[A-Z][A-Z0-9_]{0,20}", at in 0..KNOWN_NOTATIONS.len()) {
            let notation: Notation = KNOWN_NOTATIONS[at].parse().unwrap();
            if let Some(text) = notation.write(&name, None) {
                let read = notation.read(format!("{text}\n").as_bytes());
                prop_assert!(read.is_some_and(|read| is_same_program(&read, &name)), "{}", text);
            }
        }
    }
}
