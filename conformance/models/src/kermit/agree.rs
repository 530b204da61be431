//! What both sides agree on.

use super::packet::{CR, number};
use super::rules::Rules;

/// What holds for a transfer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Agreed {
    pub(super) their_quote: u8,
    pub(super) eighth: Option<u8>,
    pub(super) repeat: Option<u8>,
    pub(super) check: usize,
    /// The greatest length of a short packet, and all of a long one, if there are any.
    pub(super) short: usize,
    pub(super) long: Option<usize>,
    pub(super) padding: Vec<u8>,
    pub(super) end: u8,
}

impl Agreed {
    /// Before anything is agreed on.
    pub(super) fn nothing() -> Self {
        Self {
            their_quote: b'#',
            eighth: None,
            repeat: None,
            check: 1,
            short: 80,
            long: None,
            padding: Vec::new(),
            end: CR,
        }
    }

    /// What the fields say of what the other side takes.
    fn said(fields: &[u8], rules: &Rules) -> Self {
        let field = |place: usize| fields.get(place).copied();
        let count = field(2).map_or(0, number);
        let pad = field(3).map_or(0, |pad| (pad ^ 64) % 128);
        let end = field(4).map_or(13, number);
        Self {
            their_quote: field(5).filter(|own| can_be_prefix(*own)).unwrap_or(b'#'),
            short: field(0).map_or(80, number).clamp(20, 94).min(rules.packet_length),
            long: said_long(fields)
                .filter(|_| rules.packet_length > 94)
                .map(|long| long.min(rules.packet_length)),
            padding: vec![pad; if count <= 94 { count } else { 0 }],
            end: if (1..32).contains(&end) { end as u8 } else { CR },
            ..Self::nothing()
        }
    }

    /// From the answer to our S.
    pub(super) fn answered(fields: &[u8], rules: &Rules) -> Self {
        let mut agreed = Self::said(fields, rules);
        let field = |place: usize| fields.get(place).copied().unwrap_or(b' ');
        let eighth = match (rules.wants_eighth, field(6)) {
            (true, b'Y' | b'&') => Some(b'&'),
            (true, _) => None,
            (false, own) => Some(own),
        };
        agreed.eighth = eighth.filter(|own| agreed.is_free(*own));
        if rules.repeat_prefix && field(8) == b'~' {
            agreed.repeat = Some(b'~').filter(|own| agreed.is_free(*own));
        }
        if number(field(7)) == rules.check + 16 {
            agreed.check = rules.check;
        }
        agreed
    }

    /// From an S; and what we answer.
    pub(super) fn asked(fields: &[u8], rules: &Rules) -> (Self, Vec<u8>) {
        let mut agreed = Self::said(fields, rules);
        let field = |place: usize| fields.get(place).copied().unwrap_or(b' ');
        let own = if rules.wants_eighth && field(6) == b'Y' { b'&' } else { field(6) };
        agreed.eighth = Some(own).filter(|own| agreed.is_free(*own));
        if rules.repeat_prefix {
            agreed.repeat = Some(field(8)).filter(|own| agreed.is_free(*own));
        }
        let kind = usize::from(field(7)).saturating_sub(48);
        if (1..=rules.check).contains(&kind) {
            agreed.check = kind;
        }
        let mut answer = rules.offer();
        answer[6] = agreed.eighth.unwrap_or(b'N');
        answer[7] = 48 + agreed.check as u8;
        answer[8] = agreed.repeat.unwrap_or(b' ');
        if agreed.long.is_none() {
            answer[9] = b' ';
        }
        (agreed, answer)
    }

    /// Whether the character can be a prefix and is none yet.
    fn is_free(&self, own: u8) -> bool {
        can_be_prefix(own)
            && own != b'#'
            && own != self.their_quote
            && Some(own) != self.eighth
            && Some(own) != self.repeat
    }
}

fn can_be_prefix(own: u8) -> bool {
    (33..=62).contains(&own) || (96..=126).contains(&own)
}

/// The longest packet that the fields tell of.
fn said_long(fields: &[u8]) -> Option<usize> {
    let capabilities = fields.get(9..)?;
    if (number(*capabilities.first()?) / 2).is_multiple_of(2) {
        return None;
    }
    let more = capabilities.iter().take_while(|own| number(**own) % 2 == 1).count();
    let long = match capabilities.get(more + 2..more + 4) {
        Some([high, low]) => number(*high) * 95 + number(*low),
        _ => 500,
    };
    Some(long).filter(|long| *long >= 20)
}
