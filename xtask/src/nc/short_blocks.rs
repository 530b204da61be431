//! Blocks of a few characters: the most line ends for a byte.

use super::random::Random;
use super::tape::{Length, Tape};

/// Steps of a tenth and less, one axis a block.
pub(super) fn short_blocks(tape: &mut Tape, random: &mut Random) {
    tape.closes_with("G90\nG0Z9.\n");
    tape.block("O5000\nG21\nG91\nG1\nF500");
    loop {
        let axis = random.one_of(&['X', 'Y', 'X', 'Y', 'Z']);
        let step = Length(random.between(-9, 9) * random.one_of(&[10, 100, 100, 1_000]));
        if !tape.block(format_args!("{axis}{step}")) {
            return;
        }
    }
}
