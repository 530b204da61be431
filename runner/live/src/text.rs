//! Texts of others, made fit to be shown.

/// A text in which nothing steers a terminal, begins another line or turns what stands beside it: such characters are
/// escaped. It is the one way for all that comes from elsewhere, a unit, a gateway or a file's name, to people and logs.
///
/// ```
/// use softplug_live::plain_text;
///
/// assert_eq!(plain_text("no\n2026-11-26 ERROR fire"), "no\\n2026-11-26 ERROR fire");
/// assert_eq!(plain_text("mill\u{202e}7\u{9b}2J \"Säge\""), "mill\\u{202e}7\\u{9b}2J \"Säge\"");
/// ```
pub fn plain_text(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        if is_plain(c) {
            plain.push(c);
        } else {
            plain.extend(c.escape_debug());
        }
    }
    plain
}

/// Whether a character is seen as itself: no control character, no mark of direction, nothing that
/// is not seen, and nothing that Unicode does not know.
///
/// ```
/// use softplug_live::is_plain;
///
/// assert!("aä\"\\ \u{301}".chars().all(is_plain));
/// assert!(!"\u{1b}\u{7f}\u{9b}\u{85}\u{ad}\u{200b}\u{2028}\u{202e}\u{2066}\u{feff}\u{e0041}".chars().any(is_plain));
/// ```
pub fn is_plain(c: char) -> bool {
    if c.is_ascii() {
        return !c.is_ascii_control();
    }
    // Behind another one, where marks that join it are as good as letters.
    let mut bytes = [b'x'; 5];
    let end = 1 + c.encode_utf8(&mut bytes[1..]).len();
    std::str::from_utf8(&bytes[..end]).is_ok_and(|text| text.escape_debug().count() == 2)
}
