//! What is exact in whole numbers.

/// The largest whole number whose square is at most `value`.
#[inline(never)]
pub(crate) fn root(value: u64) -> u64 {
    let (mut root, mut rest, mut bit) = (0, value, 1_u64 << 62);
    while bit > 0 {
        let tried = root + bit;
        root >>= 1;
        if rest >= tried {
            rest -= tried;
            root += bit;
        }
        bit >>= 2;
    }
    root
}

/// `a / b`, rounded half up.
pub(crate) fn rounded(a: u64, b: u64) -> u64 {
    (2 * a + b) / (2 * b.max(1))
}

/// To the nearest multiple of `unit`, half away from 0, in units.
#[inline(never)]
pub(crate) fn nearest(value: i64, unit: i64) -> i64 {
    (value.abs() + unit / 2) / unit * value.signum()
}
