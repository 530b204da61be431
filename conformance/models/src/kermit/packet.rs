//! Packets and their checks.

pub(super) const SOH: u8 = 0x01;
pub(super) const CR: u8 = 0x0D;

/// A number as a character.
pub(super) fn character(number: usize) -> u8 {
    number as u8 + 32
}

/// The number of a character; those that stand for none are 0.
pub(super) fn number(character: u8) -> usize {
    usize::from(character.max(32) - 32)
}

/// The check of these characters.
pub(super) fn check(characters: &[u8], kind: usize) -> Vec<u8> {
    let sum: usize = characters.iter().map(|own| usize::from(*own)).sum();
    match kind {
        1 => vec![character((sum + sum / 64 % 4) % 64)],
        2 => vec![character(sum / 64 % 64), character(sum % 64)],
        _ => {
            let crc = crc(characters);
            vec![character(crc / 4_096), character(crc / 64 % 64), character(crc % 64)]
        }
    }
}

/// X^16 + X^12 + X^5 + 1, the lowest bit first: 8408 hex is the polynomial turned round.
fn crc(characters: &[u8]) -> usize {
    let mut rest = 0;
    for own in characters {
        for place in 0..8 {
            let bit = usize::from(own >> place & 1);
            let is_set = (rest % 2) != bit;
            rest /= 2;
            if is_set {
                rest ^= 0x8408;
            }
        }
    }
    rest
}

/// A packet. It is long where a short one would have more than `most` as its length.
pub(super) fn packet(kind: u8, own: u8, data: &[u8], check_kind: usize, most: usize) -> Vec<u8> {
    let length = data.len() + check_kind + 2;
    let own = character(usize::from(own));
    let mut body = vec![character(length.min(94)), own, kind];
    if length > most {
        let long = data.len() + check_kind;
        body = vec![character(0), own, kind, character(long / 95), character(long % 95)];
        body.extend(check(&body, 1));
    }
    body.extend(data);
    body.extend(check(&body, check_kind));
    body.insert(0, SOH);
    body
}

/// A good packet.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Packet {
    pub(super) kind: u8,
    pub(super) number: u8,
    pub(super) data: Vec<u8>,
    /// All of it, without SOH.
    pub(super) all: Vec<u8>,
}

/// What has come behind SOH so far.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    Part,
    Bad,
    Good(Packet),
}

/// Most characters behind SOH that are heard: 16 more than are announced.
const MOST: usize = 1_016;

/// What these characters behind SOH are, with the check that a type has.
pub(super) fn heard(all: &[u8], check_of: impl Fn(u8) -> usize) -> Heard {
    let [first, ..] = all else { return Heard::Part };
    if *first < 32 {
        return Heard::Bad;
    }
    let length = number(*first);
    let (header, whole) = match length {
        0 if all.len() < 6 => return Heard::Part,
        0 => {
            let long = number(all[3]) * 95 + number(all[4]);
            if check(&all[..5], 1) != [all[5]] || long == 0 || long + 6 > MOST {
                return Heard::Bad;
            }
            (6, 6 + long)
        }
        3..=94 => (3, length + 1),
        _ => return Heard::Bad,
    };
    if all.len() < whole {
        return Heard::Part;
    }
    let kind = all[2];
    let check_kind = match (kind, length) {
        (b'N', 3..=5) => length - 2,
        _ => check_of(kind),
    };
    if whole < header + check_kind || !(32..96).contains(&all[1]) {
        return Heard::Bad;
    }
    let (before, own) = all.split_at(whole - check_kind);
    if check(before, check_kind) != own {
        return Heard::Bad;
    }
    let own = number(all[1]) as u8;
    Heard::Good(Packet { kind, number: own, data: before[header..].to_vec(), all: all.to_vec() })
}
