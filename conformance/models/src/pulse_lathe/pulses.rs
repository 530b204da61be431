//! What pulses in which period, from the page's tables, each period on its own.

/// A byte and the clause that asks for it.
pub(super) type Due = (u8, &'static str);

/// One step: a pulse of x, of z, or of both, with directions.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Step {
    pub(super) x: i64,
    pub(super) z: i64,
    /// On an arc a step of x is two pulses.
    pub(super) doubled: bool,
}

/// Parts of a step a period: the whole is 2²⁰.
pub(super) const WHOLE: u64 = 1 << 20;

/// Periods that a model goes through at most: more than [`MOST_BYTES`](super::program::MOST_BYTES).
const MOST_PERIODS: u64 = 100_000;

fn byte(x: i64, z: i64) -> u8 {
    let mut byte = 0;
    if x != 0 {
        byte |= 0x01;
    }
    if x < 0 {
        byte |= 0x02;
    }
    if z != 0 {
        byte |= 0x04;
    }
    if z < 0 {
        byte |= 0x08;
    }
    byte
}

/// The periods of one cut. Step n leaves in the period in which n whole steps have been fed;
/// the second pulse of a step of x is a period of its own, in which nothing is fed.
pub(super) fn cut(steps: &[Step], feed: u64, clause: &'static str) -> Vec<Due> {
    let mut bytes = Vec::new();
    let mut periods = 0_u64;
    for (number, step) in steps.iter().enumerate() {
        let needed = ((number as u64 + 1) * WHOLE).div_ceil(feed);
        // Nobody looks at the rest.
        if needed > MOST_PERIODS {
            bytes.resize(MOST_PERIODS as usize, (0x00, clause));
            break;
        }
        while periods + 1 < needed {
            bytes.push((0x00, "pulse-lathe.cut.feed"));
            periods += 1;
        }
        periods += 1;
        bytes.push((byte(step.x, step.z), clause));
        if step.doubled && step.x != 0 {
            bytes.push((byte(step.x, 0), "pulse-lathe.cut.arc-pulses"));
        }
    }
    let last = bytes.len().saturating_sub(1);
    for (byte, _) in &mut bytes[..last] {
        *byte |= 0x40;
    }
    bytes
}

/// A line whose minor axis has made `minor(n)` pulses behind pulse n of the main one.
fn steps(
    main: u64,
    minor: impl Fn(u64) -> u64,
    z_is_main: bool,
    (x_sign, z_sign): (i64, i64),
) -> Vec<Step> {
    (1..=main)
        .map(|n| {
            let other = minor(n) > minor(n - 1);
            let (x, z) = if z_is_main { (other, true) } else { (true, other) };
            Step { x: x_sign * i64::from(x), z: z_sign * i64::from(z), doubled: false }
        })
        .collect()
}

/// From here by so many pulses of x and z.
pub(super) fn line(x: i64, z: i64) -> Vec<Step> {
    let (x_size, z_size) = (x.unsigned_abs(), z.unsigned_abs());
    let z_is_main = z_size >= x_size;
    let (main, minor) = if z_is_main { (z_size, x_size) } else { (x_size, z_size) };
    let rounded = |n: u64| if main == 0 { 0 } else { (2 * n * minor + main) / (2 * main) };
    steps(main, rounded, z_is_main, (x.signum(), z.signum()))
}

/// A taper with α in 4,096 parts.
pub(super) fn taper(z_is_main: bool, signs: (i64, i64), main: u64, alpha: u64) -> Vec<Step> {
    let alpha = if alpha == 0 { 4_096 } else { alpha };
    steps(main, |n| (n * alpha + 2_048) / 4_096, z_is_main, signs)
}

/// Where an arc ends.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum End {
    Steps(u64),
    /// At this place, after so many changes of quadrant.
    At {
        z: i128,
        x: i128,
        changes: u32,
    },
}

/// Signs of z and x in a quadrant, 0 to 3.
const SIGNS: [(i128, i128); 4] = [(1, 1), (-1, 1), (-1, -1), (1, -1)];

/// An arc around 0 from (z, x), whose steps are `size` long; squares are looked at anew each time.
pub(super) fn arc(
    clockwise: bool,
    mut quadrant: usize,
    (mut z, mut x): (i128, i128),
    square: i128,
    size: i128,
    end: End,
) -> Vec<Step> {
    let mut done = Vec::new();
    let mut changes_left = match end {
        End::Steps(_) => u32::MAX,
        End::At { changes, .. } => changes,
    };
    loop {
        // The page's table: which axis goes inward.
        let inward_is_z = match quadrant {
            0 | 2 => !clockwise,
            _ => clockwise,
        };
        let (z_sign, x_sign) = SIGNS[quadrant];
        let inner = if inward_is_z { z * z_sign } else { x * x_sign };
        let outer = if inward_is_z { x * x_sign } else { z * z_sign };
        // At 0, or nearer to it than half a step.
        if changes_left > 0 && 2 * inner < size {
            quadrant = (quadrant + if clockwise { 3 } else { 1 }) % 4;
            changes_left -= 1;
            continue;
        }
        // Ahead of the axis it is where the axis is crossed that counts.
        let crossed = z * z + x * x - if outer < 0 { outer * outer } else { 0 };
        let mut inward = crossed >= square;
        match end {
            End::Steps(steps) if done.len() as u64 == steps => return done,
            End::At { z: z_end, x: x_end, .. } if changes_left == 0 => {
                let inner_end = if inward_is_z { z_end * z_sign } else { x_end * x_sign };
                let outer_end = if inward_is_z { x_end * x_sign } else { z_end * z_sign };
                match (inner <= inner_end, outer >= outer_end) {
                    (true, true) => return done,
                    (true, false) => inward = false,
                    (false, true) => inward = true,
                    (false, false) => {}
                }
            }
            _ => {}
        }
        let by = if inward { -1 } else { 1 };
        let step = if inward == inward_is_z {
            let by = by * z_sign as i64;
            z += i128::from(by) * size;
            Step { x: 0, z: by, doubled: true }
        } else {
            let by = by * x_sign as i64;
            x += i128::from(by) * size;
            Step { x: by, z: 0, doubled: true }
        };
        done.push(step);
        if done.len() > 2_000_000 {
            return done;
        }
    }
}

/// Where steps lead to, in pulses of x and z.
pub(super) fn sum(steps: &[Step]) -> (i64, i64) {
    steps
        .iter()
        .fold((0, 0), |(x, z), step| (x + step.x * if step.doubled { 2 } else { 1 }, z + step.z))
}
