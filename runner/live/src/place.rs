//! Where something stands in a text.

/// The place of a byte in a text: line, and column in characters, both from 1. A place behind the end
/// is the end's.
///
/// ```
/// use softplug_live::place::line_and_column;
///
/// let text = "a = 1\nüb = 2\n";
/// assert_eq!((line_and_column(text, 0), line_and_column(text, 12)), ((1, 1), (2, 6)));
/// ```
pub fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..text.floor_char_boundary(at)];
    let begin = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[begin..].chars().count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_lines_and_characters() {
        let text = "a = 1\nüb = 2\n";
        assert_eq!(line_and_column(text, text.find('2').unwrap()), (2, 6));
        assert_eq!(line_and_column(text, 999), (3, 1));
        assert_eq!(line_and_column(text, 7), (2, 1), "in the middle of a character");
    }
}
