//! Patterns of case ids.

/// Whether an id fits a pattern in which `*` stands for any characters and `?` for one.
///
/// ```
/// use softplug_conformance::certify::matches;
///
/// assert!(matches("xon-xoff.tx.*", "xon-xoff.tx.hold"));
/// assert!(!matches("xon-xoff.?.hold", "xon-xoff.tx.hold"));
/// ```
pub fn matches(pattern: &str, text: &str) -> bool {
    let (pattern, text) = (pattern.as_bytes(), text.as_bytes());
    let (mut p, mut t) = (0, 0);
    // Behind the last star, and how much of the text it took.
    let mut star: Option<(usize, usize)> = None;
    while t < text.len() {
        match (pattern.get(p), star) {
            (Some(b'*'), _) => {
                p += 1;
                star = Some((p, t));
            }
            (Some(byte), _) if *byte == b'?' || *byte == text[t] => {
                p += 1;
                t += 1;
            }
            (_, Some((behind, taken))) => {
                star = Some((behind, taken + 1));
                p = behind;
                t = taken + 1;
            }
            _ => return false,
        }
    }
    pattern[p..].iter().all(|byte| *byte == b'*')
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn stars_stand_for_any_characters_and_question_marks_for_one() {
        for pattern in ["a.tx.hold", "*", "a.*", "*.hold", "a.*.h?ld", "**", "a.tx.hold*", "*t*d"] {
            assert!(matches(pattern, "a.tx.hold"), "{pattern}");
        }
        for pattern in ["", "a", "a.tx", "?", "*.hol", "b*", "a.?.hold", "a.tx.hold?", "A.*"] {
            assert!(!matches(pattern, "a.tx.hold"), "{pattern}");
        }
        assert!(matches("", ""));
        // Many stars must not take for ever.
        assert!(!matches(&"*a".repeat(60), &"a".repeat(59)));
    }
}
