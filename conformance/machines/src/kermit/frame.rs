//! Packets of the simulated machine, and what it says of itself.

use super::Options;

/// A packet that was read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Frame {
    pub(super) kind: u8,
    pub(super) number: u8,
    pub(super) data: Vec<u8>,
}

impl Frame {
    /// From what stood between SOH and CR.
    pub(super) fn read(heard: &[u8], check: usize) -> Option<Self> {
        let [length, number, kind, rest @ ..] = heard else { return None };
        let check = match kind {
            b'S' | b'R' => 1,
            b'N' => usize::from(length.checked_sub(34)?),
            _ => check,
        };
        let (body, own) = heard.split_at_checked(heard.len().checked_sub(check)?)?;
        let is_short = usize::from(*length) == heard.len() + 31;
        let is_good = sum(body, check) == own && (is_short || *length == b' ');
        let header = if is_short { 0 } else { 3 };
        let data = rest.get(header..rest.len().checked_sub(check)?)?;
        is_good.then(|| Self {
            kind: *kind,
            number: number.wrapping_sub(32) & 63,
            data: data.to_vec(),
        })
    }
}

/// The characters of a packet, SOH and CR included.
pub(super) fn framed(kind: u8, number: u8, data: &[u8], check: usize) -> Vec<u8> {
    let length = data.len() + check;
    let mut packet = Vec::new();
    if length + 2 > 94 {
        packet.extend([
            b' ',
            number + 32,
            kind,
            (length / 95) as u8 + 32,
            (length % 95) as u8 + 32,
        ]);
        packet.extend(sum(&packet, 1));
    } else {
        packet.extend([length as u8 + 34, number + 32, kind]);
    }
    packet.extend(data);
    packet.extend(sum(&packet, check));
    packet.insert(0, super::SOH);
    packet.push(super::CR);
    packet
}

/// The check, of one to three characters.
fn sum(bytes: &[u8], check: usize) -> Vec<u8> {
    let sum = bytes.iter().fold(0_u32, |sum, byte| sum + u32::from(*byte));
    let character = |bits: u32| (bits & 63) as u8 + 32;
    match check {
        1 => vec![character(sum + (sum >> 6 & 3))],
        2 => vec![character(sum >> 6), character(sum)],
        _ => {
            let crc = crc(bytes);
            vec![character(crc >> 12), character(crc >> 6), character(crc)]
        }
    }
}

/// CRC-16 with the polynomial 1021 hex, turned round and begun with 0: four bits at a time.
fn crc(bytes: &[u8]) -> u32 {
    let nibble = |crc: u32, bits: u8| (crc >> 4) ^ (((crc ^ u32::from(bits)) & 15) * 0x1081);
    bytes.iter().fold(0, |crc, byte| nibble(nibble(crc, byte & 15), byte >> 4))
}

/// What one side says of itself, or what both have agreed on.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    pub(super) check: usize,
    eighth: Option<u8>,
    repeat: Option<u8>,
    pub(super) long: Option<usize>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { check: 1, eighth: None, repeat: None, long: None }
    }
}

impl Parameters {
    pub(super) fn of(options: &Options) -> Self {
        let Options { check, eighth, repeat, long, .. } = *options;
        Self { check, eighth, repeat, long }
    }

    /// As S says it.
    pub(super) fn fields(&self) -> Vec<u8> {
        let long = self.long.unwrap_or(0);
        let mut fields = b"~* @-#".to_vec();
        fields.push(self.eighth.unwrap_or(b'Y'));
        fields.push(self.check as u8 + b'0');
        fields.push(self.repeat.unwrap_or(b' '));
        fields.push(if long > 0 { b'"' } else { b' ' });
        fields.extend([b' ', (long / 95) as u8 + 32, (long % 95) as u8 + 32]);
        fields
    }

