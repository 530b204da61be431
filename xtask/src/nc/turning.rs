//! Turned parts: roughing, finishing, grooves and a thread.

use super::random::Random;
use super::tape::{Length, Tape};

/// One part after the other; diameters in X.
pub(super) fn turning(tape: &mut Tape, random: &mut Random) {
    tape.closes_with("G0X200.Z200.\nM9\nM5\n");
    tape.block("O3000(TURNED PARTS)\nG21G40G80G97G99");
    for part in 1.. {
        let first = 100 + part % 90 * 100;
        if !contour(tape, random, part, first) || !groove(tape, random) || !thread(tape, random) {
            return;
        }
    }
}

/// G71 names the blocks of the contour by number, so all of it stands or none.
fn contour(tape: &mut Tape, random: &mut Random, part: i64, first: i64) -> bool {
    use std::fmt::Write;

    let mut blocks = String::new();
    let (mut x, mut z) = (random.between(80, 200) * 100, 0);
    let steps = random.between(3, 8);
    for step in 0..steps {
        z -= random.between(40, 300) * 100;
        let _ = writeln!(blocks, "G1Z{}F.15", Length(z));
        let rise = random.between(10, 60) * 100;
        let line = match step % 3 {
            0 => format!("X{}", Length(x + rise)),
            1 => format!("X{}W-{}", Length(x + rise), Length(rise / 2)),
            _ => format!("G2X{}W-{}R{}", Length(x + rise), Length(rise / 2), Length(rise / 2)),
        };
        if step % 3 != 0 {
            z -= rise / 2;
        }
        x += rise;
        let _ = writeln!(blocks, "{line}");
    }
    let start = x + 4_000;
    tape.block(format_args!(
        "(PART {part})\nT0101(ROUGHING)\nG50S2500\nG96S180M3\nG0X{start}Z2.M8\nG71U2.R.5\n\
         G71P{first}Q{last}U.4W.1F.25\nN{first}G0X{x}\n{blocks}N{last}X{start}\nG0X200.Z200.\n\
         T0202(FINISHING)\nG96S240M3\nG0X{start}Z2.\nG70P{first}Q{last}\nG0X200.Z200.",
        start = Length(start),
        last = first + 99,
        x = Length(random.between(60, 79) * 100),
    ))
}

fn groove(tape: &mut Tape, random: &mut Random) -> bool {
    let x = random.between(100, 300) * 100;
    tape.block(format_args!(
        "T0303(GROOVE)\nG97S900M3\nG0X{}Z-{}\nG75R.5\nG75X{}Z-{}P1500Q2000F.08\nG0X200.Z200.",
        Length(x + 2_000),
        Length(random.between(50, 200) * 100),
        Length(x - random.between(10, 30) * 100),
        Length(random.between(210, 300) * 100),
    ))
}

fn thread(tape: &mut Tape, random: &mut Random) -> bool {
    let (diameter, pitch, depth) = random.one_of(&[
        (10_000, 1_500, 920),
        (12_000, 1_750, 1_074),
        (16_000, 2_000, 1_227),
        (20_000, 2_500, 1_534),
        (24_000, 3_000, 1_840),
    ]);
    tape.block(format_args!(
        "T0404(THREAD)\nG97S{}M3\nG0X{}Z5.\nG76P010060Q100R.05\n\
         G76X{}Z-{}P{depth}Q350F{}\nG0X200.Z200.",
        random.between(4, 9) * 100,
        Length(diameter + 4_000),
        Length(diameter - 2 * depth),
        Length(random.between(150, 400) * 100),
        Length(pitch),
    ))
}
