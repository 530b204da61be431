//! Whole numbers of 128 bits, for what is exact.

/// The largest whole number whose square is at most `value`.
pub(crate) fn root(value: u128) -> u64 {
    let (mut root, mut rest) = (0_u128, value);
    let mut bit = 1_u128 << 126;
    while bit > 0 {
        if rest >= root + bit {
            rest -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
        bit >>= 2;
    }
    root as u64
}

/// `a · b / c`, rounded half up; `c` is not 0.
pub(crate) fn scaled(a: u64, b: u64, c: u64) -> u128 {
    (2 * u128::from(a) * u128::from(b) + u128::from(c)) / (2 * u128::from(c))
}

/// To the nearest multiple of `unit`, half away from 0, in units.
pub(crate) fn nearest(value: i64, unit: i64) -> i64 {
    (value.abs() + unit / 2) / unit * value.signum()
}