    /// What an answer to our S makes of it.
    pub(super) fn agreed(&self, fields: &[u8]) -> Self {
        let field = |place: usize| fields.get(place).copied().unwrap_or(b' ');
        let named = |place, own: Option<u8>| own.filter(|own| field(place) == *own);
        let is_asked = !matches!(field(6), b'Y' | b'N' | b' ');
        let check = if field(7) == self.check as u8 + b'0' { self.check } else { 1 };
        let long = usize::from(field(11).max(32) - 32) * 95 + usize::from(field(12).max(32) - 32);
        Self {
            check,
            eighth: if is_asked {
                Some(field(6))
            } else {
                self.eighth.filter(|_| field(6) == b'Y')
            },
            repeat: named(8, self.repeat),
            long: self.long.filter(|_| field(9) & 2 != 0).map(|own| own.min(long)),
        }
    }

    /// What an S makes of it, and the answer.
    pub(super) fn answer(&self, fields: &[u8]) -> (Self, Vec<u8>) {
        let field = |place: usize| fields.get(place).copied().unwrap_or(b' ');
        let is_asked = !matches!(field(6), b'Y' | b'N' | b' ');
        let agreed = Self {
            check: usize::from(field(7).clamp(b'1', b'3') - b'0').min(self.check),
            eighth: if is_asked {
                Some(field(6))
            } else {
                self.eighth.filter(|_| field(6) == b'Y')
            },
            repeat: self.repeat.filter(|own| field(8) == *own),
            long: self.long.filter(|_| field(9) & 2 != 0),
        };
        let mut answer = agreed.fields();
        answer[6] = agreed.eighth.unwrap_or(b'N');
        let check = if field(7) == agreed.check as u8 + b'0' { agreed.check } else { 1 };
        answer[7] = check as u8 + b'0';
        (Self { check, ..agreed }, answer)
    }
}

/// Bytes as characters, at most so many; and how many bytes they stand for.
pub(super) fn encoded(bytes: &[u8], agreed: &Parameters, most: usize) -> (Vec<u8>, usize) {
    let prefixes = [Some(b'#'), agreed.eighth, agreed.repeat];
    let (mut characters, mut used) = (Vec::new(), 0);
    while let Some(byte) = bytes.get(used) {
        let run = bytes[used..].iter().take(94).take_while(|own| *own == byte).count();
        let mut unit = Vec::new();
        let count = match agreed.repeat {
            Some(prefix) if run > 3 => {
                unit.extend([prefix, run as u8 + 32]);
                run
            }
            _ => 1,
        };
        let mut own = *byte;
        if let Some(prefix) = agreed.eighth.filter(|_| own & 128 != 0) {
            unit.push(prefix);
            own &= 127;
        }
        match own & 127 {
            0..32 | 127 => unit.extend([b'#', own ^ 64]),
            low if prefixes.contains(&Some(low)) => unit.extend([b'#', own]),
            _ => unit.push(own),
        }
        if characters.len() + unit.len() > most {
            break;
        }
        characters.extend(unit);
        used += count;
    }
    (characters, used)
}

/// The bytes of these characters.
pub(super) fn decoded(characters: &[u8], agreed: &Parameters) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = characters.iter().copied();
    while let Some(mut own) = rest.next() {
        let (mut count, mut high) = (1, 0);
        if Some(own) == agreed.repeat {
            count = rest.next().unwrap_or(b' ').saturating_sub(32);
            own = rest.next().unwrap_or_default();
        }
        if Some(own) == agreed.eighth {
            high = 128;
            own = rest.next().unwrap_or_default();
        }
        if own == b'#' {
            own = rest.next().unwrap_or_default();
            if matches!(own & 127, 63..=95) {
                own ^= 64;
            }
        }
        bytes.extend(std::iter::repeat_n(own | high, usize::from(count)));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crc_is_that_of_the_catalogue() {
        assert_eq!(crc(b"123456789"), 0x2189);
    }

    #[test]
    fn packets_are_read_as_they_are_framed() {
        for check in 1..=3 {
            for length in [0, 5, 89, 90, 300] {
                let packet = framed(b'D', 63, &vec![b'x'; length], check);
                let heard = &packet[1..packet.len() - 1];
                let frame = Frame::read(heard, check).expect("it is good");
                assert_eq!((frame.kind, frame.number, frame.data.len()), (b'D', 63, length));
                let mut damaged = heard.to_vec();
                damaged[2] ^= 2;
                assert_eq!(Frame::read(&damaged, check), None);
            }
        }
    }
}
