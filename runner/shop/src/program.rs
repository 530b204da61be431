//! An NC program without an end, in which each line is another.

/// Bytes of a line.
const LINE: u64 = 32;

/// Writes the program's bytes from `position` on.
pub(crate) fn write(position: u64, buffer: &mut [u8]) {
    let (mut number, mut at) = (position / LINE, (position % LINE) as usize);
    let mut rest = buffer;
    while !rest.is_empty() {
        let line = line(number);
        let count = rest.len().min(line.len() - at);
        let (now, then) = std::mem::take(&mut rest).split_at_mut(count);
        now.copy_from_slice(&line[at..at + count]);
        (number, at, rest) = (number + 1, 0, then);
    }
}

fn line(number: u64) -> [u8; LINE as usize] {
    let mut line = *b"N0000000000 G1 X000.000 Y00.000\n";
    digits(&mut line[1..11], number);
    digits(&mut line[16..19], number * 7);
    digits(&mut line[25..27], number * 13);
    line
}

/// The last digits of a number, as many as there is place for.
fn digits(place: &mut [u8], mut number: u64) {
    for digit in place.iter_mut().rev() {
        *digit = b'0' + (number % 10) as u8;
        number /= 10;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_come_to_the_whole() {
        let mut whole = [0; 100];
        write(0, &mut whole);
        assert!(whole.starts_with(b"N0000000000 G1 X000.000 Y00.000\nN0000000001 G1 X007."));
        for cut in 0..100 {
            let mut pieces = [0; 100];
            write(0, &mut pieces[..cut]);
            write(cut as u64, &mut pieces[cut..]);
            assert_eq!(pieces, whole);
        }
    }
}
