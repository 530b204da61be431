//! Characters that a reviewer would not see.

/// Whether a character hides from a reviewer: controls, and marks that turn
/// the direction of text.
pub(crate) fn forbidden(c: char) -> bool {
    (c.is_control() && c != '\t')
        || matches!(c, '\u{061C}' | '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}' | '\u{FEFF}')
}
