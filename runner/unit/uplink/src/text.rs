//! Texts of the other side, for logs and people.

/// A text with its control characters escaped: whoever is at the other end must not write lines of
/// a log.
///
/// ```
/// let text = softplug_unit_uplink::plain_text("no\n2026-11-26 ERROR fire");
/// assert_eq!(text, "no\\n2026-11-26 ERROR fire");
/// ```
pub fn plain_text(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() {
            plain.extend(c.escape_default());
        } else {
            plain.push(c);
        }
    }
    plain
}
