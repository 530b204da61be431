//! Texts from outside, made fit for terminals, pages and logs.

use std::fmt::Write;

/// Characters of one text that are shown.
const SHOWN: usize = 4000;

/// The text with every character written out that a reader would not see, or that
/// would change how the rest is read; tab and line end stay. Too long a text is cut.
pub(crate) fn visible(text: &str) -> String {
    let mut shown = String::with_capacity(text.len().min(SHOWN));
    for (number, character) in text.chars().enumerate() {
        if number == SHOWN {
            let more = text.chars().count() - SHOWN;
            let _ = write!(shown, "… ({more} more characters)");
            break;
        }
        if is_hidden(character) {
            let _ = write!(shown, "\\u{{{:X}}}", u32::from(character));
        } else {
            shown.push(character);
        }
    }
    shown
}

/// The visible text on one line.
pub(crate) fn line(text: &str) -> String {
    visible(text).replace('\n', "\\n").replace('\t', " ")
}

/// The visible text in quotes, at most 120 characters of it, for use in a sentence.
pub(crate) fn quoted(text: &str) -> String {
    let mut short: String = text.chars().take(120).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    format!("\"{}\"", line(&short))
}

fn is_hidden(character: char) -> bool {
    match character {
        '\n' | '\t' => false,
        _ if character.is_control() => true,
        // Soft hyphen, zero widths, marks of direction, separators, byte order mark,
        // annotations, variation selectors, tags, fillers.
        '\u{AD}'
        | '\u{34F}'
        | '\u{61C}'
        | '\u{115F}'
        | '\u{1160}'
        | '\u{17B4}'
        | '\u{17B5}'
        | '\u{180B}'..='\u{180F}'
        | '\u{200B}'..='\u{200F}'
        | '\u{2028}'..='\u{202E}'
        | '\u{2060}'..='\u{206F}'
        | '\u{3164}'
        | '\u{FE00}'..='\u{FE0F}'
        | '\u{FEFF}'
        | '\u{FFA0}'
        | '\u{FFF0}'..='\u{FFFB}'
        | '\u{FFFE}'..='\u{FFFF}'
        | '\u{E0000}'..='\u{E0FFF}' => true,
        _ => false,
    }
}

/// µs as seconds with six digits, as in traces.
pub(crate) fn seconds(at_us: i64) -> String {
    let sign = if at_us < 0 { "-" } else { "" };
    let at = at_us.unsigned_abs();
    format!("{sign}{}.{:06}", at / 1_000_000, at % 1_000_000)
}

/// Line and column of an error in a JSON text, and what is wrong there.
pub(crate) fn json_error(error: &serde_json::Error) -> (usize, usize, String) {
    let (at_line, column) = (error.line(), error.column());
    let message = error.to_string();
    // The place stands in front already.
    let place = format!(" at line {at_line} column {column}");
    (at_line, column, line(message.strip_suffix(&place).unwrap_or(&message)))
}

/// `1 case`, `2 cases`.
pub(crate) fn count(number: u32, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_reader_would_not_see_is_written_out() {
        assert_eq!(
            visible("a\u{1B}[31m\u{202E}b\u{200B}\n\t"),
            "a\\u{1B}[31m\\u{202E}b\\u{200B}\n\t"
        );
        assert_eq!(line("a\nb\tc\r"), "a\\nb c\\u{D}");
        assert_eq!(visible("Größe “x” 日本 🙂"), "Größe “x” 日本 🙂");
    }

    #[test]
    fn long_texts_are_cut_and_say_so() {
        let shown = visible(&"x".repeat(SHOWN + 5));
        assert!(shown.ends_with("x… (5 more characters)"));
        assert_eq!(visible(&"x".repeat(SHOWN)).len(), SHOWN);
        assert_eq!(quoted(&"é".repeat(121)), format!("\"{}…\"", "é".repeat(120)));
    }

    #[test]
    fn times_read_as_in_traces() {
        assert_eq!(seconds(0), "0.000000");
        assert_eq!(seconds(2_001_146), "2.001146");
        assert_eq!(seconds(-1), "-0.000001");
        assert_eq!(seconds(i64::MIN), "-9223372036854.775808");
    }
}
