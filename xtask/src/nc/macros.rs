//! Programs that compute: variables, loops and jumps.

use super::random::Random;
use super::tape::{Length, Tape};

/// Pockets and bolt circles, each in a loop of its own.
pub(super) fn macros(tape: &mut Tape, random: &mut Random) {
    tape.closes_with("G0Z50.\nM5\n");
    tape.block("O4000(MACRO)\nG21G17G40G49G80G90\nG54\nT1M6\nS6000M3\nG43Z50.H1");
    // Sequence numbers have four digits: a jump finds the right one.
    for label in (10..=9_990).step_by(10) {
        let done = match random.between(0, 2) {
            0 => circle(tape, random, label),
            1 => pocket(tape, random, label),
            _ => choice(tape, random, label),
        };
        if !done {
            return;
        }
    }
    // So large a program has no number left: the rest is set-up of variables.
    while tape.block(format_args!(
        "#{}={}",
        random.between(500, 999),
        Length(random.between(-99_999, 99_999))
    )) {}
}

fn circle(tape: &mut Tape, random: &mut Random, label: i64) -> bool {
    tape.block(format_args!(
        "(BOLT CIRCLE {label})\n#1={}(CENTRE X)\n#2={}(CENTRE Y)\n#3={}(RADIUS)\n#4={}(HOLES)\n\
         #5=0\nWHILE[#5LT#4]DO1\n#6=#5*360/#4\n#7=#1+#3*COS[#6]\n#8=#2+#3*SIN[#6]\n\
         G99G83X#7Y#8Z-{}R2.Q3.F120\n#5=#5+1\nEND1\nG80",
        Length(random.between(-500, 500) * 100),
        Length(random.between(-500, 500) * 100),
        Length(random.between(50, 400) * 100),
        random.between(3, 24),
        Length(random.between(30, 250) * 100),
    ))
}

fn pocket(tape: &mut Tape, random: &mut Random, label: i64) -> bool {
    tape.block(format_args!(
        "(POCKET {label})\n#10={}(LENGTH)\n#11={}(WIDTH)\n#12=-{}(DEPTH)\n#13=0\n\
         WHILE[#13GT#12]DO1\n#13=#13-.5\nIF[#13GE#12]GOTO{label}\n#13=#12\nN{label}G1Z#13F200\n\
         #14=0\nWHILE[#14LT#11]DO2\nG1X#10F900\nY[#14+1.5]\nX0\n#14=#14+3\nY#14\nEND2\nG0Y0\n\
         END1\nG0Z50.",
        Length(random.between(20, 90) * 1_000),
        Length(random.between(20, 60) * 1_000),
        Length(random.between(10, 90) * 100),
    ))
}

fn choice(tape: &mut Tape, random: &mut Random, label: i64) -> bool {
    tape.block(format_args!(
        "#20={}\n#21=ABS[FIX[#20/3]]\nIF[#21EQ0]GOTO{label}\nIF[#21GT10]GOTO{one}\n\
         G1X[#21*2.5]Y-#20F600\nGOTO{two}\nN{one}G1X[#21/2]F800\nGOTO{two}\nN{label}G4P500\n\
         N{two}(DONE)",
        random.between(-40, 40),
        one = label + 1,
        two = label + 2,
    ))
}
