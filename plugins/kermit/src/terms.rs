//! What two sides agree on before a transfer: the data of S and I, and of the answers to them.

use crate::coding::{Coding, EIGHTH, QUOTE, REPEAT, from_char, is_prefix, to_char};
use crate::packet::{END, SHORT};
use crate::settings::{EighthBit, Settings};
use softplug_plugin::State;

/// Fields that we send.
pub(crate) const FIELDS: usize = 13;
/// The bit of the capabilities for long packets, and the one for more of them.
const LONG: u8 = 2;
const MORE: u8 = 1;
/// What a side takes that says nothing of it.
const USUAL_LENGTH: u8 = 80;
const USUAL_LONG: usize = 500;
/// The least that we believe somebody to take.
const LEAST: u8 = 20;

/// What has been agreed.
#[derive(Copy, Clone, Debug, State)]
#[state(check = Self::is_sound)]
pub(crate) struct Terms {
    /// How the other side encodes.
    pub(crate) theirs: Coding,
    /// How we encode.
    pub(crate) ours: Coding,
    pub(crate) check: u8,
    /// The greatest length of a short packet.
    pub(crate) short: u8,
    /// So many of these go before each packet, and this one behind it.
    pub(crate) padding: u8,
    pub(crate) pad: u8,
    pub(crate) end: u8,
    /// The greatest of a whole long one; 0: none are sent.
    pub(crate) long: u16,
}

impl Terms {
    /// What holds before anything is agreed.
    pub(crate) const fn usual() -> Self {
        let coding = Coding { quote: QUOTE, eighth: 0, repeat: 0 };
        Self {
            theirs: coding,
            ours: coding,
            check: 1,
            short: USUAL_LENGTH,
            long: 0,
            padding: 0,
            pad: 0,
            end: END,
        }
    }

    /// Takes what an answer to our S says.
    pub(crate) fn agreed(settings: &Settings, is_narrow: bool, fields: &[u8]) -> Self {
        let mut terms = Self::told(settings, fields);
        let field = |place: usize| fields.get(place).copied().unwrap_or(b' ');
        let eighth = match (offered_eighth(settings, is_narrow), field(6)) {
            (EIGHTH, b'Y') => terms.prefix(EIGHTH, 0),
            (EIGHTH, own) if own != EIGHTH => 0,
            (_, own) => terms.prefix(own, 0),
        };
        let repeat = if settings.repeat_prefix && field(8) == REPEAT {
            terms.prefix(REPEAT, eighth)
        } else {
            0
        };
        let is_agreed = i64::from(field(7)) == i64::from(b'0') + settings.check;
        terms.check = if is_agreed { settings.check as u8 } else { 1 };
        terms.set_prefixes(eighth, repeat);
        terms
    }

    /// Takes what an S or I says, and makes the answer to it.
    pub(crate) fn answer(
        settings: &Settings,
        is_narrow: bool,
        fields: &[u8],
    ) -> (Self, [u8; FIELDS]) {
        let mut terms = Self::told(settings, fields);
        let mut reply = offer(settings, is_narrow);
        let field = |place: usize| fields.get(place).copied().unwrap_or(b' ');
        let eighth = match (offered_eighth(settings, is_narrow), field(6)) {
            (EIGHTH, b'Y') => terms.prefix(EIGHTH, 0),
            (_, own) => terms.prefix(own, 0),
        };
        reply[6] = if eighth == 0 { b'N' } else { eighth };
        let repeat = if settings.repeat_prefix { terms.prefix(field(8), eighth) } else { 0 };
        reply[8] = if repeat == 0 { b' ' } else { repeat };
        let kind = field(7).wrapping_sub(b'0');
        let is_good = (1..=settings.check).contains(&i64::from(kind));
        terms.check = if is_good { kind } else { 1 };
        reply[7] = b'0' + terms.check;
        if terms.long == 0 {
            reply[9] = to_char(0);
        }
        terms.set_prefixes(eighth, repeat);
        (terms, reply)
    }

    /// The prefix, if it can be one beside the others.
    fn prefix(&self, own: u8, eighth: u8) -> u8 {
        let is_free = own != QUOTE && own != self.theirs.quote && own != eighth;
        if is_prefix(own) && is_free { own } else { 0 }
    }

    fn set_prefixes(&mut self, eighth: u8, repeat: u8) {
        self.theirs = Coding { eighth, repeat, ..self.theirs };
        self.ours = Coding { eighth, repeat, ..self.ours };
    }

    /// What the other side wants of the packets that it gets.
    fn told(settings: &Settings, fields: &[u8]) -> Self {
        let usual = Self::usual();
        let field = |place: usize| fields.get(place).copied();
        let most = settings.packet_length as u16;
        let number = |place| field(place).map(from_char);
        let quote = field(5).filter(|own| is_prefix(*own)).unwrap_or(QUOTE);
        let length = number(0).unwrap_or(USUAL_LENGTH).clamp(LEAST, SHORT as u8);
        Self {
            theirs: Coding { quote, ..usual.theirs },
            short: length.min(most.min(SHORT as u16) as u8),
            long: if is_long(settings) { told_long(fields).min(most) } else { 0 },
            padding: number(2).filter(|count| *count <= SHORT as u8).unwrap_or(0),
            pad: field(3).map_or(0, |pad| (pad ^ 0x40) & 0x7F),
            end: number(4).filter(|end| (1..32).contains(end)).unwrap_or(END),
            ..usual
        }
    }

    fn is_sound(&self) -> bool {
        (1..=3).contains(&self.check)
            && (LEAST..=SHORT as u8).contains(&self.short)
            && usize::from(self.long) <= crate::packet::MOST
            && self.padding <= SHORT as u8
    }
}

fn is_long(settings: &Settings) -> bool {
    settings.packet_length > SHORT as i64
}

/// The longest packet that they take; 0: no long one.
fn told_long(fields: &[u8]) -> u16 {
    let mut place = 9;
    let capabilities = fields.get(place).copied().map_or(0, from_char);
    if capabilities & LONG == 0 {
        return 0;
    }
    // More of them follow behind each that says so.
    while fields.get(place).is_some_and(|own| from_char(*own) & MORE != 0) {
        place += 1;
    }
    let number = |place: usize| fields.get(place).map(|own| usize::from(from_char(*own)));
    let long = match (number(place + 2), number(place + 3)) {
        (Some(high), Some(low)) => high * 95 + low,
        _ => USUAL_LONG,
    };
    if long < usize::from(LEAST) { 0 } else { long as u16 }
}

fn offered_eighth(settings: &Settings, is_narrow: bool) -> u8 {
    if is_narrow || settings.eighth_bit == EighthBit::Prefix { EIGHTH } else { b'Y' }
}

/// What our S says.
pub(crate) fn offer(settings: &Settings, is_narrow: bool) -> [u8; FIELDS] {
    let most = settings.packet_length as usize;
    let seconds = ((settings.packet_time + 999) / 1_000).clamp(1, 94) as u8;
    [
        to_char(most.min(SHORT) as u8),
        to_char(seconds),
        to_char(0),
        b'@',
        to_char(END),
        QUOTE,
        offered_eighth(settings, is_narrow),
        b'0' + settings.check as u8,
        if settings.repeat_prefix { REPEAT } else { b' ' },
        to_char(if is_long(settings) { LONG } else { 0 }),
        to_char(0),
        to_char((most / 95) as u8),
        to_char((most % 95) as u8),
    ]
}
